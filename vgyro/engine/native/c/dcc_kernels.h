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

#define DCC(name) VG(dcc6_##name)
#define DCC_DIM 6
#define DCC_N(window) 6
#define DCC_UNROLL _Pragma("GCC unroll 36")
#include "dcc_step.h"
#include "dcc_score.h"
#include "dcc_adjoint.h"
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
#undef DCC
#undef DCC_DIM
#undef DCC_N
#undef DCC_UNROLL

VG_INLINE double VG(dcc_value)(const dcc_window *w, double a, double b) {
    return (w->n == 6 ? VG(dcc6_value) : VG(dccn_value))(w, a, b);
}

VG_INLINE double VG(dcc_score)(const dcc_window *w, double a, double b, double *gradient, double *outer, double *each) {
    return (w->n == 6 ? VG(dcc6_score) : VG(dccn_score))(w, a, b, gradient, outer, each);
}

VG_INLINE void VG(dcc_adjoint)(const dcc_memory *m, v4 a, v4 b, const double *beta, v4 *slope, v4 *cross) {
    (m->window.n == 6 ? VG(dcc6_adjoint) : VG(dccn_adjoint))(m, a, b, beta, slope, cross);
}

#include "dcc_margins.h"
#include "dcc_test.h"
#include "dcc_search.h"
#include "dcc_errors.h"
