# cython: boundscheck=False
"""Binding of c/allan.c. Arrays are contiguous; vgyro.engine.native.allan checks and explains them."""

from libc.stdint cimport int64_t


cdef extern from "allan.h":
    enum:
        VG_ALLAN_BLOCK
        VG_ALLAN_SUMS
    void vg_allan_angle(const double *rate, size_t n, double level, double slope, double *angle) nogil
    void vg_allan_angle_single(const float *rate, size_t n, double level, double slope, double *angle) nogil
    void vg_allan_second(const double *angle, size_t points, const int64_t *factor, size_t factors, size_t blocks,
                         size_t first, size_t last, double *sums) nogil
    void vg_allan_lags(const double *angle, size_t m, size_t n, double *sums) nogil


BLOCK = VG_ALLAN_BLOCK
SUMS = VG_ALLAN_SUMS

ctypedef fused real:
    double
    float


def angle(const real[::1] rate, double level, double slope, double[::1] out):
    """out[0] = 0, out[k + 1] = out[k] + rate[k] - (level + slope·k)"""
    assert rate.shape[0] > 0 and out.shape[0] == rate.shape[0] + 1
    with nogil:
        if real is double:
            vg_allan_angle(&rate[0], rate.shape[0], level, slope, &out[0])
        else:
            vg_allan_angle_single(&rate[0], rate.shape[0], level, slope, &out[0])


def second(const double[::1] angle, const int64_t[::1] factors, double[:, ::1] sums, Py_ssize_t first, Py_ssize_t last):
    """Columns first … last - 1 of sums [M, blocks]: squared second differences of the angle."""
    assert sums.shape[0] == factors.shape[0] > 0 and 0 <= first < last <= sums.shape[1]
    assert (sums.shape[1] - 1) * <Py_ssize_t>VG_ALLAN_BLOCK < angle.shape[0]
    with nogil:
        vg_allan_second(&angle[0], angle.shape[0], &factors[0], factors.shape[0], sums.shape[1], first, last, &sums[0, 0])


def lags(const double[::1] angle, const int64_t[::1] factors, double[:, ::1] sums, Py_ssize_t first, Py_ssize_t last):
    """Rows first … last - 1 of sums [M, SUMS], see vg_allan_lags; each factor has at least four differences."""
    cdef Py_ssize_t f
    assert sums.shape[0] == factors.shape[0] and sums.shape[1] == VG_ALLAN_SUMS and 0 <= first < last <= sums.shape[0]
    for f in range(first, last):
        assert 0 < 4 * factors[f] < angle.shape[0]
    with nogil:
        for f in range(first, last):
            vg_allan_lags(&angle[0], factors[f], (angle.shape[0] - 1) // factors[f], &sums[f, 0])
