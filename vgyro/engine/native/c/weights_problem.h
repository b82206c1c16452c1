/* The quadratic problem, four in lockstep. Matrices are [n, n] of vectors, vectors [n]; n is a constant where speed
   matters. */

#define SINGULAR 1e-12 /* these two as in vgyro.engine.covariance */
#define ASYMMETRY 1e-9

/* Refinement. With pivots at least this large one step with plain residuals leaves no more than rounding; else more
   precise residuals until a step is this share of the largest x, so that the next would be below rounding. */
#define WELL_CONDITIONED 0x1p-6
#define LAST_STEP 0x1p-27
#define REFINEMENTS 20
/* Signs of what is below this share of the largest x are taken from precise residuals, and then from what is above
   the rounding of x, as a share of Σ|Ax|. */
#define NEAR 0x1p-18
#define NOISE (8 * 0x1p-53)

/* Exchanges of all gyros at once, then one by one, up to so many for each; and from a guess before starting over. */
#define BLOCK_EXCHANGES 16
#define EXCHANGES_EACH 64
#define GUESS_EXCHANGES 4

typedef double VG(unaligned) __attribute__((vector_size(32), aligned(8), may_alias));
typedef uint64_t VG(bits) __attribute__((vector_size(32)));

VG_INLINE v4 VG(absolute)(v4 x) { return (v4)((m4)x & INT64_MAX); }

/* The same place of four arrays. */
VG_INLINE v4 VG(gather)(const double *const *from, size_t place) {
    return (v4){from[0][place], from[1][place], from[2][place], from[3][place]};
}

/* Four places from `place` on of four arrays. */
VG_INLINE void VG(gather_four)(const double *const *from, size_t place, v4 *to) {
    const v4 rows[VG_LANES] = {
        *(const VG(unaligned) *)(from[0] + place), *(const VG(unaligned) *)(from[1] + place),
        *(const VG(unaligned) *)(from[2] + place), *(const VG(unaligned) *)(from[3] + place)
    };
    const v4 even = __builtin_shufflevector(rows[0], rows[1], 0, 4, 2, 6);
    const v4 odd = __builtin_shufflevector(rows[0], rows[1], 1, 5, 3, 7);
    const v4 even_after = __builtin_shufflevector(rows[2], rows[3], 0, 4, 2, 6);
    const v4 odd_after = __builtin_shufflevector(rows[2], rows[3], 1, 5, 3, 7);
    to[0] = __builtin_shufflevector(even, even_after, 0, 1, 4, 5);
    to[1] = __builtin_shufflevector(odd, odd_after, 0, 1, 4, 5);
    to[2] = __builtin_shufflevector(even, even_after, 2, 3, 6, 7);
    to[3] = __builtin_shufflevector(odd, odd_after, 2, 3, 6, 7);
}

/* LDL' of A on the support; off it the matrix reads as the identity. Returns the smallest pivot, NaN or
   not positive in the lanes that have no such factors.  shift : factor of the diagonal. */
VG_INLINE v4 VG(factorise)(size_t n, const v4 *A, v4 shift, const m4 *support, v4 *L, v4 *inverse) {
    const v4 one = v4_set(1.0);
    v4 pivots[WEIGHTS_MAX], scaled[WEIGHTS_MAX];
    v4 smallest = v4_set(INFINITY);
#pragma GCC unroll 8
    for (size_t j = 0; j < n; j++) {
        v4 pivot = v4_select(support[j], A[j * n + j] * shift, one);
#pragma GCC unroll 8
        for (size_t k = 0; k < j; k++) {
            scaled[k] = L[j * n + k] * pivots[k];
            pivot -= L[j * n + k] * scaled[k];
        }
        smallest = v4_select(pivot >= smallest, smallest, pivot); /* NaN stays: later pivots are NaN, too */
        pivots[j] = pivot;
        inverse[j] = one / pivot;
#pragma GCC unroll 8
        for (size_t i = j + 1; i < n; i++) {
            v4 sum = (v4)((m4)A[i * n + j] & support[i] & support[j]);
#pragma GCC unroll 8
            for (size_t k = 0; k < j; k++) sum -= L[i * n + k] * scaled[k];
            L[i * n + j] = sum * inverse[j];
        }
    }
    return smallest;
}

/* x of LDL'x = b. */
VG_INLINE void VG(substitute)(size_t n, const v4 *L, const v4 *inverse, const v4 *b, v4 *x) {
#pragma GCC unroll 8
    for (size_t i = 0; i < n; i++) {
        v4 sum = b[i];
#pragma GCC unroll 8
        for (size_t k = 0; k < i; k++) sum -= L[i * n + k] * x[k];
        x[i] = sum;
    }
#pragma GCC unroll 8
    for (size_t i = n; i-- > 0;) {
        v4 sum = x[i] * inverse[i];
#pragma GCC unroll 8
        for (size_t k = n; k-- > i + 1;) sum -= L[k * n + i] * x[k];
        x[i] = sum;
    }
}

/* residual = b - Ax, summed in twice the working precision; size = Σ|a x| of each row.
   Products by Dekker (1971), sums by Knuth: Ogita, Rump & Oishi (2005), algorithm 5.3 (Dot2).
   Not inlined: rarely called, and compilers would move half of it to where it is not needed. */
static __attribute__((noinline)) void VG(residual)(
    size_t n, const v4 *A, const v4 *b, const v4 *x, v4 *residual, v4 *size
) {
    const v4 splitter = v4_set(0x1p27 + 1);
    v4 high_x[WEIGHTS_MAX], low_x[WEIGHTS_MAX];
#pragma GCC unroll 8
    for (size_t j = 0; j < n; j++) {
        v4 t = splitter * x[j];
        high_x[j] = t - (t - x[j]);
        low_x[j] = x[j] - high_x[j];
    }
#pragma GCC unroll 8
    for (size_t i = 0; i < n; i++) {
        v4 sum = b[i], rest = v4_set(0.0), absolute = v4_set(0.0);
#pragma GCC unroll 8
        for (size_t j = 0; j < n; j++) {
            v4 t = splitter * A[i * n + j];
            v4 high = t - (t - A[i * n + j]), low = A[i * n + j] - high;
            v4 product = A[i * n + j] * x[j];
            v4 error = low * low_x[j] - (((product - high * high_x[j]) - low * high_x[j]) - high * low_x[j]);
            v4 next = sum - product, back = next - sum;
            rest += ((sum - (next - back)) - (product + back)) - error;
            sum = next;
            absolute += VG(absolute)(product);
        }
        residual[i] = sum + rest;
        size[i] = absolute;
    }
}

/* b - Ax. */
VG_INLINE void VG(plain_residual)(size_t n, const v4 *A, const v4 *b, const v4 *x, v4 *residual) {
#pragma GCC unroll 8
    for (size_t i = 0; i < n; i++) {
        residual[i] = b[i];
#pragma GCC unroll 8
        for (size_t j = 0; j < n; j++) residual[i] -= A[i * n + j] * x[j];
    }
}

/* One step of iterative refinement of x on the support, in the lanes `rough`. Returns max|step|/max|x|; *largest max|x| */
VG_INLINE v4 VG(refine)(
    size_t n, const v4 *L, const v4 *inverse, const v4 *residual, const m4 *support, m4 rough, v4 *x, v4 *largest
) {
    v4 wanted[WEIGHTS_MAX], step[WEIGHTS_MAX], largest_step = v4_set(0.0);
    for (size_t i = 0; i < n; i++) wanted[i] = (v4)((m4)residual[i] & support[i]);
    VG(substitute)(n, L, inverse, wanted, step);
    *largest = v4_set(0.0);
    for (size_t i = 0; i < n; i++) {
        x[i] += (v4)((m4)step[i] & rough);
        largest_step = v4_max(largest_step, VG(absolute)(step[i]));
        *largest = v4_max(*largest, VG(absolute)(x[i]));
    }
    return largest_step / *largest;
}

/* x of Ax = b on the support, zero off it, to the last digits; and b - Ax of the rows off it, with its size.
   near : x and residuals smaller than this may have the wrong sign. Returns the lanes that could be solved. */
VG_INLINE m4 VG(solve)(size_t n, const v4 *A, const v4 *b, const m4 *support, v4 *x, v4 *residual, v4 *size, v4 *near) {
    v4 L[WEIGHTS_MAX * WEIGHTS_MAX], inverse[WEIGHTS_MAX], wanted[WEIGHTS_MAX], largest;
    const v4 smallest = VG(factorise)(n, A, v4_set(1.0), support, L, inverse);
    const m4 solved = smallest > 0.0;
    for (size_t i = 0; i < n; i++) {
        wanted[i] = (v4)((m4)b[i] & support[i]);
        size[i] = v4_set(0.0); /* where the sign is clear without it */
    }
    VG(substitute)(n, L, inverse, wanted, x);
    VG(plain_residual)(n, A, b, x, residual);
    VG(refine)(n, L, inverse, residual, support, solved, x, &largest);
    m4 rough = solved & (smallest < WELL_CONDITIONED);
    for (int count = 0; count < REFINEMENTS && m4_any(rough); count++) {
        VG(residual)(n, A, b, x, residual, size);
        /* The next step would be smaller than this one as this one is than x. */
        rough &= VG(refine)(n, L, inverse, residual, support, rough, x, &largest) > LAST_STEP;
    }
    *near = NEAR * largest;
    m4 unclear = {0};
    for (size_t i = 0; i < n; i++) unclear |= ~support[i] & (VG(absolute)(residual[i]) <= *near);
    if (m4_any(unclear)) VG(residual)(n, A, b, x, residual, size);
    return solved & ~rough;
}

/* A = SHS with powers of two in S, so that nothing is rounded and the diagonal lies in [1, 4). H: lower triangle. */
VG_INLINE void VG(equilibrate)(size_t n, const v4 *H, v4 *A, v4 *scale) {
    for (size_t i = 0; i < n; i++) {
        VG(bits) exponent = (VG(bits))H[i * n + i] >> 52;
        scale[i] = (v4)((2046 - ((exponent + 1023) >> 1)) << 52);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) A[i * n + j] = A[j * n + i] = H[i * n + j] * scale[i] * scale[j];
}

/* The exchanges of a principal pivoting step: out with negative x, in with rows whose inequality Ax >= b fails.
   All at once at first; in the lanes `one_by_one` only the last one, which always ends (Murty 1974).
   Returns the lanes with an exchange. */
VG_INLINE m4 VG(exchange)(size_t n, m4 open, m4 one_by_one, const v4 *x, const v4 *residual, const v4 *size, m4 *support) {
    m4 any = {0};
    for (size_t i = n; i-- > 0;) {
        m4 wrong = (support[i] & (x[i] < 0.0)) | (~support[i] & (residual[i] > NOISE * size[i]));
        wrong &= open & ~(any & one_by_one);
        support[i] ^= wrong;
        any |= wrong;
    }
    return any;
}

/* The lanes whose support is right beyond doubt: any way to it would have ended there. */
VG_INLINE m4 VG(certain)(size_t n, const v4 *x, const v4 *residual, v4 near, const m4 *support) {
    m4 found = ~(m4){0};
    for (size_t i = 0; i < n; i++) found &= (support[i] & (x[i] > near)) | (~support[i] & (residual[i] < -near));
    return found;
}

/* min w'Hw, Σw = 1, w >= 0: with Hx >= 1, x >= 0, x'(Hx - 1) = 0, w = x/Σx. Block principal pivoting from the full
   support (Portugal, Júdice & Vicente 1994), unless the given one proves right beyond doubt: so a matrix has the same
   weights whatever was before it.
   H : lower triangle;  support : a guess, then that of the weights
   Returns the lanes where H is finite and positive definite; the others have equal weights. */
VG_INLINE m4 VG(weigh)(size_t n, const v4 *H, m4 *support, v4 *w) {
    v4 A[WEIGHTS_MAX * WEIGHTS_MAX], L[WEIGHTS_MAX * WEIGHTS_MAX], near;
    v4 scale[WEIGHTS_MAX], x[WEIGHTS_MAX], residual[WEIGHTS_MAX], size[WEIGHTS_MAX];
    m4 full[WEIGHTS_MAX], good = ~(m4){0}, guess = {0}, exchanges = {0};
    for (size_t i = 0; i < n; i++) {
        full[i] = ~(m4){0};
        guess |= ~support[i];
        good &= (H[i * n + i] > 0.0) & (H[i * n + i] < INFINITY);
    }
    VG(equilibrate)(n, H, A, scale);
    good &= VG(factorise)(n, A, v4_set(1.0 - SINGULAR), full, L, x) > 0.0;
    m4 open = good;
    while (m4_any(open)) {
        const m4 solved = VG(solve)(n, A, scale, support, x, residual, size, &near);
        const m4 changed = VG(exchange)(n, open & solved, exchanges >= BLOCK_EXCHANGES, x, residual, size, support);
        m4 again = open & guess & ~changed;
        if (m4_any(again)) again &= ~(solved & VG(certain)(n, x, residual, near, support));
        again |= changed & guess & (exchanges >= GUESS_EXCHANGES);
        good &= guess | ~open | (solved & (exchanges < EXCHANGES_EACH * (int64_t)n));
        for (size_t i = 0; i < n; i++) support[i] |= again;
        exchanges = (exchanges - changed) & ~again;
        guess &= ~again;
        open = (changed | again) & good;
    }
    v4 total = v4_set(0.0);
    for (size_t i = 0; i < n; i++) {
        w[i] = (v4)((m4)(x[i] * scale[i]) & support[i]);
        total += w[i];
    }
    for (size_t i = 0; i < n; i++) w[i] = v4_select(good, w[i] / total, v4_set(1.0 / (double)n));
    return good;
}
