#include "adaptive.h"

#include "vg.h"

typedef uint64_t u4 __attribute__((vector_size(32)));

/* Vectors that hold `count` numbers. */
VG_INLINE ptrdiff_t vectors(ptrdiff_t count) { return (count + VG_LANES - 1) / VG_LANES; }

/* Number `column` of a row, in rows of `wide` vectors. */
#define VG_AT(rows, wide, row, column) ((rows)[(row) * (wide) + (column) / VG_LANES][(column) % VG_LANES])

#define VG_KERNELS "adaptive_kernels.h"
#include "each_isa.h"

int vg_adaptive_scale_bias(const vg_adaptive_array *array, const double *rate, ptrdiff_t samples, double *state,
                           double *covariance, double *estimate) {
    const ptrdiff_t n = array->gyros, states = 2 * n, wide = vectors(states);
    const size_t size = (size_t)(wide * (states + 3 * n + 4) + vectors(2 * n)) * sizeof(v4);
    v4 *scratch = aligned_alloc(sizeof(v4), size);
    if (scratch == NULL) return -2;
    memset(scratch, 0, size);
    VG_CHOOSE(adaptive_scale_bias)(array, rate, samples, scratch, state, covariance, estimate);
    free(scratch);
    return 0;
}

int vg_adaptive_mix(const vg_adaptive_bank *bank, const double *rate, ptrdiff_t samples, double *mean, double *variance,
                    double *probability, double *total, double *estimate) {
    const ptrdiff_t groups = bank->noises * vectors(bank->walks);
    const size_t size = (size_t)(7 * groups + vectors(bank->gyros)) * sizeof(v4);
    v4 *scratch = aligned_alloc(sizeof(v4), size);
    if (scratch == NULL) return -2;
    memset(scratch, 0, size);
    VG_CHOOSE(adaptive_mix)(bank, rate, samples, scratch, mean, variance, probability, total, estimate);
    free(scratch);
    return 0;
}
