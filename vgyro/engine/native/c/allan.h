/* Sums of squared second differences of the angle, and of the products that tell kinds of noise apart. */
#ifndef VG_ALLAN_H
#define VG_ALLAN_H

#include <stddef.h>
#include <stdint.h>

/* Second differences that are summed by themselves; the sums of blocks are added by the caller. */
enum { VG_ALLAN_BLOCK = 2048 };

/* Some second differences of one stretch: of the angles from `at` on, `left` of them to the end of the stretch, for
   averaging factors up to `most`. */
typedef struct {
    int64_t at, left, most;
} vg_allan_block;

/* Angle of each stretch edge[p] … edge[p + 1] - 1 about its mean: angle[0] = 0, angle[k + 1] = angle[k] + rate[k] - mean;
   with `level`, a line through the means of both halves is taken off as well. angle [T + stretches], one stretch after
   another, each a point longer than its rates. */
void vg_allan_angle(const double *rate, const int64_t *edge, size_t stretches, int level, double *angle);

/* Columns first … last - 1 of sums [factors, blocks]: Σ d² over the block's k, d the difference of `order` 2 or 3 of the
   angles x[k], x[k+m], … of that k; only k with an x[k+order·m]; 0 where m is more than its `most`. */
void vg_allan_differences(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                          int order, size_t blocks, size_t first, size_t last, double *sums);

/* Σ over all k of all stretches of at least share·m rates of (Σ_{j=k}^{k+m-1} x[j+2m] - 2x[j+m] + x[j])², x the angle,
   laid out as by vg_allan_angle. */
double vg_allan_averaged(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t share);

/* A stretch has slots edge[p] … edge[p + 1] - 1, of which some have no rate. slot [samples] of each rate, rising.
   angle, have [slots + stretches], one stretch after another: the sum of its rates about their mean before each border
   of a slot, and how many there are. */
void vg_allan_slots(const double *rate, const int64_t *slot, size_t samples, const int64_t *edge, size_t stretches,
                    double *angle, int32_t *have);

/* Over each `stride`-th k of all stretches of at least share·m slots, as far as at least `need` rates are in each of the
   `order` parts of m slots from k on: total = Σ d², Σ e; returns their number. d is the first or second difference of the
   parts' means, e the sum of its squared weights less what it were if no rate were lost. */
int64_t vg_allan_lossy(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches, size_t m,
                       size_t stride, int order, size_t share, double need, double total[2]);

/* The same for means of m/stride neighbouring d of order 2, of which at least `least` are there; e is their mean. */
int64_t vg_allan_lossy_averaged(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches, size_t m,
                                size_t stride, size_t share, double need, double least, double total[2]);

/* squares, products [3] = Σ z², Σ z z' over all stretches, z the means of m rates about their line, the differences of
   the means about their mean, the second differences about theirs; z' is the next one. Only stretches with at least
   `fewest` (>= 4) means. angle and edge as above, leveled or not: that changes rounding alone. */
void vg_allan_lags(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t fewest, double *squares,
                   double *products);

#endif
