/* Filters that adapt themselves to an array of gyros. Arrays are C-contiguous. Nothing is empty; two gyros at least. */
#ifndef VG_ADAPTIVE_H
#define VG_ADAPTIVE_H

#include <stddef.h>

/* Rate w, its derivative, biases b and scale factor errors s of N gyros: y_i = (1 + s_i)·w + b_i + n_i, Σb = Σs = 0.
   b = Bβ and s = Bσ keep the two sums at zero: the state is [w, ẇ, β_1..β_(N-1), σ_1..σ_(N-1)]. */
typedef struct {
    ptrdiff_t gyros;
    double period;
    const double *drive; /* [3]: process noise of a sample, of w, of w with ẇ, of ẇ */
    const double *walk;  /* [N-1, N-1]: process noise of β a sample */
    const double *basis; /* B [N, N-1]: orthonormal columns, each of sum zero */
    const double *white; /* W [N, N], lower triangle: W·n has unit covariance */
} vg_adaptive_array;

/* Extended Kalman filter. state [2N], covariance [2N, 2N]: before the first sample, in the end after the last.
   estimate [samples]: w after each update.  Returns 0, or -2 without memory. */
int vg_adaptive_scale_bias(const vg_adaptive_array *array, const double *rate, ptrdiff_t samples, double *state,
                           double *covariance, double *estimate);

/* A bank of random-walk filters of the rate: each of `noises` covariances R_j with each of `walks` process noises. */
typedef struct {
    ptrdiff_t gyros, noises, walks;
    const double *share;   /* [noises, N-1]: R⁻¹1/1'R⁻¹1 without its first */
    const double *parity;  /* [noises, N-1, N-1], lower triangle: of unit covariance when applied to y_i - y_0 */
    const double *noise;   /* [noises]: 1/1'R⁻¹1 */
    const double *size;    /* [noises]: log|R_j| - log|R_0| */
    const double *process; /* [walks]: variance of the step to each sample */
    double least;          /* below which no probability falls, before they are made to add up to 1 again */
} vg_adaptive_bank;

/* mean, variance, probability [noises, walks]: before the first sample, in the end after the last;
   total [noises, walks] grows by the probabilities of each sample.  estimate [samples]: Σ p·x after each update.
   Returns 0, or -2 without memory. */
int vg_adaptive_mix(const vg_adaptive_bank *bank, const double *rate, ptrdiff_t samples, double *mean, double *variance,
                    double *probability, double *total, double *estimate);

#endif
