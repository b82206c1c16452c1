/* DCC(1,1): Q_t = (1-a-b)S + a z_{t-1}z'_{t-1} + b Q_{t-1}, Q_1 = S (Engle 2002), in windows of n series.
   Symmetric matrices are kept as their lower triangle, row by row. */
#ifndef VG_DCC_H
#define VG_DCC_H

#include "vg.h"

#define DCC_MAX 32
#define DCC_TRI(n) ((n) * ((n) + 1) / 2)
#define DCC_AT(i, j) ((i) >= (j) ? DCC_TRI(i) + (j) : DCC_TRI(j) + (i))
/* The way back in time goes by blocks of samples; of each sample W, Q and z - √q u are kept (dcc_adjoint.h). */
#define DCC_BLOCK 64
#define DCC_KEPT(n) (2 * DCC_TRI(n) + (n))
/* Places b at which the slope at a = 0 is known (dcc_slope.h); a multiple of VG_LANES. */
#define DCC_SLOPES 20

enum { DCC_FITTED = 0, DCC_NOT_FINITE = 1, DCC_SINGULAR = 2, DCC_CONSTANT = 3 };
enum { DCC_A = 0, DCC_B, DCC_LIKELIHOOD, DCC_LIKELIHOOD_CCC, DCC_STATISTIC, DCC_VALUES };

/* Windows of one shape: series [K, samples, n], and omega, alpha, beta [K, n] of their margins.
   omega NULL: the series are the standardised residuals z, else r. */
typedef struct {
    const double *series, *omega, *alpha, *beta;
    ptrdiff_t samples;
    int n;
} dcc_windows;

typedef struct {
    double persistence_max, eigenvalue_min, gain, flat, pivot_min;
    int lags;
} dcc_rules;

/* What a window is fitted from: z [samples, n]; h [samples, n] where there are margins, in units of the mean square of
   each series; quarter [ceil(samples/4), n]: each lane is a quarter of z in time; S; Σz'z. */
typedef struct {
    ptrdiff_t samples;
    int n;
    const double *z;
    double *h;
    v4 *quarter;
    double target[DCC_TRI(DCC_MAX)], squares;
} dcc_window;

/* A product of positive numbers: mantissa · 2^exponent, lane by lane. */
typedef struct {
    v4 mantissa;
    m4 exponent;
} dcc_product;

/* L_c of the samples so far, lane by lane: Π det Q, Π Π q_i, Σ v'Q⁻¹v, and the smallest pivot. */
typedef struct {
    dcc_product det, spread;
    v4 square, smallest;
} dcc_likelihood;

/* Memory of one call, for the windows one after another. */
typedef struct {
    dcc_window window;
    v4 *ring, *sums, *checkpoint, *block;
    double *filled, *moments, *each;
} dcc_memory;

/* These two work on windows start..stop - 1 and return 0, or -1 where there is no memory.
   values [K, DCC_VALUES]; target [K, n, n]; state [K]. */
int vg_dcc_fit(const dcc_windows *all, const dcc_rules *rules, double *values, double *target, uint8_t *state,
               ptrdiff_t start, ptrdiff_t stop);

/* Standard errors at optimum [K, 2]: hessian [K, 2] where wanted [K] is not 0; robust [K, 2] too where it is 2. */
int vg_dcc_errors(const dcc_windows *all, const double *optimum, const uint8_t *wanted, double *hessian, double *robust,
                  ptrdiff_t start, ptrdiff_t stop);

#endif
