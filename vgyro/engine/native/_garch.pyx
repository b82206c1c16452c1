# cython: boundscheck=False, wraparound=False
"""Binding of c/garch.h."""

from libc.stddef cimport ptrdiff_t

import numpy as np

cdef extern from "garch.h":
    enum:
        VG_GARCH_FITTED
        VG_GARCH_FLAT
        VG_GARCH_FAILED
    ctypedef struct vg_garch_data_t:
        const double *r
        ptrdiff_t windows, samples, series
        ptrdiff_t window_stride, sample_stride, series_stride
    ctypedef struct vg_garch_search_t:
        double omega_min, persistence_max, flat
    ctypedef struct vg_garch_fit_t:
        pass
    int vg_garch_fit(const vg_garch_data_t *data, const vg_garch_search_t *search, ptrdiff_t first, ptrdiff_t stop,
                     vg_garch_fit_t *fit) nogil
    void vg_garch_variance(const vg_garch_data_t *data, const double *start, const double *omega, const double *alpha,
                           const double *beta, double *variance) nogil

FITTED = VG_GARCH_FITTED
FLAT = VG_GARCH_FLAT
FAILED = VG_GARCH_FAILED

# vg_garch_fit_t
FIT = np.dtype(
    [
        ("parameters", np.float64, 3), ("stderr", np.float64, 3), ("cost", np.float64), ("mean_square", np.float64),
        ("largest_share", np.float64), ("outcome", np.int64),
    ]
)
assert FIT.itemsize == sizeof(vg_garch_fit_t)


cdef vg_garch_data_t _data(const double[:, :, :] r) noexcept:
    cdef vg_garch_data_t data
    cdef ptrdiff_t size = sizeof(double)
    data.r = &r[0, 0, 0]
    data.windows, data.samples, data.series = r.shape[0], r.shape[1], r.shape[2]
    data.window_stride, data.sample_stride = r.strides[0] // size, r.strides[1] // size
    data.series_stride = r.strides[2] // size
    return data


def fit(const double[:, :, :] r, double omega_min, double persistence_max, double flat,
        ptrdiff_t first, ptrdiff_t stop, char[::1] out):
    """Fit series first..stop-1 of r [K, T, N], numbered k·N + n, into their places of out, FIT records as bytes."""
    cdef vg_garch_data_t data = _data(r)
    cdef vg_garch_search_t search
    cdef vg_garch_fit_t *fits = <vg_garch_fit_t *> &out[0]
    cdef int failed
    search.omega_min, search.persistence_max, search.flat = omega_min, persistence_max, flat
    with nogil:
        failed = vg_garch_fit(&data, &search, first, stop, fits + first)
    if failed:
        raise MemoryError(f"no memory for {data.samples} samples of four series")


def variance(const double[:, :, :] r, const double[::1] start, const double[::1] omega, const double[::1] alpha,
             const double[::1] beta, double[:, ::1] out):
    """The path h [T, N] of the one window of r, from h of its first sample."""
    cdef vg_garch_data_t data = _data(r)
    with nogil:
        vg_garch_variance(&data, &start[0], &omega[0], &alpha[0], &beta[0], &out[0, 0])
