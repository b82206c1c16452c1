/* GARCH(1,1) of many series: h_t = ω + αe²_{t-1} + βh_{t-1}, e²_0 = h_0 = mean(e²) = 1, each in its own units. */
#ifndef VG_GARCH_H
#define VG_GARCH_H

#include <stddef.h>
#include <stdint.h>

enum { VG_GARCH_FITTED = 0, VG_GARCH_FLAT = 1, VG_GARCH_FAILED = 2 };

/* r[k][t][n] of K windows, T samples and N series; strides in doubles. Series number k·N + n. */
typedef struct {
    const double *r;
    ptrdiff_t windows, samples, series;
    ptrdiff_t window_stride, sample_stride, series_stride;
} vg_garch_data_t;

/* Bounds of ω (in units of mean(e²)) and of α + β; share of its size by which a series must vary. */
typedef struct {
    double omega_min, persistence_max, flat;
} vg_garch_search_t;

/* parameters, cost and stderr in units of mean_square; cost is ½·mean(log h + e²/h), ½ for a constant variance */
typedef struct {
    double parameters[3], stderr_[3];
    double cost, mean_square, largest_share;
    int64_t outcome;
} vg_garch_fit_t;

/* Fits series first..stop-1 into fit[0..]; -1 where memory ran out. */
int vg_garch_fit(const vg_garch_data_t *data, const vg_garch_search_t *search, ptrdiff_t first, ptrdiff_t stop,
                 vg_garch_fit_t *fit);

/* h[t][n], of one window; start = h of its first sample and ω in the units of r². */
void vg_garch_variance(const vg_garch_data_t *data, const double *start, const double *omega, const double *alpha,
                       const double *beta, double *variance);

#endif
