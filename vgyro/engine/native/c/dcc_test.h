/* Engle & Sheppard's (2001) test of constant correlation, and the eigenvalues that it and the fit need. */

/* Eigenvalues and vectors (columns) of the symmetric matrix [n, n], which is destroyed: cyclic Jacobi rotations. */
VG_NOINLINE void VG(dcc_eigen)(int n, double *matrix, double *values, double *vectors) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) vectors[i * n + j] = i == j;
    for (int sweep = 0; sweep < 30; sweep++) {
        double off = 0;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < i; j++) off += matrix[i * n + j] * matrix[i * n + j];
        if (!(off > 1e-30)) break;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                double between = matrix[p * n + q];
                if (between == 0) continue;
                double theta = (matrix[q * n + q] - matrix[p * n + p]) / (2 * between);
                double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
                double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < n; k++) {
                    double x = matrix[k * n + p], y = matrix[k * n + q];
                    matrix[k * n + p] = c * x - s * y;
                    matrix[k * n + q] = s * x + c * y;
                }
                for (int k = 0; k < n; k++) {
                    double x = matrix[p * n + k], y = matrix[q * n + k];
                    matrix[p * n + k] = c * x - s * y;
                    matrix[q * n + k] = s * x + c * y;
                    x = vectors[k * n + p], y = vectors[k * n + q];
                    vectors[k * n + p] = c * x - s * y;
                    vectors[k * n + q] = s * x + c * y;
                }
            }
    }
    for (int i = 0; i < n; i++) values[i] = matrix[i * n + i];
}

/* Smallest eigenvalue of S; root [n, n] = S^-½, symmetric. */
VG_INLINE double VG(dcc_whitener)(const dcc_window *w, double *root) {
    const int n = w->n;
    double matrix[DCC_MAX * DCC_MAX], vectors[DCC_MAX * DCC_MAX], values[DCC_MAX], smallest = INFINITY;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) matrix[i * n + j] = w->target[DCC_AT(i, j)];
    VG(dcc_eigen)(n, matrix, values, vectors);
    for (int k = 0; k < n; k++)
        if (!(values[k] >= smallest) && !isnan(smallest)) smallest = values[k];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            root[i * n + j] = 0;
            for (int k = 0; k < n; k++) root[i * n + j] += vectors[i * n + k] * vectors[j * n + k] / sqrt(values[k]);
        }
    return smallest;
}

/* Products above the diagonal of the whitened sample, zeros up to a multiple of four. */
VG_INLINE void VG(dcc_pairs)(int n, const double *root, const double *z, double *pairs) {
    double white[DCC_MAX] = {0};
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) white[i] += root[j * n + i] * z[j];
    for (int i = 1; i < n; i++)
        for (int j = 0; j < i; j++) *pairs++ = white[i] * white[j];
}

/* Solve matrix [n, n] x = right, positive definite; both are overwritten, right by x, the diagonal by the pivots. */
VG_INLINE void VG(dcc_solve)(ptrdiff_t n, double *matrix, double *right) {
    for (ptrdiff_t j = 0; j < n; j++)
        for (ptrdiff_t i = j + 1; i < n; i++) {
            double factor = matrix[i * n + j] / matrix[j * n + j];
            for (ptrdiff_t k = j; k < n; k++) matrix[i * n + k] -= factor * matrix[j * n + k];
            right[i] -= factor * right[j];
        }
    for (ptrdiff_t j = n - 1; j >= 0; j--) {
        for (ptrdiff_t k = j + 1; k < n; k++) right[j] -= matrix[j * n + k] * right[k];
        right[j] /= matrix[j * n + j];
    }
}

/* The statistic: the pairs, stacked, on a constant and `lags` lags of their own; δ'X'Xδ / σ̂² = δ'X'y / σ̂².
   NaN where the samples are too few, a regressor depends on the others, or nothing is left over. ring holds the pairs of the last lags + 1 samples, sums their products. */
VG_NOINLINE double VG(dcc_statistic)(const dcc_memory *m, const double *root, const dcc_rules *rules) {
    const dcc_window *w = &m->window;
    const int lags = rules->lags, n = w->n, pairs = n * (n - 1) / 2, chunks = (pairs + 3) / 4, size = lags + 1;
    if (w->samples < lags + 3) return NAN;
    const double count = (double)(w->samples - lags) * pairs;
    v4 *total = m->sums, *product = m->sums + size;
    memset(m->ring, 0, sizeof(v4) * (size_t)size * (size_t)chunks);
    memset(m->sums, 0, sizeof(v4) * (size_t)size * (size_t)(size + 1));
    for (ptrdiff_t t = 0; t < w->samples; t++) {
        VG(dcc_pairs)(n, root, w->z + t * n, (double *)(m->ring + t % size * chunks));
        if (t < lags) continue;
        for (int i = 0; i <= lags; i++) {
            const v4 *x = m->ring + (t - i) % size * chunks;
            for (int c = 0; c < chunks; c++) total[i] += x[c];
            for (int j = 0; j <= i; j++) {
                const v4 *y = m->ring + (t - j) % size * chunks;
                for (int c = 0; c < chunks; c++) product[i * size + j] += x[c] * y[c];
            }
        }
    }
    /* total[i] and product[i][j] are of lags i and j; lag 0 is the response. */
    double *matrix = m->moments, *delta = matrix + size * size, *right = delta + size;
    for (int i = 0; i < size; i++) {
        delta[i] = right[i] = VG(dcc_sum)(i ? product[i * size] : total[0]);
        matrix[i * size] = matrix[i] = i ? VG(dcc_sum)(total[i]) : count;
        for (int j = 1; j <= i; j++) matrix[i * size + j] = matrix[j * size + i] = VG(dcc_sum)(product[i * size + j]);
    }
    VG(dcc_solve)(size, matrix, delta);
    double explained = 0;
    for (int i = 0; i < size; i++) {
        const double whole = i ? VG(dcc_sum)(product[i * size + i]) : count;
        if (!(matrix[i * size + i] > rules->pivot_min * whole)) return NAN;
        explained += delta[i] * right[i];
    }
    const double all = VG(dcc_sum)(product[0]), rest = all - explained;
    return rest > rules->pivot_min * all ? explained / (rest / count) : NAN;
}
