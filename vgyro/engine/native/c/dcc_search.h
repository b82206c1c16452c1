/* The greatest L_c over the triangle a >= 0, b >= 0, a + b <= max: from the peaks of a coarse
   profile by BFGS steps that solve their quadratic model over the triangle. */

/* Is one of the series of window k the same number throughout, or, of standardised ones, NaN throughout? */
VG_INLINE int VG(dcc_constant)(const dcc_windows *all, ptrdiff_t k, double flat) {
    const ptrdiff_t samples = all->samples, n = all->n;
    for (ptrdiff_t i = 0; i < n; i++) {
        const double *x = all->series + k * samples * n + i, first = x[0], width = flat * fabs(first);
        const int unknown = !all->omega && isnan(first);
        ptrdiff_t t = 0;
        while (t < samples && (unknown ? isnan(x[t * n]) : fabs(x[t * n] - first) <= width)) t++;
        if (t == samples) return 1;
    }
    return 0;
}

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

/* A place to climb from: (a, b), L_c / T that a parabola expects there, and the highest of those that were computed for
   this b, with its a. */
typedef struct {
    double a, b, expected, seen_a, seen;
} VG(dcc_place);

/* The best a for a fixed b, from L_c at a = 0 and at two other places: a parabola's, which is kept away from 0 and from
   a + b = 1. */
VG_INLINE VG(dcc_place) VG(dcc_profile)(const dcc_window *w, double constant, double b) {
    const double high = fmin(0.6 * (1 - b), 0.25), low = 0.15 * high, places[2] = {low, high};
    double value[2];
    VG(dcc_values)(w, places, b, value);
    const double at_low = value[0], at_high = value[1];
    VG(dcc_place) p = {low, b, at_low, low, at_low};
    if (!isfinite(at_low)) p.expected = p.seen = -INFINITY;
    if (!isfinite(at_low) || !isfinite(at_high)) return p;
    if (at_high > at_low) p.seen_a = high, p.seen = at_high;
    const double rise = (at_low - constant) / low, bend = ((at_high - constant) / high - rise) / (high - low);
    if (bend < 0) p.a = fmin(fmax(0.5 * (low - rise / bend), 0.1 * low), 0.95 * (1 - b));
    else p.a = p.seen_a;
    p.expected = constant + p.a * (rise + (p.a - low) * bend);
    return p;
}

/* Climb from (a, b) and keep where that leads, if it is the highest so far. */
VG_INLINE void VG(dcc_try)(const dcc_window *w, double max, double a, double b, double *best, double *optimum) {
    double x[2] = {a, b}, value = VG(dcc_climb)(w, max, x);
    if (value > *best) *best = value, memcpy(optimum, x, sizeof(x));
}

/* A peak at a = 0 is followed if it promises this share of `gain`, and if no maximum found so far is higher than this
   multiple of the promise. Maxima of more than DCC_RIM_ENOUGH in L_c itself are wide enough for the grid. */
#define DCC_RIM_LEAST 0.25
#define DCC_RIM_MOST 2.0
#define DCC_RIM_ENOUGH 4.0

/* Maxima so near a = 0 that no grid in a shows them. At a = 0 the quadratic model of L_c in a, with the information of
   the samples, has its maximum rise²/(2·square) at a = rise/square: climbs from the peaks of that over b. */
VG_NOINLINE void VG(dcc_rim)(const dcc_window *w, const double *root, const dcc_rules *rules, double constant,
                             double *best, double *optimum) {
    static const double b[DCC_SLOPES] = {0,    0.1,  0.2,  0.3,  0.4,  0.5,   0.6,   0.68,  0.75,  0.81,
                                         0.86, 0.89, 0.92, 0.94, 0.96, 0.972, 0.982, 0.989, 0.994, 0.998};
    if ((*best - constant) * (double)w->samples > DCC_RIM_ENOUGH) return;
    const int n = w->n;
    double inverse[DCC_TRI(DCC_MAX)], rise[DCC_SLOPES], square[DCC_SLOPES], promise[DCC_SLOPES + 2];
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            inverse[DCC_AT(i, j)] = 0;
            for (int k = 0; k < n; k++) inverse[DCC_AT(i, j)] += root[i * n + k] * root[j * n + k];
        }
    VG(dcc_slopes)(w, inverse, b, rise, square);
    promise[0] = promise[DCC_SLOPES + 1] = -INFINITY;
    for (int k = 0; k < DCC_SLOPES; k++) promise[k + 1] = rise[k] > 0 ? rise[k] * rise[k] / (2 * square[k]) : 0;
    for (int k = 0; k < DCC_SLOPES; k++) {
        const double here = promise[k + 1], found = *best - constant;
        if (!(here > promise[k] && here >= promise[k + 2])) continue;
        if (here < DCC_RIM_LEAST * rules->gain || found > DCC_RIM_MOST * here) continue;
        VG(dcc_try)(w, rules->persistence_max, fmin(rise[k] / square[k], 0.5 * (1 - b[k])), b[k], best, optimum);
    }
}

/* A small stateless grid: climbs from the peaks of the profile in b, from a = 0, and from any point that is known to be
   higher. Where b = 0 is the best, a middle b may be better by a little. root: S^-½. */
VG_NOINLINE void VG(dcc_maximise)(const dcc_window *w, const double *root, const dcc_rules *rules, double *values) {
    static const double grid[] = {0, 0.12, 0.3, 0.55, 0.75, 0.87, 0.94, 0.975, 0.99, 0.997}, edge[] = {0.005, 0.02};
    enum { POINTS = sizeof(grid) / sizeof(grid[0]), EDGES = sizeof(edge) / sizeof(edge[0]) };
    const double max = rules->persistence_max;
    VG(dcc_place) place[POINTS + EDGES];
    double constant = 0, optimum[2] = {0, 0};
    for (int k = 0; k < EDGES; k++) {
        const double places[2] = {0, edge[k]}, b = max - edge[k];
        double ends[2];
        VG(dcc_values)(w, places, b, ends);
        constant = ends[0];
        place[POINTS + k] = (VG(dcc_place)){edge[k], b, -INFINITY, edge[k], ends[1]};
    }
    double best = constant;
    for (int k = 0; k < POINTS; k++) place[k] = VG(dcc_profile)(w, constant, grid[k]);
    for (int k = 0; k < POINTS; k++) {
        const double before = k ? place[k - 1].expected : -INFINITY, after = place[k + 1].expected;
        if (place[k].expected > before && place[k].expected >= after)
            VG(dcc_try)(w, max, place[k].a, place[k].b, &best, optimum);
    }
    VG(dcc_rim)(w, root, rules, constant, &best, optimum);
    for (int k = 0; k < POINTS + EDGES; k++)
        if (place[k].seen > best) VG(dcc_try)(w, max, place[k].seen_a, place[k].b, &best, optimum);
    if (optimum[0] > 0 && optimum[1] == 0) VG(dcc_try)(w, max, fmin(optimum[0], 0.3), 0.4, &best, optimum);
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
    if (VG(dcc_constant)(all, k, rules->flat)) return DCC_CONSTANT;
    if (VG(dcc_prepare)(all, k, m) == DCC_NOT_FINITE) return DCC_NOT_FINITE;
    if (!(VG(dcc_whitener)(&m->window, root) >= rules->eigenvalue_min)) return DCC_SINGULAR;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) target[i * n + j] = m->window.target[DCC_AT(i, j)];
    VG(dcc_maximise)(&m->window, root, rules, values);
    values[DCC_STATISTIC] = VG(dcc_statistic)(m, root, rules);
    return DCC_FITTED;
}
