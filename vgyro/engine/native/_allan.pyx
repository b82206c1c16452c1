# cython: boundscheck=False
"""Binding of c/allan.c. Arrays are contiguous; vgyro.engine.native.allan checks and explains them."""

from libc.stdint cimport int32_t, int64_t


cdef extern from "allan.h":
    enum:
        VG_ALLAN_BLOCK
    ctypedef struct vg_allan_block:
        pass
    void vg_allan_angle(const double *rate, const int64_t *edge, size_t stretches, int level, double *angle) nogil
    void vg_allan_differences(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                              int order, size_t blocks, size_t first, size_t last, double *sums) nogil
    double vg_allan_averaged(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t share) nogil
    void vg_allan_slots(const double *rate, const int64_t *slot, size_t samples, const int64_t *edge, size_t stretches,
                        double *angle, int32_t *have) nogil
    int64_t vg_allan_lossy(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches, size_t m,
                           size_t stride, int order, size_t share, double need, double *total) nogil
    int64_t vg_allan_lossy_averaged(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches,
                                    size_t m, size_t stride, size_t share, double need, double least,
                                    double *total) nogil
    void vg_allan_lags(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t fewest,
                       double *squares, double *products) nogil


BLOCK = VG_ALLAN_BLOCK


def angle(const double[::1] rate, const int64_t[::1] edges, bint level, double[::1] out):
    """Angle of each stretch, one point longer than its rates; edges [S + 1] ascend from 0 to T."""
    cdef Py_ssize_t stretches = edges.shape[0] - 1
    assert stretches > 0 and rate.shape[0] > 0 and out.shape[0] == rate.shape[0] + stretches
    assert edges[0] == 0 and edges[stretches] == rate.shape[0]
    with nogil:
        vg_allan_angle(&rate[0], &edges[0], stretches, level, &out[0])


def differences(const double[::1] angle, const int64_t[:, ::1] blocks, const int64_t[::1] factors, int order,
                double[:, ::1] sums, Py_ssize_t first, Py_ssize_t last):
    """Columns first … last - 1 of sums [M, blocks]; rows of blocks: at, left, most of vg_allan_block."""
    assert blocks.shape[1] == 3 and blocks.shape[0] == sums.shape[1] and 0 <= first < last <= sums.shape[1]
    assert sums.shape[0] == factors.shape[0] > 0 and order in (2, 3)
    with nogil:
        vg_allan_differences(&angle[0], <const vg_allan_block *> &blocks[0, 0], &factors[0], factors.shape[0], order,
                             sums.shape[1], first, last, &sums[0, 0])


def averaged(const double[::1] angle, const int64_t[::1] edges, const int64_t[::1] factors, Py_ssize_t share,
             double[::1] sums, Py_ssize_t first, Py_ssize_t last):
    """Elements first … last - 1 of sums [M]."""
    cdef Py_ssize_t f
    assert edges.shape[0] > 1 and sums.shape[0] == factors.shape[0] and 0 <= first < last <= factors.shape[0]
    with nogil:
        for f in range(first, last):
            sums[f] = vg_allan_averaged(&angle[0], &edges[0], edges.shape[0] - 1, factors[f], share)


def slots(const double[::1] rate, const int64_t[::1] slot, const int64_t[::1] edges, double[::1] angle,
          int32_t[::1] have):
    """Angle and number of samples before each border of a slot; edges [S + 1] in slots."""
    cdef Py_ssize_t stretches = edges.shape[0] - 1
    assert stretches > 0 and rate.shape[0] == slot.shape[0] > 0 and edges[0] == 0
    assert angle.shape[0] == have.shape[0] == edges[stretches] + stretches
    assert 0 <= slot[0] and slot[slot.shape[0] - 1] < edges[stretches]
    with nogil:
        vg_allan_slots(&rate[0], &slot[0], rate.shape[0], &edges[0], stretches, &angle[0], &have[0])


def lossy(const double[::1] angle, const int32_t[::1] have, const int64_t[::1] edges, const int64_t[::1] factors,
          const int64_t[::1] strides, int order, Py_ssize_t share, Py_ssize_t tenths, double[:, ::1] totals,
          int64_t[::1] used, Py_ssize_t first, Py_ssize_t last):
    """Rows first … last - 1 of totals [M, 2] and used [M]; order 0: means of neighbouring differences."""
    cdef Py_ssize_t f, need, least
    assert edges.shape[0] > 1 and angle.shape[0] == have.shape[0] and order in (0, 2, 3)
    assert totals.shape[0] == used.shape[0] == factors.shape[0] == strides.shape[0] and totals.shape[1] == 2
    assert 0 <= first < last <= factors.shape[0]
    with nogil:
        for f in range(first, last):
            need = (tenths * factors[f] + 9) // 10
            if order:
                used[f] = vg_allan_lossy(&angle[0], &have[0], &edges[0], edges.shape[0] - 1, factors[f], strides[f],
                                         order, share, need, &totals[f, 0])
            else:
                least = (tenths * (factors[f] // strides[f]) + 9) // 10
                used[f] = vg_allan_lossy_averaged(&angle[0], &have[0], &edges[0], edges.shape[0] - 1, factors[f],
                                                  strides[f], share, need, least, &totals[f, 0])


def lags(const double[::1] angle, const int64_t[::1] edges, const int64_t[::1] factors, Py_ssize_t fewest,
         double[:, ::1] squares, double[:, ::1] products, Py_ssize_t first, Py_ssize_t last):
    """Rows first … last - 1 of squares and products [M, 3]."""
    cdef Py_ssize_t f
    assert fewest >= 4 and squares.shape[1] == products.shape[1] == 3 and edges.shape[0] > 1
    assert squares.shape[0] == products.shape[0] == factors.shape[0] and 0 <= first < last <= factors.shape[0]
    with nogil:
        for f in range(first, last):
            vg_allan_lags(&angle[0], &edges[0], edges.shape[0] - 1, factors[f], fewest, &squares[f, 0], &products[f, 0])
