/* Minimum-variance weights, and the conditional covariance that they follow. Names and units are those of weights.py. */
#ifndef WEIGHTS_H
#define WEIGHTS_H

#include <stddef.h>
#include <stdint.h>

#define WEIGHTS_MAX 32

/* Windows of `length` samples, the first `inside` of which the models were fitted to; results for samples begin..end-1. */
typedef struct {
    size_t n, length, inside, begin, end;
    const double *r;                           /* [K, length, n], windows `apart` numbers apart: they may overlap */
    ptrdiff_t apart;
    const double *omega, *alpha, *beta;        /* [K, n] */
    const double *a, *b, *target;              /* [K], [K], [K, n, n] */
    double *weights, *deviation, *sigma;       /* [K, E, n], [K, E, n], [K, E], E = end - begin */
    uint8_t *good;                             /* [K, E] */
} weights_windows;

void vg_min_variance_weights(size_t n, const double *H, size_t count, double *w);
void vg_conditional_weights(const weights_windows *all, size_t start, size_t stop);

#endif
