#include "statespace.h"

#include "vg.h"

/* The recursions run one sample after the other: no instruction set helps them. They are written for any number of
   states n and compiled for each, so that n is a constant and the loops unroll. */
#define FOR(i) for (int i = 0; i < n; i++)

typedef struct {
    double x[VG_STATES], P[VG_STATES * VG_STATES];
} vg_belief;

/* What an update leaves for the way back. */
typedef struct {
    double read[VG_STATES], gain[VG_STATES], innovation, variance;
} vg_update;

/* What the backward pass needs of a sample: mean and variance of c'x, P·c after the update, the gain K, v/f and 1/f. */
typedef struct {
    double mean, variance, spread[VG_STATES], gain[VG_STATES], last, innovation, precision;
} vg_step;

/* x ← F x, P ← F P F' + Q. */
VG_INLINE void predict(const int n, const double *F, const double *Q, vg_belief *b) {
    double x[VG_STATES], M[VG_STATES * VG_STATES];
    FOR(i) {
        double sum = 0.0;
        FOR(k) sum += F[i * n + k] * b->x[k];
        x[i] = sum;
        FOR(j) {
            double product = 0.0;
            FOR(k) product += F[i * n + k] * b->P[k * n + j];
            M[i * n + j] = product;
        }
    }
    FOR(i) {
        b->x[i] = x[i];
        for (int j = 0; j <= i; j++) {
            double product = Q[i * n + j];
            FOR(k) product += M[i * n + k] * F[j * n + k];
            b->P[i * n + j] = b->P[j * n + i] = product;
        }
    }
}

/* Takes z = h'x + noise of variance r (of which the last state holds √r parts where it is coloured). Joseph's form,
   (I - K h') P (I - K h')' + K r K', one product after the other. Returns 0 where z says nothing. */
VG_INLINE int update(const int n, const int coloured, const double *reads, double z, double r, vg_belief *b,
                     vg_update *u) {
    if (r == INFINITY) return 0;
    double g[VG_STATES], own = coloured ? 0.0 : r;
    FOR(i) u->read[i] = reads[i];
    if (coloured) u->read[n - 1] = sqrt(r);
    double v = z, f = own;
    FOR(i) {
        double sum = 0.0;
        FOR(k) sum += b->P[i * n + k] * u->read[k];
        g[i] = sum;
    }
    FOR(i) {
        v -= u->read[i] * b->x[i];
        f += u->read[i] * g[i];
    }
    double *K = u->gain;
    FOR(i) {
        K[i] = g[i] / f;
        b->x[i] += K[i] * v;
    }
    double B[VG_STATES * VG_STATES];
    FOR(i) FOR(j) B[i * n + j] = b->P[i * n + j] - K[i] * g[j];
    FOR(i) {
        double rest = 0.0;
        FOR(k) rest += B[i * n + k] * u->read[k];
        for (int j = 0; j <= i; j++) b->P[i * n + j] = b->P[j * n + i] = B[i * n + j] + (K[i] * own - rest) * K[j];
    }
    u->innovation = v;
    u->variance = f;
    return 1;
}

VG_INLINE ptrdiff_t regime_of(const vg_measured *m, ptrdiff_t t) { return m->regime == NULL ? 0 : m->regime[t]; }

VG_INLINE void predict_to(const int n, const vg_statespace *s, const vg_measured *m, ptrdiff_t t, vg_belief *b) {
    ptrdiff_t place = regime_of(m, t) * n * n;
    predict(n, s->transition + place, s->process + place, b);
}

VG_INLINE void begin(const int n, const double *start, const double *spread, vg_belief *b) {
    memcpy(b->x, start, (size_t)n * sizeof(double));
    memcpy(b->P, spread, (size_t)(n * n) * sizeof(double));
}

VG_INLINE void likelihood(const int n, const vg_statespace *s, const vg_measured *m, const double *start,
                          const double *spread, ptrdiff_t skip, vg_likelihood *result) {
    vg_belief b;
    vg_update u;
    begin(n, start, spread, &b);
    double squares = 0.0, product = 1.0;
    int64_t exponent = 0, count = 0;
    for (ptrdiff_t t = 0; t < m->samples; t++) {
        if (t > 0) predict_to(n, s, m, t, &b);
        if (!update(n, s->coloured, s->reads, m->z[t], m->noise[t * m->noise_step], &b, &u)) continue;
        if (skip > 0) {
            skip--;
            continue;
        }
        squares += u.innovation * u.innovation / u.variance;
        product *= u.variance > 0.0 ? u.variance : NAN;
        count++;
        if (product < 0x1p-200 || product > 0x1p200) {
            int part;
            product = frexp(product, &part);
            exponent += part;
        }
    }
    *result = (vg_likelihood){squares, product, exponent, count};
}

/* The filter over samples [first, stop), whose belief before its first measurement is b; steps NULL: nothing is kept. */
VG_INLINE void forward(const int n, const vg_statespace *s, const vg_measured *m, ptrdiff_t first, ptrdiff_t stop,
                       vg_belief *b, vg_step *steps) {
    vg_update u;
    for (ptrdiff_t t = first; t < stop; t++) {
        if (t > first) predict_to(n, s, m, t, b);
        int told = update(n, s->coloured, s->reads, m->z[t], m->noise[t * m->noise_step], b, &u);
        if (steps == NULL) continue;
        vg_step *step = steps + (t - first);
        step->mean = step->variance = 0.0;
        FOR(i) {
            double sum = 0.0;
            FOR(k) sum += b->P[i * n + k] * s->wanted[k];
            step->spread[i] = sum;
        }
        FOR(i) {
            step->mean += s->wanted[i] * b->x[i];
            step->variance += s->wanted[i] * step->spread[i];
        }
        step->precision = told ? 1.0 / u.variance : 0.0;
        if (!told) continue;
        FOR(i) step->gain[i] = u.gain[i];
        step->last = u.read[n - 1];
        step->innovation = u.innovation * step->precision;
    }
}

/* What all later samples say: score a [n] and information A [n, n] of the state, carried back over its step. */
VG_INLINE void carry_back(const int n, const double *F, double *a, double *A) {
    double b[VG_STATES], M[VG_STATES * VG_STATES];
    FOR(i) {
        double sum = 0.0;
        FOR(k) sum += F[k * n + i] * a[k];
        b[i] = sum;
        FOR(j) {
            double product = 0.0;
            FOR(k) product += F[k * n + i] * A[k * n + j];
            M[i * n + j] = product;
        }
    }
    FOR(i) {
        a[i] = b[i];
        for (int j = 0; j <= i; j++) {
            double product = 0.0;
            FOR(k) product += M[i * n + k] * F[k * n + j];
            A[i * n + j] = A[j * n + i] = product;
        }
    }
}

/* a ← a + h (v/f - K'a), A ← (I - K h')' A (I - K h') + h h'/f. */
VG_INLINE void take_back(const int n, const double *reads, int coloured, const vg_step *step, double *a, double *A) {
    const double *K = step->gain;
    double h[VG_STATES], AK[VG_STATES], part = step->innovation, square = step->precision;
    FOR(i) h[i] = reads[i];
    if (coloured) h[n - 1] = step->last;
    FOR(i) {
        double sum = 0.0;
        FOR(k) sum += A[i * n + k] * K[k];
        AK[i] = sum;
    }
    FOR(i) {
        part -= K[i] * a[i];
        square += K[i] * AK[i];
    }
    FOR(i) a[i] += h[i] * part;
    FOR(i) for (int j = 0; j <= i; j++) {
        double sum = A[i * n + j] - (h[i] * AK[j] + AK[i] * h[j]) + h[i] * h[j] * square;
        A[i * n + j] = A[j * n + i] = sum;
    }
}

VG_INLINE int smooth(const int n, const vg_statespace *s, const vg_measured *m, const double *start,
                     const double *spread, double *smoothed, double *variance) {
    ptrdiff_t chunks = (m->samples + VG_STATESPACE_CHUNK - 1) / VG_STATESPACE_CHUNK;
    if (chunks == 0) return 0;
    vg_belief *kept = malloc((size_t)chunks * sizeof(vg_belief));
    vg_step *steps = malloc(VG_STATESPACE_CHUNK * sizeof(vg_step));
    if (kept == NULL || steps == NULL) {
        free(kept);
        free(steps);
        return -2;
    }
    begin(n, start, spread, kept);
    for (ptrdiff_t chunk = 0; chunk + 1 < chunks; chunk++) {
        ptrdiff_t stop = (chunk + 1) * VG_STATESPACE_CHUNK;
        vg_belief b = kept[chunk];
        forward(n, s, m, stop - VG_STATESPACE_CHUNK, stop, &b, NULL);
        predict_to(n, s, m, stop, &b);
        kept[chunk + 1] = b;
    }
    double a[VG_STATES] = {0.0}, A[VG_STATES * VG_STATES] = {0.0};
    for (ptrdiff_t chunk = chunks - 1; chunk >= 0; chunk--) {
        ptrdiff_t first = chunk * VG_STATESPACE_CHUNK;
        ptrdiff_t stop = m->samples - first < VG_STATESPACE_CHUNK ? m->samples : first + VG_STATESPACE_CHUNK;
        forward(n, s, m, first, stop, kept + chunk, steps);
        for (ptrdiff_t t = stop - 1; t >= first; t--) {
            const vg_step *step = steps + (t - first);
            if (t + 1 < m->samples) carry_back(n, s->transition + regime_of(m, t + 1) * n * n, a, A);
            double mean = step->mean, less = 0.0;
            FOR(i) {
                double sum = 0.0;
                FOR(k) sum += A[i * n + k] * step->spread[k];
                less += step->spread[i] * sum;
                mean += step->spread[i] * a[i];
            }
            smoothed[t] = mean;
            variance[t] = step->variance - less;
            if (step->precision > 0.0) take_back(n, s->reads, s->coloured, step, a, A);
        }
    }
    free(kept);
    free(steps);
    return 0;
}

#define EACH_SIZE(call) \
    switch (model->states) { \
    case 1: call(1); break; \
    case 2: call(2); break; \
    case 3: call(3); break; \
    case 4: call(4); break; \
    case 5: call(5); break; \
    case 6: call(6); break; \
    case 7: call(7); break; \
    case 8: call(8); break; \
    case 9: call(9); break; \
    case 10: call(10); break; \
    default: call(11); break; \
    }

void vg_statespace_likelihood(const vg_statespace *model, const vg_measured *measured, const double *start,
                              const double *spread, ptrdiff_t skip, vg_likelihood *result) {
#define CALL(n) likelihood(n, model, measured, start, spread, skip, result)
    EACH_SIZE(CALL)
#undef CALL
}

int vg_statespace_smooth(const vg_statespace *model, const vg_measured *measured, const double *start,
                         const double *spread, double *smoothed, double *variance) {
    int status = 0;
#define CALL(n) status = smooth(n, model, measured, start, spread, smoothed, variance)
    EACH_SIZE(CALL)
#undef CALL
    return status;
}
