/* Frames of a serial dump: synchronisation and checksums, columns, runs of equal samples. */
#ifndef FRAMES_H
#define FRAMES_H

#include <stddef.h>
#include <stdint.h>

enum { FRAMES_NO_CHECKSUM = 0, FRAMES_CRC = 1, FRAMES_SUM = 2 };

/* Layout of a frame of `length` bytes.
   fixed    : [fixed_count] values of the bytes that never change, at the offsets fixed_at; the first is that of offset 0
   checksum : of the bytes [first, last), `width` bytes wide: FRAMES_CRC is `zeros` XOR tables[k - first][byte k] (tables of
              uint8, uint16 or uint32), FRAMES_SUM their sum; equal to the value stored at `stored`, or to `equals` where
              stored < 0 */
typedef struct {
    size_t length, fixed_count, first, last;
    const uint8_t *fixed;
    const int64_t *fixed_at;
    const void *tables;
    uint64_t zeros, equals;
    int64_t stored;
    int family, width, big_endian;
} frames_layout;

/* Candidates of data[from..size): good[] and failed[] get their offsets, at most `room` each. Returns where to go on:
   `size` when all is done, else the place of the candidate that found no room. */
size_t vg_frames_find(const frames_layout *layout, const uint8_t *data, size_t size, size_t from, size_t room,
                      int64_t *good, size_t *good_count, int64_t *failed, size_t *failed_count);

/* A channel: out[k] = the value of `width` bytes at data[places[k] + at]; width 3 becomes 4 bytes. */
typedef struct {
    size_t at;
    int width, big_endian, is_signed;
    void *out;
} frames_column;

void vg_frames_columns(const uint8_t *data, const int64_t *places, size_t count, const frames_column *columns,
                       size_t column_count);

/* Rows that do not follow the one before; counter may be NULL. Returns how many; `rows` has room for `count`. */
size_t vg_frames_breaks(const int64_t *start, const int64_t *counter, size_t count, int64_t length, int64_t step,
                        int64_t modulus, int64_t *rows);

/* The longest run of equal values that lasts longer than *duration: *began and *duration are replaced. `since`: when the
   run of values[0] began; returns when that of values[count - 1] did. count >= 1. */
#define FRAMES_RUN(type) \
    double vg_frames_run_##type(const type *values, const double *time, size_t count, double since, double *began, \
                                double *duration)
FRAMES_RUN(int8_t);
FRAMES_RUN(int16_t);
FRAMES_RUN(int32_t);
FRAMES_RUN(int64_t);
FRAMES_RUN(float);
FRAMES_RUN(double);

#endif
