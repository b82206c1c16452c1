# cython: boundscheck=False, wraparound=False
"""Binding of c/adaptive.c; see vgyro.engine.native.adaptive. No array is empty."""

cdef extern from "adaptive.h" nogil:
    ctypedef struct vg_adaptive_array:
        Py_ssize_t gyros
        double period
        const double *drive
        const double *walk
        const double *basis
        const double *white

    ctypedef struct vg_adaptive_bank:
        Py_ssize_t gyros
        Py_ssize_t noises
        Py_ssize_t walks
        const double *share
        const double *parity
        const double *noise
        const double *size
        const double *process
        double least

    int vg_adaptive_scale_bias(const vg_adaptive_array *array, const double *rate, Py_ssize_t samples, double *state,
                               double *covariance, double *estimate)
    int vg_adaptive_mix(const vg_adaptive_bank *bank, const double *rate, Py_ssize_t samples, double *mean,
                        double *variance, double *probability, double *total, double *estimate)


def scale_bias(const double[:, ::1] rate, double period, const double[::1] drive, const double[:, ::1] walk,
               const double[:, ::1] basis, const double[:, ::1] white, double[::1] state, double[:, ::1] covariance,
               double[::1] estimate) -> None:
    cdef vg_adaptive_array array = vg_adaptive_array(
        rate.shape[1], period, &drive[0], &walk[0, 0], &basis[0, 0], &white[0, 0]
    )
    cdef int failed
    with nogil:
        failed = vg_adaptive_scale_bias(&array, &rate[0, 0], rate.shape[0], &state[0], &covariance[0, 0], &estimate[0])
    if failed:
        raise MemoryError


def mix(const double[:, ::1] rate, const double[:, ::1] share, const double[:, :, ::1] parity, const double[::1] noise,
        const double[::1] size, const double[::1] process, double least, double[:, ::1] mean, double[:, ::1] variance,
        double[:, ::1] probability, double[:, ::1] total, double[::1] estimate) -> None:
    cdef vg_adaptive_bank bank = vg_adaptive_bank(
        rate.shape[1], noise.shape[0], process.shape[0], &share[0, 0], &parity[0, 0, 0], &noise[0], &size[0],
        &process[0], least
    )
    cdef int failed
    with nogil:
        failed = vg_adaptive_mix(
            &bank, &rate[0, 0], rate.shape[0], &mean[0, 0], &variance[0, 0], &probability[0, 0], &total[0, 0],
            &estimate[0]
        )
    if failed:
        raise MemoryError
