/* Information of N gyros, four samples in lockstep. */

VG_INLINE v4 VG(kalman_gather)(const double *const *from, ptrdiff_t index) {
    return (v4){from[0][index], from[1][index], from[2][index], from[3][index]};
}

/* Four samples at z[lane] [n] and R[lane] [n, n]: R = L·diag(d)·L', row by row, with y = L⁻¹1 and x = L⁻¹(z - z_0).
   D = 1'R⁻¹1 = Σ y²/d, mean = z_0 + Σ xy/d / D: a rate common to all gyros does not cancel. Lanes that fail get NaN.
   lower: n·n, column: 4·n vectors of scratch. */
VG_INLINE void VG(kalman_four)(const double *const *z, const double *const *R, ptrdiff_t n, v4 *lower, v4 *column,
                               v4 *mean, v4 *variance) {
    v4 *inverse = column, *y = column + n, *x = column + 2 * n, *row = column + 3 * n;
    const v4 one = v4_set(1.0), least = v4_set(VG_KALMAN_SINGULAR * (double)n);
    const v4 first = VG(kalman_gather)(z, 0);
    v4 D = v4_set(0.0), sum = v4_set(0.0);
    m4 good = (m4)(D == D);
    for (ptrdiff_t i = 0; i < n; i++) {
        v4 yi = one, xi = VG(kalman_gather)(z, i) - first;
        v4 diagonal = VG(kalman_gather)(R, i * n + i), pivot = diagonal;
        for (ptrdiff_t j = 0; j < i; j++) {
            v4 u = VG(kalman_gather)(R, i * n + j);
            for (ptrdiff_t k = 0; k < j; k++) u -= row[k] * lower[j * n + k];
            v4 l = u * inverse[j];
            row[j] = u;
            lower[i * n + j] = l;
            pivot -= u * l;
            yi -= l * y[j];
            xi -= l * x[j];
        }
        good &= (m4)(pivot > least * diagonal) & (m4)(diagonal > v4_set(0.0));
        inverse[i] = one / pivot;
        y[i] = yi;
        x[i] = xi;
        D += yi * yi * inverse[i];
        sum += xi * yi * inverse[i];
    }
    v4 spread = one / D;
    *mean = v4_select(good, first + sum * spread, v4_set(NAN));
    *variance = v4_select(good, spread, v4_set(NAN));
}

static ptrdiff_t VG(kalman_mean)(const double *rate, const double *noise, ptrdiff_t noise_step, ptrdiff_t samples,
                                 ptrdiff_t n, v4 *scratch, double *mean, double *variance) {
    for (ptrdiff_t t = 0; t < samples; t += VG_LANES) {
        const double *z[VG_LANES], *R[VG_LANES];
        for (ptrdiff_t lane = 0; lane < VG_LANES; lane++) {
            ptrdiff_t place = t + lane < samples ? t + lane : samples - 1;
            z[lane] = rate + place * n;
            R[lane] = noise + place * noise_step;
        }
        v4 m, v;
        /* Constant sizes let the compiler unroll. */
        switch (n) {
        case 2: VG(kalman_four)(z, R, 2, scratch, scratch + 4, &m, &v); break;
        case 3: VG(kalman_four)(z, R, 3, scratch, scratch + 9, &m, &v); break;
        case 4: VG(kalman_four)(z, R, 4, scratch, scratch + 16, &m, &v); break;
        case 6: VG(kalman_four)(z, R, 6, scratch, scratch + 36, &m, &v); break;
        default: VG(kalman_four)(z, R, n, scratch, scratch + n * n, &m, &v);
        }
        for (ptrdiff_t lane = 0; lane < VG_LANES && t + lane < samples; lane++) {
            mean[t + lane] = m[lane];
            variance[t + lane] = v[lane];
            if (!isfinite(m[lane]) || !isfinite(v[lane])) return t + lane;
        }
    }
    return -1;
}
