/* The greatest L_c over the triangle a >= 0, b >= 0, a + b <= max: from the peaks of a coarse
   profile by BFGS steps that solve their quadratic model over the triangle. */

/* z, h, S and the quarters of window k. Returns DCC_NOT_FINITE or DCC_FITTED. */
VG_NOINLINE uint8_t VG(dcc_prepare)(const dcc_windows *all, ptrdiff_t k, dcc_memory *m) {
    dcc_window *w = &m->window;
    const int n = w->n;
    const ptrdiff_t steps = (w->samples + 3) / 4, before = 4 * steps - w->samples;
    if (all->omega) {
        VG(dcc_paths)(all, k, w->h, m->filled);
        w->z = m->filled;
    } else
        w->z = all->series + k * w->samples * n;
    v4 sums[DCC_TRI(DCC_MAX)];
    for (int at = 0; at < DCC_TRI(n); at++) sums[at] = v4_set(0);
    for (ptrdiff_t s = 0; s < steps; s++) {
        v4 *z = w->quarter + s * n;
        for (int i = 0; i < n; i++) {
            for (int lane = 0; lane < VG_LANES; lane++) {
                ptrdiff_t t = lane * steps + s - before;
                z[i][lane] = t < 0 ? 0 : w->z[t * n + i];
            }
            for (int j = 0; j <= i; j++) sums[DCC_AT(i, j)] += z[i] * z[j];
        }
    }
    w->squares = 0;
    for (int i = 0; i < n; i++) {
        double diagonal = VG(dcc_sum)(sums[DCC_AT(i, i)]);
        w->squares += diagonal;
        for (int j = 0; j < i; j++)
            w->target[DCC_AT(i, j)] =
                VG(dcc_sum)(sums[DCC_AT(i, j)]) / sqrt(diagonal * VG(dcc_sum)(sums[DCC_AT(j, j)]));
        w->target[DCC_AT(i, i)] = 1;
    }
    return isfinite(w->squares) ? DCC_FITTED : DCC_NOT_FINITE;
}

/* A point, -L_c / T there, its gradient, and the model's Hessian (aa, ab, bb). */
typedef struct {
    double x[2], f, g[2], h[3];
} VG(dcc_point);

VG_INLINE double VG(dcc_model)(const VG(dcc_point) *p, double da, double db) {
    return p->g[0] * da + p->g[1] * db + 0.5 * (p->h[0] * da * da + 2 * p->h[1] * da * db + p->h[2] * db * db);
}

/* The least of the model over the triangle; returns by how much it is below the point. */
VG_INLINE double VG(dcc_model_minimum)(const VG(dcc_point) *p, double max, double *x) {
    const double *h = p->h, corner[4][2] = {{0, 0}, {max, 0}, {0, max}, {0, 0}};
    double det = h[0] * h[2] - h[1] * h[1];
    double a = p->x[0] - (h[2] * p->g[0] - h[1] * p->g[1]) / det, b = p->x[1] - (h[0] * p->g[1] - h[1] * p->g[0]) / det;
    x[0] = a, x[1] = b;
    double least = a >= 0 && b >= 0 && a + b <= max ? VG(dcc_model)(p, a - p->x[0], b - p->x[1]) : INFINITY;
    if (least < INFINITY) return -least;
    for (int edge = 0; edge < 3; edge++) {
        const double *from = corner[edge], *to = corner[edge + 1];
        double da = to[0] - from[0], db = to[1] - from[1], ea = from[0] - p->x[0], eb = from[1] - p->x[1];
        double slope = (p->g[0] + h[0] * ea + h[1] * eb) * da + (p->g[1] + h[1] * ea + h[2] * eb) * db;
        double curve = h[0] * da * da + 2 * h[1] * da * db + h[2] * db * db;
        double s = fmin(fmax(-slope / curve, 0), 1);
        double value = VG(dcc_model)(p, ea + s * da, eb + s * db);
        if (value < least) least = value, x[0] = from[0] + s * da, x[1] = from[1] + s * db;
    }
    return -least;
}

VG_INLINE void VG(dcc_evaluate)(const dcc_window *w, VG(dcc_point) *p, double *outer) {
    p->f = -VG(dcc_score)(w, p->x[0], p->x[1], p->g, outer, NULL);
    p->g[0] = -p->g[0], p->g[1] = -p->g[1];
}

/* BFGS: the Hessian of `next` from that of `last`; unchanged where the curvature along the step is not positive. */
VG_INLINE void VG(dcc_update)(const VG(dcc_point) *last, VG(dcc_point) *next) {
    const double *h = last->h, s[2] = {next->x[0] - last->x[0], next->x[1] - last->x[1]};
    double y[2] = {next->g[0] - last->g[0], next->g[1] - last->g[1]}, sy = s[0] * y[0] + s[1] * y[1];
    double hs[2] = {h[0] * s[0] + h[1] * s[1], h[1] * s[0] + h[2] * s[1]}, shs = s[0] * hs[0] + s[1] * hs[1];
    memcpy(next->h, h, sizeof(next->h));
    if (!(shs > 0) || !(sy > 1e-8 * shs)) return;
    next->h[0] += y[0] * y[0] / sy - hs[0] * hs[0] / shs;
    next->h[1] += y[0] * y[1] / sy - hs[0] * hs[1] / shs;
    next->h[2] += y[1] * y[1] / sy - hs[1] * hs[1] / shs;
}

/* From the point x to a local optimum; returns L_c / T there, NaN where x itself is not usable. */
VG_NOINLINE double VG(dcc_climb)(const dcc_window *w, double max, double *x) {
    const double enough = fmax(1e-8 / (double)w->samples, 1e-14);
    VG(dcc_point) point = {.x = {x[0], x[1]}}, next;
    VG(dcc_evaluate)(w, &point, point.h);
    if (!isfinite(point.f)) return NAN;
    /* The information of the samples is the first model; a ridge keeps it invertible. */
    double ridge = 1e-10 * (point.h[0] + point.h[2]) + 1e-300;
    point.h[0] += ridge, point.h[2] += ridge;
    for (int step = 0; step < 50; step++) {
        double target[2], gain = VG(dcc_model_minimum)(&point, max, target), share = 1;
        if (!(gain > enough)) break;
        double da = target[0] - point.x[0], db = target[1] - point.x[1], slope = point.g[0] * da + point.g[1] * db;
        for (int cut = 0; cut < 12; cut++) {
            next.x[0] = share < 1 ? point.x[0] + share * da : target[0];
            next.x[1] = share < 1 ? point.x[1] + share * db : target[1];
            double outer[3];
            VG(dcc_evaluate)(w, &next, outer);
            if (next.f <= point.f + 1e-4 * share * slope) break;
            double best = isfinite(next.f) ? -slope * share / (2 * ((next.f - point.f) / share - slope)) : 0;
            share = fmin(fmax(best, 0.1 * share), 0.5 * share);
        }
        if (!(next.f < point.f)) break;
        VG(dcc_update)(&point, &next);
        point = next;
    }
    x[0] = point.x[0], x[1] = point.x[1];
    return -point.f;
}

/* The best a for a fixed b, and L_c / T there, from L_c at a = 0 and at two other places: a parabola's, which is kept
   away from 0 and from a + b = 1. */
VG_INLINE double VG(dcc_profile)(const dcc_window *w, double constant, double b, double *a) {
    const double high = fmin(0.6 * (1 - b), 0.25), low = 0.15 * high, places[2] = {low, high};
    double value[2];
    VG(dcc_values)(w, places, b, value);
    const double at_low = value[0], at_high = value[1];
    *a = low;
    if (!isfinite(at_low)) return -INFINITY;
    if (!isfinite(at_high)) return at_low;
    const double rise = (at_low - constant) / low, bend = ((at_high - constant) / high - rise) / (high - low);
    if (bend < 0) *a = fmin(fmax(0.5 * (low - rise / bend), 0.1 * low), 0.95 * (1 - b));
    else if (at_high > at_low) *a = high;
    return constant + *a * (rise + (*a - low) * bend);
}

VG_INLINE void VG(dcc_try)(const dcc_window *w, double max, double a, double b, double *best, double *optimum) {
    double x[2] = {a, b}, value = VG(dcc_climb)(w, max, x);
    if (value > *best) *best = value, memcpy(optimum, x, sizeof(x));
}

/* A small stateless grid: climbs from the peaks of the profile in b, and from near a + b = 1 where that is higher. */
VG_NOINLINE void VG(dcc_maximise)(const dcc_window *w, const dcc_rules *rules, double *values) {
    static const double grid[] = {0, 0.12, 0.3, 0.55, 0.75, 0.87, 0.94, 0.975, 0.99, 0.997}, edge[] = {0.005, 0.02};
    enum { POINTS = sizeof(grid) / sizeof(grid[0]), EDGES = sizeof(edge) / sizeof(edge[0]) };
    const double max = rules->persistence_max;
    double a[POINTS], profile[POINTS + 2], ends[EDGES][2], optimum[2] = {0, 0};
    for (int k = 0; k < EDGES; k++) {
        const double places[2] = {0, edge[k]};
        VG(dcc_values)(w, places, max - edge[k], ends[k]);
    }
    const double constant = ends[0][0];
    double best = constant;
    profile[0] = profile[POINTS + 1] = -INFINITY;
    for (int k = 0; k < POINTS; k++) profile[k + 1] = VG(dcc_profile)(w, constant, grid[k], &a[k]);
    for (int k = 0; k < POINTS; k++)
        if (profile[k + 1] > profile[k] && profile[k + 1] >= profile[k + 2])
            VG(dcc_try)(w, max, a[k], grid[k], &best, optimum);
    for (int k = 0; k < EDGES; k++)
        if (ends[k][1] > best) VG(dcc_try)(w, max, edge[k], max - edge[k], &best, optimum);
    const int moves = best - constant >= rules->gain;
    values[DCC_A] = moves ? optimum[0] : 0;
    values[DCC_B] = moves ? optimum[1] : 0;
    values[DCC_LIKELIHOOD] = (moves ? best : constant) * (double)w->samples;
    values[DCC_LIKELIHOOD_CCC] = constant * (double)w->samples;
}

VG_NOINLINE uint8_t VG(dcc_fit)(const dcc_windows *all, const dcc_rules *rules, ptrdiff_t k, dcc_memory *m,
                                double *values, double *target) {
    const int n = all->n;
    double root[DCC_MAX * DCC_MAX];
    if (VG(dcc_prepare)(all, k, m) == DCC_NOT_FINITE) return DCC_NOT_FINITE;
    if (!(VG(dcc_whitener)(&m->window, root) >= rules->eigenvalue_min)) return DCC_SINGULAR;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) target[i * n + j] = m->window.target[DCC_AT(i, j)];
    VG(dcc_maximise)(&m->window, rules, values);
    values[DCC_STATISTIC] = VG(dcc_statistic)(m, root, rules->lags);
    return DCC_FITTED;
}
