# cython: boundscheck=False
"""Binding of c/allan.c. Arrays are contiguous; vgyro.engine.native.allan checks and explains them."""

from libc.stdint cimport int64_t


cdef extern from "allan.h":
    enum:
        VG_ALLAN_BLOCK
    ctypedef struct vg_allan_block:
        pass
    void vg_allan_angle(const double *rate, const int64_t *edge, size_t stretches, int level, double *angle) nogil
    void vg_allan_second(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                         size_t blocks, size_t first, size_t last, double *sums) nogil
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


def second(const double[::1] angle, const int64_t[:, ::1] blocks, const int64_t[::1] factors, double[:, ::1] sums,
           Py_ssize_t first, Py_ssize_t last):
    """Columns first … last - 1 of sums [M, blocks]; rows of blocks: at, left, most of vg_allan_block."""
    assert blocks.shape[1] == 3 and blocks.shape[0] == sums.shape[1] and 0 <= first < last <= sums.shape[1]
    assert sums.shape[0] == factors.shape[0] > 0
    with nogil:
        vg_allan_second(&angle[0], <const vg_allan_block *> &blocks[0, 0], &factors[0], factors.shape[0], sums.shape[1],
                        first, last, &sums[0, 0])


def lags(const double[::1] angle, const int64_t[::1] edges, const int64_t[::1] factors, Py_ssize_t fewest,
         double[:, ::1] squares, double[:, ::1] products, Py_ssize_t first, Py_ssize_t last):
    """Rows first … last - 1 of squares and products [M, 3]."""
    cdef Py_ssize_t f
    assert fewest >= 4 and squares.shape[1] == products.shape[1] == 3 and edges.shape[0] > 1
    assert squares.shape[0] == products.shape[0] == factors.shape[0] and 0 <= first < last <= factors.shape[0]
    with nogil:
        for f in range(first, last):
            vg_allan_lags(&angle[0], &edges[0], edges.shape[0] - 1, factors[f], fewest, &squares[f, 0], &products[f, 0])
