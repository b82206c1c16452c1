/* The margins of a window, four series in lockstep: h_t = ω + α e²_{t-1} + β h_{t-1}, e_0² = h_0 = 1, each series in
   units of its own mean square. A group of fewer than four series is filled up with the last one. */

typedef struct {
    v4 omega, alpha, beta, scale;
    int place[VG_LANES], count;
} VG(dcc_group);

VG_INLINE v4 VG(dcc_take)(const VG(dcc_group) *g, const double *row) {
    return (v4){row[g->place[0]], row[g->place[1]], row[g->place[2]], row[g->place[3]]};
}

VG_INLINE VG(dcc_group) VG(dcc_group_of)(const dcc_windows *all, ptrdiff_t k, int first) {
    const int n = all->n;
    const double *r = all->series + k * all->samples * n;
    VG(dcc_group) g;
    g.count = n - first < VG_LANES ? n - first : VG_LANES;
    for (int lane = 0; lane < VG_LANES; lane++) g.place[lane] = lane < g.count ? first + lane : n - 1;
    v4 sum = v4_set(0);
    for (ptrdiff_t t = 0; t < all->samples; t++) {
        v4 x = VG(dcc_take)(&g, r + t * n);
        sum += x * x;
    }
    g.scale = sum / (double)all->samples;
    g.omega = VG(dcc_take)(&g, all->omega + k * n) / g.scale;
    g.alpha = VG(dcc_take)(&g, all->alpha + k * n);
    g.beta = VG(dcc_take)(&g, all->beta + k * n);
    return g;
}

/* h and z of every series of window k. */
VG_NOINLINE void VG(dcc_paths)(const dcc_windows *all, ptrdiff_t k, double *h, double *z) {
    const int n = all->n;
    const double *r = all->series + k * all->samples * n;
    for (int first = 0; first < n; first += VG_LANES) {
        const VG(dcc_group) g = VG(dcc_group_of)(all, k, first);
        v4 variance = g.omega + (g.alpha + g.beta);
        for (ptrdiff_t t = 0; t < all->samples; t++) {
            v4 x = VG(dcc_take)(&g, r + t * n), size = variance * g.scale;
            v4 scaled = x / (v4){sqrt(size[0]), sqrt(size[1]), sqrt(size[2]), sqrt(size[3])};
            for (int lane = 0; lane < g.count; lane++) {
                h[t * n + g.place[lane]] = variance[lane];
                z[t * n + g.place[lane]] = scaled[lane];
            }
            variance = g.omega + g.alpha * (x * x / g.scale) + g.beta * variance;
        }
    }
}

/* Of a group: hessian [6] of the log-likelihood in (ω, α, β), lower triangle, summed over the samples.
   With weight [2, 3], instead: each [samples, 2] loses weight · (score of the sample), summed over the group. */
VG_INLINE void VG(dcc_margin_pass)(const dcc_memory *m, const VG(dcc_group) *g, v4 *hessian, const v4 *weight) {
    const dcc_window *w = &m->window;
    v4 slope[3] = {v4_set(1), v4_set(1), v4_set(1)}, second[3] = {v4_set(0), v4_set(0), v4_set(0)};
    for (ptrdiff_t t = 0; t < w->samples; t++) {
        v4 h = VG(dcc_take)(g, w->h + t * w->n), z = VG(dcc_take)(g, w->z + t * w->n);
        v4 square = z * z, inverse = 1.0 / h;
        v4 score = 0.5 * (square - 1.0) * inverse;
        if (weight)
            for (int k = 0; k < 2; k++) {
                const v4 *c = weight + 3 * k;
                m->each[2 * t + k] -= VG(dcc_sum)(score * (c[0] * slope[0] + c[1] * slope[1] + c[2] * slope[2]));
            }
        else {
            v4 curve = (0.5 - square) * inverse * inverse;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j <= i; j++) hessian[DCC_AT(i, j)] += curve * (slope[i] * slope[j]);
            for (int i = 0; i < 3; i++) {
                hessian[DCC_AT(2, i)] += score * second[i];
                second[i] = (i == 2 ? 2 * slope[i] : slope[i]) + g->beta * second[i];
            }
        }
        slope[0] = 1.0 + g->beta * slope[0];
        slope[1] = square * h + g->beta * slope[1];
        slope[2] = h + g->beta * slope[2];
    }
}
