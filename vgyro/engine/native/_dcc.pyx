# cython: boundscheck=False, wraparound=False
"""Binding of c/dcc.h: checks nothing, computes nothing."""

from libc.stddef cimport ptrdiff_t
from libc.stdint cimport uint8_t


cdef extern from "dcc.h" nogil:
    int DCC_MAX

    ctypedef struct dcc_windows:
        const double *series
        const double *omega
        const double *alpha
        const double *beta
        ptrdiff_t samples
        int n

    ctypedef struct dcc_rules:
        double persistence_max
        double eigenvalue_min
        double gain
        double flat
        double pivot_min
        int lags

    int vg_dcc_fit(const dcc_windows *, const dcc_rules *, double *, double *, uint8_t *, ptrdiff_t, ptrdiff_t)
    int vg_dcc_errors(const dcc_windows *, const double *, const uint8_t *, double *, double *, ptrdiff_t, ptrdiff_t)

MAX_SERIES = DCC_MAX


cdef class Windows:
    """series [K, T, N]; margins [3, K, N] (omega, alpha, beta), or None where the series are standardised already."""

    cdef const double[:, :, ::1] series
    cdef const double[:, :, ::1] margins
    cdef dcc_windows windows

    def __init__(self, const double[:, :, ::1] series, const double[:, :, ::1] margins=None):
        self.series = series
        self.margins = margins
        self.windows.series = &series[0, 0, 0]
        self.windows.samples = series.shape[1]
        self.windows.n = <int>series.shape[2]
        self.windows.omega = self.windows.alpha = self.windows.beta = NULL
        if margins is not None:
            self.windows.omega = &margins[0, 0, 0]
            self.windows.alpha = &margins[1, 0, 0]
            self.windows.beta = &margins[2, 0, 0]

    def fit(self, dict rules, double[:, ::1] values, double[:, :, ::1] target, uint8_t[::1] state,
            ptrdiff_t start, ptrdiff_t stop):
        """Fit windows start..stop - 1: values [K, 5], target [K, N, N], state [K]."""
        cdef dcc_rules limits = rules
        cdef int code
        with nogil:
            code = vg_dcc_fit(&self.windows, &limits, &values[0, 0], &target[0, 0, 0], &state[0], start, stop)
        if code:
            raise MemoryError

    def errors(self, const double[:, ::1] optimum, const uint8_t[::1] wanted, double[:, ::1] hessian,
               double[:, ::1] robust, ptrdiff_t start, ptrdiff_t stop):
        """Standard errors of windows start..stop - 1 at optimum [K, 2], each [K, 2]."""
        cdef int code
        with nogil:
            code = vg_dcc_errors(&self.windows, &optimum[0, 0], &wanted[0], &hessian[0, 0], &robust[0, 0], start, stop)
        if code:
            raise MemoryError
