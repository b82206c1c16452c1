/* The kernels of DCC, compiled for each instruction set (each_isa.h), and the likelihood for n = 6 and for any n. */

#define VG_NOINLINE static __attribute__((noinline))

VG_INLINE double VG(dcc_sum)(v4 x) { return ((x[0] + x[1]) + x[2]) + x[3]; }

VG_INLINE void VG(dcc_multiply)(dcc_product *product, v4 x) {
    typedef uint64_t u4 __attribute__((vector_size(32)));
    u4 bits = (u4)(product->mantissa * x);
    product->exponent += (m4)(bits >> 52) - 1023;
    product->mantissa = (v4)((bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL);
}

/* Sum of the logarithms of the lanes. */
VG_INLINE double VG(dcc_log)(const dcc_product *product) {
    double sum = 0;
    for (int k = 0; k < VG_LANES; k++)
        sum += log(product->mantissa[k]) + (double)product->exponent[k] * 0x1.62e42fefa39efp-1;
    return sum;
}

VG_INLINE dcc_likelihood VG(dcc_open)(void) {
    dcc_product one = {v4_set(1), {0}};
    return (dcc_likelihood){one, one, v4_set(0), v4_set(1)};
}

/* Forget what the first lane has seen. */
VG_INLINE void VG(dcc_forget)(dcc_likelihood *l) {
    l->det.mantissa[0] = l->spread.mantissa[0] = 1;
    l->det.exponent[0] = l->spread.exponent[0] = 0;
    l->square[0] = 0;
}

/* L_c / T, NaN where some Q_t was not positive definite. */
VG_INLINE double VG(dcc_close)(const dcc_likelihood *l, const dcc_window *w) {
    for (int k = 0; k < VG_LANES; k++)
        if (!(l->smallest[k] > 0)) return NAN;
    double log_det = VG(dcc_log)(&l->det) - VG(dcc_log)(&l->spread);
    return -0.5 * (log_det + (VG(dcc_sum)(l->square) - w->squares)) / (double)w->samples;
}

#define DCC(name) VG(dcc6_##name)
#define DCC_DIM 6
#define DCC_N(window) 6
#define DCC_UNROLL _Pragma("GCC unroll 36")
#include "dcc_step.h"
#include "dcc_score.h"
#include "dcc_adjoint.h"
#include "dcc_slope.h"
#undef DCC
#undef DCC_DIM
#undef DCC_N
#undef DCC_UNROLL

#define DCC(name) VG(dccn_##name)
#define DCC_DIM DCC_MAX
#define DCC_N(window) (window)->n
#define DCC_UNROLL
#include "dcc_step.h"
#include "dcc_score.h"
#include "dcc_adjoint.h"
#include "dcc_slope.h"
#undef DCC
#undef DCC_DIM
#undef DCC_N
#undef DCC_UNROLL

VG_INLINE void VG(dcc_values)(const dcc_window *w, const double *a, double b, double *value) {
    (w->n == 6 ? VG(dcc6_values) : VG(dccn_values))(w, a, b, value);
}

VG_INLINE double VG(dcc_score)(const dcc_window *w, double a, double b, double *gradient, double *outer, double *each) {
    return (w->n == 6 ? VG(dcc6_score) : VG(dccn_score))(w, a, b, gradient, outer, each);
}

VG_INLINE void VG(dcc_adjoint)(const dcc_memory *m, v4 a, v4 b, const double *beta, v4 *slope, v4 *cross) {
    (m->window.n == 6 ? VG(dcc6_adjoint) : VG(dccn_adjoint))(m, a, b, beta, slope, cross);
}

VG_INLINE void VG(dcc_slopes)(const dcc_window *w, const double *inverse, const double *b, double *rise,
                              double *square) {
    (w->n == 6 ? VG(dcc6_slopes) : VG(dccn_slopes))(w, inverse, b, rise, square);
}

#include "dcc_margins.h"
#include "dcc_test.h"
#include "dcc_search.h"
#include "dcc_errors.h"
