/* Filter, likelihood and smoother of a linear Gaussian state space that one series measures. Arrays are C-contiguous. */
#ifndef VG_STATESPACE_H
#define VG_STATESPACE_H

#include <stddef.h>
#include <stdint.h>

/* The most states, with that of the coloured noise. */
#define VG_STATES 11

/* Samples between two places at which the forward pass keeps its state for the backward pass. */
#define VG_STATESPACE_CHUNK 1024

/* x_t = F x_{t-1} + w_t, z_t = h'x_t + v_t. transition, process [regimes, states, states]: F and the covariance of w;
   reads [states]: h; wanted [states]: c, the combination that the smoother returns.
   coloured 0: v_t is white and has the variance r_t. 1: the last state is the noise in units of its own standard
   deviation, v_t = √r_t · (last state); then reads[states - 1] is not used. */
typedef struct {
    ptrdiff_t states;
    const double *transition, *process, *reads, *wanted;
    int coloured;
} vg_statespace;

/* z [samples]; noise: r at noise + t·noise_step, infinite where z says nothing; regime [samples], of the step
   to each sample, or NULL for 0. */
typedef struct {
    const double *z, *noise;
    ptrdiff_t noise_step;
    const uint8_t *regime;
    ptrdiff_t samples;
} vg_measured;

/* Innovations after the first `skip` of them: Σ v²/f, and Π f = product · 2^exponent over `count`; product is NaN where
   an f is not above zero. */
typedef struct {
    double squares, product;
    int64_t exponent, count;
} vg_likelihood;

/* start [states], spread [states, states]: mean and covariance of the state at the first sample, before it is measured. */
void vg_statespace_likelihood(const vg_statespace *model, const vg_measured *measured, const double *start,
                              const double *spread, ptrdiff_t skip, vg_likelihood *result);

/* Mean and variance of c'x_t given all samples: smoothed, variance [samples]. Returns 0, or -2 without memory. */
int vg_statespace_smooth(const vg_statespace *model, const vg_measured *measured, const double *start,
                         const double *spread, double *smoothed, double *variance);

#endif
