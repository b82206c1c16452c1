# cython: boundscheck=False, wraparound=False
"""Binding of c/statespace.c; see vgyro.engine.native.statespace. No array is empty, but for regime: none is given."""

from libc.stdint cimport int64_t, uint8_t

cdef extern from "statespace.h" nogil:
    ctypedef struct vg_statespace:
        Py_ssize_t states
        const double *transition
        const double *process
        const double *reads
        const double *wanted
        int coloured

    ctypedef struct vg_measured:
        const double *z
        const double *noise
        Py_ssize_t noise_step
        const uint8_t *regime
        Py_ssize_t samples

    ctypedef struct vg_likelihood:
        double squares
        double product
        int64_t exponent
        int64_t count

    void vg_statespace_likelihood(const vg_statespace *model, const vg_measured *measured, const double *start,
                                  const double *spread, Py_ssize_t skip, vg_likelihood *result)
    int vg_statespace_smooth(const vg_statespace *model, const vg_measured *measured, const double *start,
                             const double *spread, double *smoothed, double *variance)

MOST_STATES = 11


cdef vg_statespace _model(const double[:, :, ::1] transition, const double[:, :, ::1] process,
                          const double[::1] reads, const double[::1] wanted, bint coloured):
    cdef vg_statespace model
    model.states = reads.shape[0]
    model.transition, model.process = &transition[0, 0, 0], &process[0, 0, 0]
    model.reads, model.wanted, model.coloured = &reads[0], &wanted[0], coloured
    return model


cdef vg_measured _measured(const double[::1] z, const double[::1] noise, const uint8_t[::1] regime):
    cdef vg_measured measured
    measured.z, measured.noise, measured.samples = &z[0], &noise[0], z.shape[0]
    measured.noise_step = noise.shape[0] > 1
    measured.regime = &regime[0] if regime.shape[0] else NULL
    return measured


def likelihood(const double[::1] z, const double[::1] noise, const uint8_t[::1] regime,
               const double[:, :, ::1] transition, const double[:, :, ::1] process, const double[::1] reads,
               bint coloured, const double[::1] start, const double[:, ::1] spread, Py_ssize_t skip) -> tuple:
    """Σ v²/f, and Π f as a number, a power of two and how many f it is of."""
    cdef vg_statespace model = _model(transition, process, reads, reads, coloured)
    cdef vg_measured measured = _measured(z, noise, regime)
    cdef vg_likelihood found
    with nogil:
        vg_statespace_likelihood(&model, &measured, &start[0], &spread[0, 0], skip, &found)
    return found.squares, found.product, found.exponent, found.count


def smooth(const double[::1] z, const double[::1] noise, const uint8_t[::1] regime,
           const double[:, :, ::1] transition, const double[:, :, ::1] process, const double[::1] reads,
           const double[::1] wanted, bint coloured, const double[::1] start, const double[:, ::1] spread,
           double[::1] smoothed, double[::1] variance) -> None:
    cdef vg_statespace model = _model(transition, process, reads, wanted, coloured)
    cdef vg_measured measured = _measured(z, noise, regime)
    cdef int status
    with nogil:
        status = vg_statespace_smooth(&model, &measured, &start[0], &spread[0, 0], &smoothed[0], &variance[0])
    if status == -2:
        raise MemoryError
