/* How steeply L_c rises from a = 0 at DCC_SLOPES places b: there every Q_t is S, so that the weights of all b are the
   same, and the lanes are places. ∂L_c/∂a = Σ ⟨w_t, A_t⟩, w_t = ∂l_t/∂Q at S, A_{t+1} = z_t z_t' - S + bA_t. */

/* inverse: S⁻¹, its triangle. w and x: of one sample, w_t and z_t z_t' - S; places off the diagonal of w are doubled. */
VG_INLINE void DCC(at_target)(const int n, const double *target, const double *inverse, const double *z, double *w,
                              double *x) {
    double u[DCC_DIM];
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        u[i] = 0;
        DCC_UNROLL
        for (int j = 0; j < n; j++) u[i] += inverse[DCC_AT(i, j)] * z[j];
    }
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        DCC_UNROLL
        for (int j = 0; j <= i; j++) {
            const int at = DCC_AT(i, j);
            w[at] = u[i] * u[j] - inverse[at];
            x[at] = z[i] * z[j] - target[at];
        }
        w[DCC_AT(i, i)] = 0.5 * (w[DCC_AT(i, i)] - (u[i] * z[i] - 1));
    }
}

/* rise [DCC_SLOPES] = (∂L_c/∂a) / T at a = 0, and square = Σ (∂l_t/∂a)² / T. */
VG_INLINE void DCC(slopes_of)(const int n, const dcc_window *w, const double *inverse, const double *b, double *rise,
                              double *square) {
    enum { GROUPS = DCC_SLOPES / VG_LANES };
    v4 away[GROUPS][DCC_TRI(DCC_DIM)], keep[GROUPS], sum[GROUPS], squares[GROUPS];
    double weight[DCC_TRI(DCC_DIM)], x[DCC_TRI(DCC_DIM)];
    for (int g = 0; g < GROUPS; g++) {
        keep[g] = (v4){b[4 * g], b[4 * g + 1], b[4 * g + 2], b[4 * g + 3]};
        sum[g] = squares[g] = v4_set(0);
        for (int at = 0; at < DCC_TRI(n); at++) away[g][at] = v4_set(0);
    }
    for (ptrdiff_t t = 0; t < w->samples; t++) {
        DCC(at_target)(n, w->target, inverse, w->z + t * n, weight, x);
        for (int g = 0; g < GROUPS; g++) {
            v4 slope = weight[0] * away[g][0];
            DCC_UNROLL
            for (int at = 1; at < DCC_TRI(n); at++) slope += weight[at] * away[g][at];
            DCC_UNROLL
            for (int at = 0; at < DCC_TRI(n); at++) away[g][at] = x[at] + keep[g] * away[g][at];
            sum[g] += slope;
            squares[g] += slope * slope;
        }
    }
    for (int k = 0; k < DCC_SLOPES; k++) {
        rise[k] = sum[k / VG_LANES][k % VG_LANES] / (double)w->samples;
        square[k] = squares[k / VG_LANES][k % VG_LANES] / (double)w->samples;
    }
}

VG_NOINLINE void DCC(slopes)(const dcc_window *w, const double *inverse, const double *b, double *rise,
                             double *square) {
    DCC(slopes_of)(DCC_N(w), w, inverse, b, rise, square);
}
