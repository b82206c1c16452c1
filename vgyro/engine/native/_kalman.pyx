# cython: boundscheck=False, wraparound=False
"""Binding of c/kalman.c; see vgyro.engine.native.kalman. No array is empty."""

cdef extern from "kalman.h" nogil:
    Py_ssize_t vg_kalman_mean(const double *rate, const double *noise, Py_ssize_t noise_step, Py_ssize_t samples,
                              Py_ssize_t gyros, double *mean, double *variance)
    void vg_kalman_filter(double transition, const double *process, Py_ssize_t process_step, Py_ssize_t samples,
                          double start, double spread, double *mean, double *variance)
    void vg_kalman_smooth(const double *estimate, const double *variance, double transition, const double *process,
                          Py_ssize_t process_step, Py_ssize_t samples, double *smoothed, double *spread)
    void vg_kalman_low_pass(const double *signal, Py_ssize_t samples, double keep, double gain, double start,
                            double *out)
    void vg_kalman_settling(const double *signal, Py_ssize_t samples, double keep, double fading, double start,
                            double *out)


def mean(const double[:, ::1] rate, const double[:, :, ::1] noise, double[::1] mean, double[::1] variance) -> int:
    """First sample that cannot be used, or -1; noise has one matrix, or one a sample."""
    cdef Py_ssize_t step = rate.shape[1] * rate.shape[1] if noise.shape[0] > 1 else 0
    cdef Py_ssize_t broken
    with nogil:
        broken = vg_kalman_mean(
            &rate[0, 0], &noise[0, 0, 0], step, rate.shape[0], rate.shape[1], &mean[0], &variance[0]
        )
    if broken == -2:
        raise MemoryError
    return broken


def filter(double transition, const double[::1] process, double start, double spread, double[::1] mean,
           double[::1] variance) -> None:
    with nogil:
        vg_kalman_filter(transition, &process[0], process.shape[0] > 1, mean.shape[0], start, spread, &mean[0],
                         &variance[0])


def smooth(const double[::1] estimate, const double[::1] variance, double transition, const double[::1] process,
           double[::1] smoothed, double[::1] spread) -> None:
    with nogil:
        vg_kalman_smooth(&estimate[0], &variance[0], transition, &process[0], process.shape[0] > 1,
                         estimate.shape[0], &smoothed[0], &spread[0])


def low_pass(const double[::1] signal, double keep, double gain, double start, double[::1] out) -> None:
    with nogil:
        vg_kalman_low_pass(&signal[0], signal.shape[0], keep, gain, start, &out[0])


def settling(const double[::1] signal, double keep, double fading, double start, double[::1] out) -> None:
    with nogil:
        vg_kalman_settling(&signal[0], signal.shape[0], keep, fading, start, &out[0])
