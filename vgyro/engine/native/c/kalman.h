/* Filters and smoother of a scalar rate that N gyros measure. Arrays are C-contiguous. */
#ifndef VG_KALMAN_H
#define VG_KALMAN_H

#include <stddef.h>

/* A noise covariance whose pivot is below this share of its diagonal (times N) counts as not positive definite. */
#define VG_KALMAN_SINGULAR 2e-15

/* All that the gyros say at each sample: mean_t = 1'R_t⁻¹z_t / 1'R_t⁻¹1 and its variance 1 / 1'R_t⁻¹1.
   rate [samples, gyros], noise [gyros, gyros] at noise + t·noise_step, mean, variance [samples].
   Returns the first sample that cannot be used (not finite, R_t not positive definite), -1 for none, -2 without memory. */
ptrdiff_t vg_kalman_mean(const double *rate, const double *noise, ptrdiff_t noise_step, ptrdiff_t samples,
                         ptrdiff_t gyros, double *mean, double *variance);

/* Scalar Kalman filter in place. mean, variance [samples]: of the measurement at first, of the estimate in the end.
   process_step 0: process is one number, 1: one a sample. start, spread: mean and variance before the first sample. */
void vg_kalman_filter(double transition, const double *process, ptrdiff_t process_step, ptrdiff_t samples, double start,
                      double spread, double *mean, double *variance);

/* Rauch-Tung-Striebel smoother; process as in vg_kalman_filter. */
void vg_kalman_smooth(const double *estimate, const double *variance, double transition, const double *process,
                      ptrdiff_t process_step, ptrdiff_t samples, double *smoothed, double *spread);

/* y_k = keep·y_{k-1} + gain·signal_k from y_{-1} = start. */
void vg_kalman_low_pass(const double *signal, ptrdiff_t samples, double keep, double gain, double start, double *out);

/* y_k = φ_k·y_{k-1} + (1 - φ_k)·signal_k, φ_k = keep·(1 - f_k)/(1 - f_{k+1}), f_k = fading·keep^(2k), y_{-1} = start. */
void vg_kalman_settling(const double *signal, ptrdiff_t samples, double keep, double fading, double start, double *out);

#endif
