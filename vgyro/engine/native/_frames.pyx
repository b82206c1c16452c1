"""Binding of c/frames.h: arrays in, arrays out, no numerics. All arrays are C-contiguous."""

from libc.stdint cimport int8_t, int16_t, int32_t, int64_t, uint8_t, uint64_t
from libc.stdlib cimport free, malloc


cdef extern from "frames.h":
    int FRAMES_NO_CHECKSUM, FRAMES_CRC, FRAMES_SUM
    ctypedef struct frames_layout:
        size_t length, fixed_count, first, last
        const uint8_t *fixed
        const int64_t *fixed_at
        const void *tables
        uint64_t zeros, equals
        int64_t stored
        int family, width, big_endian
    size_t vg_frames_find(const frames_layout *layout, const uint8_t *data, size_t size, size_t start, size_t room,
                          int64_t *good, size_t *good_count, int64_t *failed, size_t *failed_count) nogil
    ctypedef struct frames_column:
        size_t at
        int width, big_endian, is_signed
        void *out
    void vg_frames_columns(const uint8_t *data, const int64_t *places, size_t count, const frames_column *columns,
                           size_t column_count) nogil
    size_t vg_frames_breaks(const int64_t *start, const int64_t *counter, size_t count, int64_t length, int64_t step,
                            int64_t modulus, int64_t *rows) nogil
    double vg_frames_run_int8_t(const int8_t *, const double *, size_t, double, double *, double *) nogil
    double vg_frames_run_int16_t(const int16_t *, const double *, size_t, double, double *, double *) nogil
    double vg_frames_run_int32_t(const int32_t *, const double *, size_t, double, double *, double *) nogil
    double vg_frames_run_int64_t(const int64_t *, const double *, size_t, double, double *, double *) nogil
    double vg_frames_run_float(const float *, const double *, size_t, double, double *, double *) nogil
    double vg_frames_run_double(const double *, const double *, size_t, double, double *, double *) nogil


NO_CHECKSUM, CRC, SUM = FRAMES_NO_CHECKSUM, FRAMES_CRC, FRAMES_SUM

ctypedef fused number:
    int8_t
    int16_t
    int32_t
    int64_t
    float
    double


cdef class Layout:
    """A frame's layout; keeps the arrays that it points at."""

    cdef frames_layout layout
    cdef object kept

    def __init__(self, size_t length, const uint8_t[::1] fixed, const int64_t[::1] fixed_at, int family, int width,
                 const uint8_t[::1] tables, uint64_t zeros, uint64_t equals, int64_t stored, size_t first, size_t last,
                 bint big_endian):
        self.kept = fixed, fixed_at, tables
        self.layout.length, self.layout.fixed_count = length, fixed.shape[0]
        self.layout.fixed, self.layout.fixed_at = &fixed[0], &fixed_at[0]
        self.layout.family, self.layout.width, self.layout.big_endian = family, width, big_endian
        self.layout.tables = <const void *>&tables[0]
        self.layout.zeros, self.layout.equals, self.layout.stored = zeros, equals, stored
        self.layout.first, self.layout.last = first, last

    def find(self, const uint8_t[::1] data, size_t start, int64_t[::1] good, int64_t[::1] failed):
        """(good candidates, failed candidates, where to go on); the arrays are equally long."""
        cdef size_t whole = 0, broken = 0, stop
        cdef size_t room = good.shape[0], size = data.shape[0]
        if size == 0:
            return 0, 0, 0
        with nogil:
            stop = vg_frames_find(&self.layout, &data[0], size, start, room, &good[0], &whole, &failed[0], &broken)
        return whole, broken, stop


def columns(const uint8_t[::1] data, const int64_t[::1] places, list wanted):
    """Fill the columns: tuples (at, width, big_endian, is_signed, bytes to fill). There is at least one place."""
    cdef size_t count = len(wanted), k
    cdef uint8_t[::1] out
    cdef frames_column *all = <frames_column *>malloc(max(count, 1) * sizeof(frames_column))
    if all == NULL:
        raise MemoryError
    try:
        for k in range(count):
            all[k].at, all[k].width, all[k].big_endian, all[k].is_signed, out = wanted[k]
            all[k].out = <void *>&out[0]
        with nogil:
            vg_frames_columns(&data[0], &places[0], places.shape[0], all, count)
    finally:
        free(all)


def breaks(const int64_t[::1] start, const int64_t[::1] counter, int64_t length, int64_t step, int64_t modulus,
           int64_t[::1] rows):
    """How many rows do not follow the one before; there is at least one row."""
    cdef const int64_t *numbers = NULL
    cdef size_t found
    if counter is not None:
        numbers = &counter[0]
    with nogil:
        found = vg_frames_breaks(&start[0], numbers, start.shape[0], length, step, modulus, &rows[0])
    return found


def longest_run(const number[::1] values, const double[::1] time, double since, double least):
    """(began, duration, when the last run began); duration is `least` if no run is longer."""
    cdef double began = since, duration = least, last
    cdef size_t count = values.shape[0]
    with nogil:
        if number is int8_t:
            last = vg_frames_run_int8_t(&values[0], &time[0], count, since, &began, &duration)
        elif number is int16_t:
            last = vg_frames_run_int16_t(&values[0], &time[0], count, since, &began, &duration)
        elif number is int32_t:
            last = vg_frames_run_int32_t(&values[0], &time[0], count, since, &began, &duration)
        elif number is int64_t:
            last = vg_frames_run_int64_t(&values[0], &time[0], count, since, &began, &duration)
        elif number is float:
            last = vg_frames_run_float(&values[0], &time[0], count, since, &began, &duration)
        else:
            last = vg_frames_run_double(&values[0], &time[0], count, since, &began, &duration)
    return began, duration, last
