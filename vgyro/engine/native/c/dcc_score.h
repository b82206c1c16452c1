/* L_c of a window, its gradient in (a, b), and the sum of the outer products of the gradient's samples.

   The lanes are the quarters of the window in time. A is linear in its start, so a first pass over the quarters, each
   from A = 0, gives where each of them starts. Where the window is no multiple of four the first lane begins with up to
   three samples of zeros, and is cleared after them. */

VG_INLINE void DCC(clear_first)(const int n, const int slope, v4 *away, v4 *moved) {
    for (int at = 0; at < DCC_TRI(n); at++) {
        away[at][0] = 0;
        if (slope) moved[at][0] = 0;
    }
}

/* A and ∂A/∂b at the first sample of each quarter. */
VG_INLINE void DCC(starts)(const int n, const int slope, const dcc_window *w, double b, v4 *away, v4 *moved) {
    const ptrdiff_t steps = (w->samples + 3) / 4, before = 4 * steps - w->samples;
    const double power = pow(b, (double)(steps - 1)), decay = b * power;
    for (int at = 0; at < DCC_TRI(n); at++) away[at] = moved[at] = v4_set(0);
    for (ptrdiff_t s = 0; s < steps; s++) {
        if (s <= before) DCC(clear_first)(n, slope, away, moved);
        DCC(filter)(n, slope, v4_set(b), w->quarter + s * n, w->target, away, moved);
    }
    for (int at = 0; at < DCC_TRI(n); at++) {
        double start = 0, start_moved = 0;
        for (int k = 0; k < VG_LANES; k++) {
            double end = away[at][k] + decay * start;
            double end_moved = moved[at][k] + decay * start_moved + (double)steps * power * start;
            away[at][k] = start;
            moved[at][k] = start_moved;
            start = end;
            start_moved = end_moved;
        }
    }
}

VG_INLINE void DCC(add)(const int n, const v4 *q, const DCC(factor) *f, dcc_likelihood *l) {
    v4 diagonal = q[0];
    DCC_UNROLL
    for (int i = 1; i < n; i++) diagonal *= q[DCC_AT(i, i)];
    VG(dcc_multiply)(&l->det, f->det);
    VG(dcc_multiply)(&l->spread, diagonal);
    l->square += f->square;
    l->smallest = v4_min(l->smallest, f->smallest);
}

/* L_c / T at two a and one b, which share A: value [2], NaN where some Q_t is not positive definite. */
VG_INLINE void DCC(values_of)(const int n, const dcc_window *w, const double *a, double b, double *value) {
    const ptrdiff_t steps = (w->samples + 3) / 4, before = 4 * steps - w->samples;
    v4 away[DCC_TRI(DCC_DIM)], moved[DCC_TRI(DCC_DIM)], q[2][DCC_TRI(DCC_DIM)];
    dcc_likelihood likelihood[2] = {VG(dcc_open)(), VG(dcc_open)()};
    DCC(factor) f[2];
    DCC(starts)(n, 0, w, b, away, moved);
    for (ptrdiff_t s = 0; s < steps; s++) {
        const v4 *z = w->quarter + s * n;
        if (s <= before) {
            DCC(clear_first)(n, 0, away, moved);
            VG(dcc_forget)(&likelihood[0]);
            VG(dcc_forget)(&likelihood[1]);
        }
        DCC_UNROLL
        for (int k = 0; k < 2; k++) {
            DCC(apply)(n, v4_set(a[k]), w->target, away, q[k]);
            DCC(factorise)(n, q[k], z, &f[k]);
            DCC(add)(n, q[k], &f[k], &likelihood[k]);
        }
        DCC(filter)(n, 0, v4_set(b), z, w->target, away, moved);
    }
    for (int k = 0; k < 2; k++) value[k] = VG(dcc_close)(&likelihood[k], w);
}

/* L_c / T, its gradient [2], and the outer products of the gradient's samples (aa, ab, bb) / T.
   each [samples, 2], if not NULL, takes the gradient sample by sample. */
VG_INLINE double DCC(score_of)(const int n, const dcc_window *w, double a, double b, double *gradient, double *outer,
                               double *each) {
    const ptrdiff_t steps = (w->samples + 3) / 4, before = 4 * steps - w->samples;
    v4 away[DCC_TRI(DCC_DIM)], moved[DCC_TRI(DCC_DIM)], q[DCC_TRI(DCC_DIM)], weight[DCC_TRI(DCC_DIM)], u[DCC_DIM];
    v4 sums[5] = {v4_set(0), v4_set(0), v4_set(0), v4_set(0), v4_set(0)};
    dcc_likelihood likelihood = VG(dcc_open)();
    DCC(factor) f;
    DCC(starts)(n, 1, w, b, away, moved);
    for (ptrdiff_t s = 0; s < steps; s++) {
        const v4 *z = w->quarter + s * n;
        if (s <= before) {
            DCC(clear_first)(n, 1, away, moved);
            VG(dcc_forget)(&likelihood);
            for (int k = 0; k < 5; k++) sums[k][0] = 0;
        }
        DCC(apply)(n, v4_set(a), w->target, away, q);
        DCC(factorise)(n, q, z, &f);
        DCC(add)(n, q, &f, &likelihood);
        DCC(weigh)(n, z, &f, weight, u);
        v4 by_a = weight[0] * away[0], by_b = weight[0] * moved[0];
        DCC_UNROLL
        for (int at = 1; at < DCC_TRI(n); at++) {
            by_a += weight[at] * away[at];
            by_b += weight[at] * moved[at];
        }
        by_b *= a;
        v4 terms[5] = {by_a, by_b, by_a * by_a, by_a * by_b, by_b * by_b};
        for (int k = 0; k < 5; k++) sums[k] += terms[k];
        for (int k = 0; each && k < VG_LANES; k++) {
            ptrdiff_t t = k * steps + s - before;
            if (t < 0) continue;
            each[2 * t] = by_a[k];
            each[2 * t + 1] = by_b[k];
        }
        DCC(filter)(n, 1, v4_set(b), z, w->target, away, moved);
    }
    for (int k = 0; k < 5; k++) *(k < 2 ? gradient + k : outer + k - 2) = VG(dcc_sum)(sums[k]) / (double)w->samples;
    return VG(dcc_close)(&likelihood, w);
}

VG_NOINLINE void DCC(values)(const dcc_window *w, const double *a, double b, double *value) {
    DCC(values_of)(DCC_N(w), w, a, b, value);
}

VG_NOINLINE double DCC(score)(const dcc_window *w, double a, double b, double *gradient, double *outer, double *each) {
    return DCC(score_of)(DCC_N(w), w, a, b, gradient, outer, each);
}
