/* Stacks of matrices, and the path of the conditional covariance of windows: four in lockstep. */

#include "weights_problem.h"

/* Four matrices, the symmetric part in the lower triangle; the first place is NaN where one is not symmetric. */
VG_INLINE void VG(take_matrices)(size_t n, const double *const *from, v4 *H) {
    size_t place = 0;
#pragma GCC unroll 16
    for (; place + VG_LANES <= n * n; place += VG_LANES) VG(gather_four)(from, place, H + place);
    for (; place < n * n; place++) H[place] = VG(gather)(from, place);
    m4 different = {0}, asymmetric = {0};
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++) different |= H[i * n + j] != H[j * n + i];
    if (!m4_any(different)) return;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++) {
            const v4 difference = H[i * n + j] - H[j * n + i];
            asymmetric |= difference * difference > ASYMMETRY * ASYMMETRY * (H[i * n + i] * H[j * n + j]);
            H[i * n + j] = (H[i * n + j] + H[j * n + i]) * 0.5;
        }
    H[0] = v4_select(asymmetric, v4_set(NAN), H[0]);
}

/* Each lane takes a run of matrices, which may follow from one another. */
VG_INLINE void VG(min_variance_all)(size_t n, const double *H, size_t count, double *w) {
    v4 matrices[WEIGHTS_MAX * WEIGHTS_MAX], weights[WEIGHTS_MAX];
    m4 support[WEIGHTS_MAX];
    const size_t run = (count + VG_LANES - 1) / VG_LANES;
    for (size_t i = 0; i < n; i++) support[i] = ~(m4){0};
    for (size_t step = 0; step < run; step++) {
        size_t index[VG_LANES];
        const double *from[VG_LANES];
        for (size_t lane = 0; lane < VG_LANES; lane++) {
            index[lane] = lane * run + step;
            from[lane] = H + (index[lane] < count ? index[lane] : count - 1) * n * n;
        }
        VG(take_matrices)(n, from, matrices);
        const m4 good = VG(weigh)(n, matrices, support, weights);
        for (size_t lane = 0; lane < VG_LANES; lane++)
            for (size_t i = 0; i < n && index[lane] < count; i++)
                w[index[lane] * n + i] = good[lane] ? weights[i][lane] : NAN;
    }
}

static void VG(min_variance_weights)(size_t n, const double *H, size_t count, double *w) {
    if (n == 6)
        VG(min_variance_all)(6, H, count, w);
    else
        VG(min_variance_all)(n, H, count, w);
}

/* What four windows carry from sample to sample: h, √h, and the lower triangle of Q. */
typedef struct {
    v4 omega[WEIGHTS_MAX], alpha[WEIGHTS_MAX], beta[WEIGHTS_MAX], a, b;
    v4 h[WEIGHTS_MAX], deviation[WEIGHTS_MAX];
    v4 constant[WEIGHTS_MAX * WEIGHTS_MAX], Q[WEIGHTS_MAX * WEIGHTS_MAX];
    m4 support[WEIGHTS_MAX]; /* of the weights before */
    m4 leading;              /* no sample yet with all its values */
} VG(state);

VG_INLINE v4 VG(root)(v4 x) {
    double lanes[VG_LANES];
    memcpy(lanes, &x, sizeof x);
    for (int lane = 0; lane < VG_LANES; lane++) lanes[lane] = sqrt(lanes[lane]);
    memcpy(&x, lanes, sizeof x);
    return x;
}

/* e of sample t; `leading` loses the lanes where all of them are finite. */
VG_INLINE void VG(take_sample)(size_t n, const double *const *r, size_t t, v4 *e, m4 *leading) {
    m4 finite = ~(m4){0};
    size_t gyro = 0;
    for (; gyro + VG_LANES <= n; gyro += VG_LANES) VG(gather_four)(r, t * n + gyro, e + gyro);
    for (; gyro < n; gyro++) e[gyro] = VG(gather)(r, t * n + gyro);
    for (size_t i = 0; i < n; i++) finite &= VG(absolute)(e[i]) < INFINITY;
    *leading &= ~finite;
}

/* h of the first sample: ω + (α + β)·mean(e²) over the window; Q = S. With a = 0 the correlation is constant: b = 0. */
VG_INLINE void VG(begin)(size_t n, const weights_windows *all, const double *const *r, const size_t *window, VG(state) *s) {
    v4 e[WEIGHTS_MAX], square[WEIGHTS_MAX], count = v4_set(0.0);
    const double *from[VG_LANES];
    for (size_t i = 0; i < n; i++) square[i] = count;
    s->leading = ~(m4){0};
    for (size_t t = 0; t < all->inside; t++) {
        VG(take_sample)(n, r, t, e, &s->leading);
        for (size_t i = 0; i < n; i++) square[i] += (v4)((m4)(e[i] * e[i]) & ~s->leading);
        count += (v4)((m4)v4_set(1.0) & ~s->leading);
    }
    s->leading = ~(m4){0};
#define VG_LANES_OF(array, size) \
    for (size_t lane = 0; lane < VG_LANES; lane++) from[lane] = all->array + window[lane] * (size)
    VG_LANES_OF(omega, n);
    for (size_t i = 0; i < n; i++) s->omega[i] = VG(gather)(from, i);
    VG_LANES_OF(alpha, n);
    for (size_t i = 0; i < n; i++) s->alpha[i] = VG(gather)(from, i);
    VG_LANES_OF(beta, n);
    for (size_t i = 0; i < n; i++) s->beta[i] = VG(gather)(from, i);
    VG_LANES_OF(a, 1);
    s->a = VG(gather)(from, 0);
    VG_LANES_OF(b, 1);
    s->b = (v4)((m4)VG(gather)(from, 0) & (s->a != 0.0));
    VG_LANES_OF(target, n * n);
#undef VG_LANES_OF
    for (size_t i = 0; i < n; i++) s->support[i] = ~(m4){0};
    const v4 rest = 1.0 - s->a - s->b;
    for (size_t i = 0; i < n; i++) {
        s->h[i] = s->omega[i] + (s->alpha[i] + s->beta[i]) * (square[i] / count);
        for (size_t j = 0; j <= i; j++) {
            s->Q[i * n + j] = VG(gather)(from, i * n + j);
            s->constant[i * n + j] = rest * s->Q[i * n + j];
        }
    }
}

/* h and Q of the next sample. */
VG_INLINE void VG(advance)(size_t n, const v4 *e, VG(state) *s) {
    v4 z[WEIGHTS_MAX];
    const m4 leading = s->leading, moving = s->a != 0.0;
    for (size_t i = 0; i < n; i++) {
        z[i] = (v4)((m4)(e[i] / s->deviation[i]) & moving);
        s->h[i] = v4_select(leading, s->h[i], s->omega[i] + s->alpha[i] * (e[i] * e[i]) + s->beta[i] * s->h[i]);
    }
    if (!m4_any(moving)) return;
#pragma GCC unroll 8
    for (size_t i = 0; i < n; i++) {
        const v4 az = s->a * z[i];
#pragma GCC unroll 8
        for (size_t j = 0; j <= i; j++) {
            const v4 next = s->constant[i * n + j] + az * z[j] + s->b * s->Q[i * n + j];
            s->Q[i * n + j] = v4_select(leading, s->Q[i * n + j], next);
        }
    }
}

/* Weights, √h and √(w'Hw) of sample t, H = D R D. */
VG_INLINE void VG(weigh_sample)(size_t n, const weights_windows *all, VG(state) *s, size_t t, size_t first, size_t lanes) {
    v4 H[WEIGHTS_MAX * WEIGHTS_MAX], w[WEIGHTS_MAX], factor[WEIGHTS_MAX], variance = v4_set(0.0);
    for (size_t i = 0; i < n; i++) factor[i] = s->deviation[i] / VG(root)(s->Q[i * n + i]);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) H[i * n + j] = s->Q[i * n + j] * factor[i] * factor[j];
        H[i * n + i] = s->h[i];
    }
    const m4 good = VG(weigh)(n, H, s->support, w);
    for (size_t i = 0; i < n; i++) {
        v4 cross = v4_set(0.0);
        for (size_t j = 0; j < i; j++) cross += H[i * n + j] * w[j];
        variance += w[i] * (2.0 * cross + H[i * n + i] * w[i]);
    }
    const v4 sigma = VG(root)(variance);
    for (size_t lane = 0; lane < lanes; lane++) {
        const size_t row = (first + lane) * (all->end - all->begin) + t - all->begin;
        for (size_t i = 0; i < n; i++) {
            all->weights[row * n + i] = w[i][lane];
            all->deviation[row * n + i] = s->deviation[i][lane];
        }
        all->sigma[row] = sigma[lane];
        all->good[row] = good[lane] != 0;
    }
}

VG_INLINE void VG(conditional_all)(size_t n, const weights_windows *all, size_t start, size_t stop) {
    VG(state) s;
    v4 e[WEIGHTS_MAX];
    for (size_t first = start; first < stop; first += VG_LANES) {
        const size_t lanes = stop - first < VG_LANES ? stop - first : VG_LANES;
        const double *r[VG_LANES];
        size_t window[VG_LANES];
        for (size_t lane = 0; lane < VG_LANES; lane++) {
            window[lane] = first + (lane < lanes ? lane : lanes - 1);
            r[lane] = all->r + (ptrdiff_t)window[lane] * all->apart;
        }
        VG(begin)(n, all, r, window, &s);
        for (size_t t = 0; t < all->end; t++) {
            for (size_t i = 0; i < n; i++) s.deviation[i] = VG(root)(s.h[i]);
            if (t >= all->begin) VG(weigh_sample)(n, all, &s, t, first, lanes);
            VG(take_sample)(n, r, t, e, &s.leading);
            VG(advance)(n, e, &s);
        }
    }
}

static void VG(conditional_weights)(const weights_windows *all, size_t start, size_t stop) {
    if (all->n == 6)
        VG(conditional_all)(6, all, start, stop);
    else
        VG(conditional_all)(all->n, all, start, stop);
}
