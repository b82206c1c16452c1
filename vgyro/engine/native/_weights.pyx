"""Binding of c/weights.h: arrays in, arrays out, no numerics. All arrays are C-contiguous; windows may overlap."""

from libc.stdint cimport uint8_t


cdef extern from "weights.h":
    const size_t WEIGHTS_MAX
    ctypedef struct weights_windows:
        size_t n, length, inside, begin, end
        const double *r
        ptrdiff_t apart
        const double *omega
        const double *alpha
        const double *beta
        const double *a
        const double *b
        const double *target
        double *weights
        double *deviation
        double *sigma
        uint8_t *good
    void vg_min_variance_weights(size_t n, const double *H, size_t count, double *w) nogil
    void vg_conditional_weights(const weights_windows *all, size_t start, size_t stop) nogil


MAX_GYROS = WEIGHTS_MAX


def min_variance_weights(const double[:, :, ::1] H, double[:, ::1] w, size_t start, size_t stop):
    """Weights of the matrices start..stop-1."""
    cdef size_t n = H.shape[1]
    with nogil:
        vg_min_variance_weights(n, &H[start, 0, 0], stop - start, &w[start, 0])


def conditional_weights(const double[:, :, :] r, size_t inside, const double[:, ::1] omega,
                        const double[:, ::1] alpha, const double[:, ::1] beta, const double[::1] a,
                        const double[::1] b, const double[:, :, ::1] target, size_t begin, size_t end,
                        double[:, :, ::1] weights, double[:, :, ::1] deviation, double[:, ::1] sigma,
                        uint8_t[:, ::1] good, size_t start, size_t stop):
    """Weights of the samples begin..end-1 of the windows start..stop-1."""
    cdef weights_windows all
    all.n, all.length, all.inside, all.begin, all.end = r.shape[2], r.shape[1], inside, begin, end
    all.apart = r.strides[0] // <Py_ssize_t>sizeof(double)
    all.r, all.omega, all.alpha, all.beta = &r[0, 0, 0], &omega[0, 0], &alpha[0, 0], &beta[0, 0]
    all.a, all.b, all.target = &a[0], &b[0], &target[0, 0, 0]
    all.weights, all.deviation, all.sigma = &weights[0, 0, 0], &deviation[0, 0, 0], &sigma[0, 0]
    all.good = &good[0, 0]
    with nogil:
        vg_conditional_weights(&all, start, stop)
