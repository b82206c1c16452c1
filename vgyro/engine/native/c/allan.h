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

/* Columns first … last - 1 of sums [factors, blocks]: Σ (x[k+2m] - 2x[k+m] + x[k])², x the angle, over the block's k that
   have an x[k+2m]; 0 where m is more than its `most`. */
void vg_allan_second(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                     size_t blocks, size_t first, size_t last, double *sums);

/* squares, products [3] = Σ z², Σ z z' over all stretches, z the means of m rates about their line, the differences of
   the means about their mean, the second differences about theirs; z' is the next one. Only stretches with at least
   `fewest` (>= 4) means. angle and edge as above, leveled or not: that changes rounding alone. */
void vg_allan_lags(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t fewest, double *squares,
                   double *products);

#endif
