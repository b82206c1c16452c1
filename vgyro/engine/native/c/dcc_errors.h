/* Standard errors of (a, b): from the inverse Hessian, and two-step robust ones (Engle & Sheppard 2001). The stacked
   scores of the margins' φ and of ψ = (a, b) give A⁻¹BA⁻ᵀ/T, with A block triangular; its ψ block is that of the scores
   s_ψ - A21 A11⁻¹ s_φ with bread A22 = ∂²L_c/∂ψ². A22 and A21 = ∂²L_c/∂ψ∂φ' are central differences of exact
   gradients. S is held fixed. */

/* Where (a, b) moves for the differences. */
VG_INLINE double VG(dcc_small_step)(double a, double b) {
    return fmin(1e-5, 0.25 * fmin(fmin(a, b), 0.5 * (1 - a - b)));
}

VG_INLINE double VG(dcc_positive_root)(double x) { return x > 0 ? sqrt(x) : NAN; }

/* Derivative of lanes (a + s, a - s, b + s, b - s) in ψ_k. */
VG_INLINE double VG(dcc_difference)(v4 x, int k, double step) { return (x[2 * k] - x[2 * k + 1]) / (2 * step); }

/* A11⁻¹A21' of a group of series: weight [2, 3]. */
VG_INLINE void VG(dcc_margin_weight)(const VG(dcc_group) *g, const v4 *hessian, const v4 *cross, double step,
                                     v4 *weight) {
    for (int i = 0; i < 6; i++) weight[i] = v4_set(0);
    for (int lane = 0; lane < g->count; lane++)
        for (int k = 0; k < 2; k++) {
            double matrix[9], right[3];
            for (int i = 0; i < 3; i++) {
                right[i] = VG(dcc_difference)(cross[3 * g->place[lane] + i], k, step);
                for (int j = 0; j < 3; j++) matrix[3 * i + j] = hessian[DCC_AT(i, j)][lane];
            }
            VG(dcc_solve)(3, matrix, right);
            for (int i = 0; i < 3; i++) weight[3 * k + i][lane] = right[i];
        }
}

VG_NOINLINE void VG(dcc_errors)(const dcc_windows *all, ptrdiff_t k, dcc_memory *m, const double *optimum, int two_step,
                                double *hessian_error, double *robust_error) {
    const dcc_window *w = &m->window;
    const int n = w->n;
    const double a = optimum[0], b = optimum[1], step = VG(dcc_small_step)(a, b);
    v4 slope[2], cross[3 * DCC_MAX];
    if (VG(dcc_prepare)(all, k, m) == DCC_NOT_FINITE) return;
    VG(dcc_adjoint)(m, (v4){a + step, a - step, a, a}, (v4){b, b, b + step, b - step},
                    two_step ? all->beta + k * n : NULL, slope, cross);
    double aa = VG(dcc_difference)(slope[0], 0, step), bb = VG(dcc_difference)(slope[1], 1, step);
    double ab = 0.5 * (VG(dcc_difference)(slope[0], 1, step) + VG(dcc_difference)(slope[1], 0, step));
    double det = aa * bb - ab * ab, inverse[3] = {bb / det, -ab / det, aa / det};
    hessian_error[0] = VG(dcc_positive_root)(-inverse[0]);
    hessian_error[1] = VG(dcc_positive_root)(-inverse[2]);
    if (!two_step) return;
    double gradient[2], outer[3], meat[3] = {0, 0, 0};
    VG(dcc_score)(w, a, b, gradient, outer, m->each);
    for (int first = 0; first < n; first += VG_LANES) {
        const VG(dcc_group) g = VG(dcc_group_of)(all, k, first);
        v4 hessian[6] = {v4_set(0), v4_set(0), v4_set(0), v4_set(0), v4_set(0), v4_set(0)}, weight[6];
        VG(dcc_margin_pass)(m, &g, hessian, NULL);
        VG(dcc_margin_weight)(&g, hessian, cross, step, weight);
        VG(dcc_margin_pass)(m, &g, NULL, weight);
    }
    for (ptrdiff_t t = 0; t < w->samples; t++) {
        const double *s = m->each + 2 * t;
        meat[0] += s[0] * s[0];
        meat[1] += s[0] * s[1];
        meat[2] += s[1] * s[1];
    }
    /* Diagonal of A22⁻¹ B A22⁻¹. */
    for (int i = 0; i < 2; i++) {
        const double *row = inverse + i;
        robust_error[i] = VG(dcc_positive_root)(row[0] * row[0] * meat[0] + 2 * row[0] * row[1] * meat[1] +
                                                row[1] * row[1] * meat[2]);
    }
}
