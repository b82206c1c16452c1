/* Gradient of L_c at four points (a, b) of one window, a point a lane, going back in time: in (a, b), and in the
   parameters φ = (ω, α, β) of the margins through z = e/√h (S held fixed).

   With Λ_t = ∂L_c/∂Q_t = W_t + b Λ_{t+1}:  ∂L_c/∂z_t = z_t - √q u_t + 2a Λ_{t+1} z_t,
   ∂L_c/∂a = Σ ⟨Λ_{t+1}, z_t z_t' - S⟩,  ∂L_c/∂b = Σ ⟨Λ_{t+1}, Q_t - S⟩;  and with λ_t = ∂L_c/∂h_t + β λ_{t+1}:
   ∂L_c/∂φ = Σ λ_t (1, e²_{t-1}, h_{t-1}).
   A is kept at the start of each block of samples, from which the block is computed again on the way back. */

VG_INLINE void DCC(spread_sample)(const int n, const double *from, v4 *z) {
    for (int i = 0; i < n; i++) z[i] = v4_set(from[i]);
}

/* Samples start..stop - 1, from A of the first. */
VG_INLINE void DCC(block_forward)(const int n, const dcc_window *w, v4 a, v4 b, ptrdiff_t start, ptrdiff_t stop,
                                  v4 *away, v4 *kept) {
    v4 z[DCC_DIM], u[DCC_DIM];
    DCC(factor) f;
    for (ptrdiff_t t = start; t < stop; t++, kept += DCC_KEPT(n)) {
        v4 *q = kept + DCC_TRI(n), *direct = q + DCC_TRI(n);
        DCC(spread_sample)(n, w->z + t * n, z);
        DCC(apply)(n, a, w->target, away, q);
        DCC(factorise)(n, q, z, &f);
        DCC(weigh)(n, z, &f, kept, u);
        DCC_UNROLL
        for (int i = 0; i < n; i++) direct[i] = z[i] - f.root[i] * u[i];
        DCC(filter)(n, 0, b, z, w->target, away, NULL);
    }
}

/* One sample back. total: Λ; slope [2]; lambda [n] and cross [n, 3] of the margins, where h is not NULL. */
VG_INLINE void DCC(sample_back)(const int n, const dcc_window *w, v4 a, v4 b, const double *beta, ptrdiff_t t,
                                const v4 *kept, v4 *total, v4 *slope, v4 *lambda, v4 *cross) {
    const v4 *q = kept + DCC_TRI(n), *direct = q + DCC_TRI(n);
    const double *sample = w->z + t * n;
    v4 z[DCC_DIM], by_z[DCC_DIM], quadratic = v4_set(0), by_target = v4_set(0), by_q = v4_set(0);
    DCC(spread_sample)(n, sample, z);
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        by_z[i] = 2 * total[DCC_AT(i, i)] * z[i];
        DCC_UNROLL
        for (int j = 0; j < n; j++)
            if (j != i) by_z[i] += total[DCC_AT(i, j)] * z[j];
        quadratic += by_z[i] * z[i];
    }
    DCC_UNROLL
    for (int at = 0; at < DCC_TRI(n); at++) {
        by_target += w->target[at] * total[at];
        by_q += q[at] * total[at];
        total[at] = kept[at] + b * total[at];
    }
    slope[0] += 0.5 * quadratic - by_target;
    slope[1] += by_q - by_target;
    if (beta) {
        const double *h = w->h + t * n;
        for (int i = 0; i < n; i++) {
            v4 by_h = (direct[i] + a * by_z[i]) * (-0.5 * sample[i] / h[i]);
            double before = t > 0 ? h[i - n] : 1, square = t > 0 ? before * (sample[i - n] * sample[i - n]) : 1;
            lambda[i] = by_h + beta[i] * lambda[i];
            cross[3 * i] += lambda[i];
            cross[3 * i + 1] += lambda[i] * square;
            cross[3 * i + 2] += lambda[i] * before;
        }
    }
}

VG_INLINE void DCC(adjoint_of)(const int n, const dcc_memory *m, v4 a, v4 b, const double *beta, v4 *slope, v4 *cross) {
    const dcc_window *w = &m->window;
    const ptrdiff_t blocks = (w->samples + DCC_BLOCK - 1) / DCC_BLOCK;
    v4 away[DCC_TRI(DCC_DIM)], total[DCC_TRI(DCC_DIM)], z[DCC_DIM], lambda[DCC_DIM];
    for (int at = 0; at < DCC_TRI(n); at++) away[at] = total[at] = v4_set(0);
    for (int i = 0; i < n; i++) lambda[i] = cross[3 * i] = cross[3 * i + 1] = cross[3 * i + 2] = v4_set(0);
    slope[0] = slope[1] = v4_set(0);
    for (ptrdiff_t t = 0; t < w->samples; t++) {
        if (t % DCC_BLOCK == 0) memcpy(m->checkpoint + t / DCC_BLOCK * DCC_TRI(n), away, DCC_TRI(n) * sizeof(v4));
        DCC(spread_sample)(n, w->z + t * n, z);
        DCC(filter)(n, 0, b, z, w->target, away, NULL);
    }
    for (ptrdiff_t block = blocks - 1; block >= 0; block--) {
        ptrdiff_t start = block * DCC_BLOCK, stop = start + DCC_BLOCK < w->samples ? start + DCC_BLOCK : w->samples;
        memcpy(away, m->checkpoint + block * DCC_TRI(n), DCC_TRI(n) * sizeof(v4));
        DCC(block_forward)(n, w, a, b, start, stop, away, m->block);
        for (ptrdiff_t t = stop - 1; t >= start; t--)
            DCC(sample_back)(n, w, a, b, beta, t, m->block + (t - start) * DCC_KEPT(n), total, slope, lambda, cross);
    }
}

/* slope [2], cross [n, 3]; beta [n], or NULL for no margins. */
VG_NOINLINE void DCC(adjoint)(const dcc_memory *m, v4 a, v4 b, const double *beta, v4 *slope, v4 *cross) {
    DCC(adjoint_of)(DCC_N(&m->window), m, a, b, beta, slope, cross);
}
