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

/* L_c / T, NaN where some Q_t is not positive definite. slope: also the gradient of L_c / T, and its outer products
   (aa, ab, bb). each [samples, 2], if not NULL, takes the gradient sample by sample. */
VG_INLINE double DCC(score_of)(const int n, const int slope, const dcc_window *w, double a, double b, double *gradient,
                               double *outer, double *each) {
    const ptrdiff_t steps = (w->samples + 3) / 4, before = 4 * steps - w->samples;
    const double share = 1 / (double)w->samples;
    v4 away[DCC_TRI(DCC_DIM)], moved[DCC_TRI(DCC_DIM)], q[DCC_TRI(DCC_DIM)], weight[DCC_TRI(DCC_DIM)], u[DCC_DIM];
    v4 square = v4_set(0), sums[5] = {square, square, square, square, square}, smallest = v4_set(1);
    dcc_product det = {v4_set(1), {0}}, spread = det;
    DCC(factor) f;
    DCC(starts)(n, slope, w, b, away, moved);
    for (ptrdiff_t s = 0; s < steps; s++) {
        const v4 *z = w->quarter + s * n;
        if (s <= before) {
            DCC(clear_first)(n, slope, away, moved);
            det.mantissa[0] = spread.mantissa[0] = 1;
            det.exponent[0] = spread.exponent[0] = 0;
            square[0] = 0;
            for (int k = 0; k < 5; k++) sums[k][0] = 0;
        }
        DCC(apply)(n, v4_set(a), w->target, away, q);
        DCC(factorise)(n, q, z, &f);
        v4 diagonal = q[0];
        DCC_UNROLL
        for (int i = 1; i < n; i++) diagonal *= q[DCC_AT(i, i)];
        VG(dcc_multiply)(&det, f.det);
        VG(dcc_multiply)(&spread, diagonal);
        square += f.square;
        smallest = v4_min(smallest, f.smallest);
        if (slope) {
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
        }
        DCC(filter)(n, slope, v4_set(b), z, w->target, away, moved);
    }
    if (slope)
        for (int k = 0; k < 5; k++) *(k < 2 ? gradient + k : outer + k - 2) = VG(dcc_sum)(sums[k]) * share;
    for (int k = 0; k < VG_LANES; k++)
        if (!(smallest[k] > 0)) return NAN;
    double log_det = VG(dcc_log)(&det) - VG(dcc_log)(&spread);
    return -0.5 * (log_det + (VG(dcc_sum)(square) - w->squares)) * share;
}

VG_NOINLINE double DCC(value)(const dcc_window *w, double a, double b) {
    return DCC(score_of)(DCC_N(w), 0, w, a, b, NULL, NULL, NULL);
}

VG_NOINLINE double DCC(score)(const dcc_window *w, double a, double b, double *gradient, double *outer, double *each) {
    return DCC(score_of)(DCC_N(w), 1, w, a, b, gradient, outer, each);
}
