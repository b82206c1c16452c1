#include "kalman.h"

#include "vg.h"

#define VG_KERNELS "kalman_kernels.h"
#include "each_isa.h"

ptrdiff_t vg_kalman_mean(const double *rate, const double *noise, ptrdiff_t noise_step, ptrdiff_t samples,
                         ptrdiff_t gyros, double *mean, double *variance) {
    v4 *scratch = aligned_alloc(sizeof(v4), (size_t)(gyros * gyros + 4 * gyros) * sizeof(v4));
    if (scratch == NULL) return -2;
    ptrdiff_t broken = VG_CHOOSE(kalman_mean)(rate, noise, noise_step, samples, gyros, scratch, mean, variance);
    free(scratch);
    return broken;
}

/* The recursions run one sample after the other; no instruction set helps them. */

void vg_kalman_filter(double transition, const double *process, ptrdiff_t process_step, ptrdiff_t samples, double start,
                      double spread, double *mean, double *variance) {
    double x = start, P = spread, square = transition * transition;
    for (ptrdiff_t t = 0; t < samples; t++) {
        double before = square * P + process[t * process_step];
        double gain = before / (before + variance[t]);
        x *= transition;
        x += gain * (mean[t] - x);
        /* Joseph's form in one dimension: (1 - gain)·before without its cancellation. */
        P = gain * variance[t];
        mean[t] = x;
        variance[t] = P;
    }
}

void vg_kalman_smooth(const double *estimate, const double *variance, double transition, const double *process,
                      ptrdiff_t process_step, ptrdiff_t samples, double *smoothed, double *spread) {
    if (samples == 0) return;
    double x = estimate[samples - 1], P = variance[samples - 1];
    smoothed[samples - 1] = x;
    spread[samples - 1] = P;
    for (ptrdiff_t t = samples - 2; t >= 0; t--) {
        double next = transition * transition * variance[t] + process[(t + 1) * process_step];
        /* Nothing moves where the next variance is zero. */
        double gain = next == 0.0 ? 0.0 : variance[t] * transition / next;
        x = estimate[t] + gain * (x - transition * estimate[t]);
        P = variance[t] + gain * gain * (P - next);
        smoothed[t] = x;
        spread[t] = P;
    }
}

void vg_kalman_low_pass(const double *signal, ptrdiff_t samples, double keep, double gain, double start, double *out) {
    double y = start;
    for (ptrdiff_t t = 0; t < samples; t++) {
        y = keep * y + gain * signal[t];
        out[t] = y;
    }
}

void vg_kalman_settling(const double *signal, ptrdiff_t samples, double keep, double fading, double start,
                        double *out) {
    double y = start, now = fading, shrink = keep * keep;
    for (ptrdiff_t t = 0; t < samples; t++) {
        double next = now * shrink;
        double stay = keep * (1.0 - now) / (1.0 - next);
        y = stay * y + (1.0 - stay) * signal[t];
        out[t] = y;
        now = next;
    }
}
