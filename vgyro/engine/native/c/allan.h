/* Sums of squared second differences of the angle, and of the products that tell kinds of noise apart. */
#ifndef VG_ALLAN_H
#define VG_ALLAN_H

#include <stddef.h>
#include <stdint.h>

/* Second differences that are summed by themselves; the sums of blocks are added by the caller. */
enum { VG_ALLAN_BLOCK = 2048 };

/* Sums for each averaging factor, see vg_allan_lags. */
enum { VG_ALLAN_SUMS = 7 };

/* angle[0] = 0, angle[k + 1] = angle[k] + rate[k] - (level + slope·k).  rate [n], angle [n + 1] */
void vg_allan_angle(const double *rate, size_t n, double level, double slope, double *angle);
void vg_allan_angle_single(const float *rate, size_t n, double level, double slope, double *angle);

/* Blocks first … last - 1 of sums [factors, blocks]: Σ (x[k+2m] - 2x[k+m] + x[k])² over k of the block; 0 where there is
   no k.  angle x [points]; blocks: those of the whole series, each VG_ALLAN_BLOCK long. */
void vg_allan_second(const double *angle, size_t points, const int64_t *factor, size_t factors, size_t blocks,
                     size_t first, size_t last, double *sums);

/* For y, the differences of every m-th angle a (n of them), w those of y and v those of w:
   sums [VG_ALLAN_SUMS] = Σ_{k≥1} a, Σ y², Σ y y', Σ w², Σ w w', Σ v², Σ v v', with ' the next one in time.  n >= 4 */
void vg_allan_lags(const double *angle, size_t m, size_t n, double *sums);

#endif
