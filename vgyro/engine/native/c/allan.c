#include "allan.h"

#include "vg.h"

VG_INLINE v4 allan_load(const double *from) {
    v4 value;
    memcpy(&value, from, sizeof value);
    return value;
}

#define VG_KERNELS "allan_kernels.h"
#include "each_isa.h"

/* Terms of vg_allan_lags that are added up before they are added to the total. */
enum { PART = 512 };

void vg_allan_angle(const double *rate, size_t n, double level, double slope, double *angle) {
    double sum = 0;
    angle[0] = 0;
    for (size_t k = 0; k < n; k++) angle[k + 1] = sum += rate[k] - (level + slope * (double)k);
}

void vg_allan_angle_single(const float *rate, size_t n, double level, double slope, double *angle) {
    double sum = 0;
    angle[0] = 0;
    for (size_t k = 0; k < n; k++) angle[k + 1] = sum += rate[k] - (level + slope * (double)k);
}

void vg_allan_second(const double *angle, size_t points, const int64_t *factor, size_t factors, size_t blocks,
                     size_t first, size_t last, double *sums) {
    VG_CHOOSE(allan_second)(angle, points, factor, factors, blocks, first, last, sums);
}

void vg_allan_lags(const double *angle, size_t m, size_t n, double *sums) {
    double a = angle[3 * m], y = a - angle[2 * m], before = angle[2 * m] - angle[m], w = y - before;
    double v = w - (before - (angle[m] - angle[0])), first = angle[m] - angle[0];
    double total[VG_ALLAN_SUMS] = {
        angle[m] + angle[2 * m] + a,         first * first + before * before + y * y, first * before + before * y,
        (w - v) * (w - v) + w * w, (w - v) * w, v * v, 0,
    };
    for (size_t k = 4; k <= n;) {
        double part[VG_ALLAN_SUMS] = {0};
        for (size_t stop = k + PART < n + 1 ? k + PART : n + 1; k < stop; k++) {
            double a_next = angle[k * m], y_next = a_next - a, w_next = y_next - y, v_next = w_next - w;
            part[0] += a_next;
            part[1] += y_next * y_next;
            part[2] += y_next * y;
            part[3] += w_next * w_next;
            part[4] += w_next * w;
            part[5] += v_next * v_next;
            part[6] += v_next * v;
            a = a_next, y = y_next, w = w_next, v = v_next;
        }
        for (int i = 0; i < VG_ALLAN_SUMS; i++) total[i] += part[i];
    }
    memcpy(sums, total, sizeof total);
}
