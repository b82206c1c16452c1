/* One sample of the correlation likelihood, in four lanes: l = -½(log|Q| - Σ log q_i + v'Q⁻¹v - z'z), v = √q z.
   Compiled for n = DCC_DIM with every loop unrolled, and once for any n up to it. */

/* Q = LDL' (the unit diagonal of L is not kept), inverse = 1/d, det = Π d; root = √q; Ly = v, square = v'Q⁻¹v. */
typedef struct {
    v4 l[DCC_TRI(DCC_DIM)], inverse[DCC_DIM], root[DCC_DIM], y[DCC_DIM];
    v4 det, smallest, square;
} DCC(factor);

VG_INLINE void DCC(factorise)(const int n, const v4 *q, const v4 *z, DCC(factor) *f) {
    v4 left[DCC_TRI(DCC_DIM)];
    f->det = f->smallest = q[0];
    f->square = v4_set(0);
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        v4 d = q[DCC_AT(i, i)];
        f->root[i] = (v4){sqrt(d[0]), sqrt(d[1]), sqrt(d[2]), sqrt(d[3])};
        f->y[i] = f->root[i] * z[i];
        DCC_UNROLL
        for (int j = 0; j <= i; j++) left[DCC_AT(i, j)] = q[DCC_AT(i, j)];
    }
    DCC_UNROLL
    for (int j = 0; j < n; j++) {
        v4 d = left[DCC_AT(j, j)];
        if (j > 0) {
            f->det *= d;
            f->smallest = v4_min(f->smallest, d);
        }
        f->inverse[j] = 1.0 / d;
        DCC_UNROLL
        for (int i = j + 1; i < n; i++) f->l[DCC_AT(i, j)] = left[DCC_AT(i, j)] * f->inverse[j];
        DCC_UNROLL
        for (int i = j + 1; i < n; i++) {
            DCC_UNROLL
            for (int k = j + 1; k <= i; k++) left[DCC_AT(i, k)] -= f->l[DCC_AT(i, j)] * left[DCC_AT(k, j)];
            f->y[i] -= f->l[DCC_AT(i, j)] * f->y[j];
        }
        f->square += f->y[j] * f->y[j] * f->inverse[j];
    }
}

/* ∂l/∂Q = -½(Q⁻¹ - uu' + diag((u z/√q) - 1/q)), u = Q⁻¹v; places off the diagonal are doubled, so that
   dl = Σ w dQ over the triangle. Q⁻¹ column by column from the last, since Q⁻¹L is upper triangular. */
VG_INLINE void DCC(weigh)(const int n, const v4 *z, const DCC(factor) *f, v4 *w, v4 *u) {
    DCC_UNROLL
    for (int j = n - 1; j >= 0; j--) {
        v4 diagonal = f->inverse[j];
        u[j] = f->y[j] * f->inverse[j];
        DCC_UNROLL
        for (int i = n - 1; i > j; i--) {
            v4 sum = f->l[DCC_AT(j + 1, j)] * w[DCC_AT(i, j + 1)];
            DCC_UNROLL
            for (int k = j + 2; k < n; k++) sum += f->l[DCC_AT(k, j)] * w[DCC_AT(i, k)];
            w[DCC_AT(i, j)] = -sum;
            diagonal += f->l[DCC_AT(i, j)] * sum;
            u[j] -= f->l[DCC_AT(i, j)] * u[i];
        }
        w[DCC_AT(j, j)] = diagonal;
    }
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        v4 shrink = 1.0 / f->root[i];
        DCC_UNROLL
        for (int j = 0; j < i; j++) w[DCC_AT(i, j)] = u[i] * u[j] - w[DCC_AT(i, j)];
        w[DCC_AT(i, i)] = 0.5 * (u[i] * u[i] - w[DCC_AT(i, i)] - shrink * (u[i] * z[i] - shrink));
    }
}

/* Q = S + aA, with A the filtered zz' - S: here A of the next sample, and its derivative in b. */
VG_INLINE void DCC(filter)(const int n, const int slope, v4 b, const v4 *z, const double *target, v4 *away, v4 *moved) {
    DCC_UNROLL
    for (int i = 0; i < n; i++) {
        DCC_UNROLL
        for (int j = 0; j <= i; j++) {
            const int at = DCC_AT(i, j);
            if (slope) moved[at] = away[at] + b * moved[at];
            away[at] = (z[i] * z[j] - target[at]) + b * away[at];
        }
    }
}

VG_INLINE void DCC(apply)(const int n, v4 a, const double *target, const v4 *away, v4 *q) {
    DCC_UNROLL
    for (int at = 0; at < DCC_TRI(n); at++) q[at] = target[at] + a * away[at];
}
