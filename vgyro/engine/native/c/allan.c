#include "allan.h"

#include "vg.h"

#define VG_KERNELS "allan_kernels.h"
#include "each_isa.h"

/* Terms that are added up before they are added to a total. */
enum { PART = 512 };

/* Σ (rate - base) */
static double sum_about(const double *rate, size_t n, double base) {
    double total = 0;
    for (size_t k = 0; k < n;) {
        double part = 0;
        for (size_t stop = k + PART < n ? k + PART : n; k < stop; k++) part += rate[k] - base;
        total += part;
    }
    return total;
}

void vg_allan_angle(const double *rate, const int64_t *edge, size_t stretches, int level, double *angle) {
    for (size_t p = 0; p < stretches; p++) {
        const double *r = rate + edge[p];
        size_t n = (size_t)(edge[p + 1] - edge[p]), half = n / 2;
        double *x = angle + edge[p] + p, sum = 0, slope = 0;
        /* Counted from the first rate, so that a constant is exact. */
        double base = n ? r[0] : 0, middle = n % 2 ? r[half] - base : 0;
        double early = sum_about(r, half, base), late = sum_about(r + n - half, half, base);
        if (level && half) slope = (late - early) / (double)half / (double)(n - half);
        double start = n ? base + (early + middle + late) / (double)n - slope * (double)(n - 1) / 2 : 0;
        x[0] = 0;
        for (size_t k = 0; k < n; k++) x[k + 1] = sum += r[k] - (start + slope * (double)k);
    }
}

void vg_allan_differences(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                          int order, size_t blocks, size_t first, size_t last, double *sums) {
    VG_CHOOSE(allan_differences)(angle, block, factor, factors, order, blocks, first, last, sums);
}

/* Σ W², W(k) = Σ_{j=k}^{k+m-1} D(j), for `count` k; D the second difference, so W(k+1) - W(k) is the third. */
static double averaged(const double *x0, size_t m, size_t count) {
    const double *x1 = x0 + m, *x2 = x1 + m, *x3 = x2 + m;
    double total = 0;
    /* Summed anew now and then, so that rounding does not add up. */
    size_t anew = m > VG_ALLAN_BLOCK ? m : VG_ALLAN_BLOCK;
    for (size_t k = 0; k < count;) {
        double sum = 0;
        for (size_t j = k; j < k + m;) {
            double part = 0;
            for (size_t stop = j + PART < k + m ? j + PART : k + m; j < stop; j++) part += x2[j] - 2 * x1[j] + x0[j];
            sum += part;
        }
        for (size_t end = k + anew < count ? k + anew : count; k < end;) {
            double part = 0;
            for (size_t stop = k + PART < end ? k + PART : end; k < stop; k++) {
                part += sum * sum;
                if (k + 1 < count) sum += x3[k] - x0[k] + 3 * (x1[k] - x2[k]);
            }
            total += part;
        }
    }
    return total;
}

double vg_allan_averaged(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t share) {
    double total = 0;
    for (size_t p = 0; p < stretches; p++) {
        size_t rates = (size_t)(edge[p + 1] - edge[p]);
        if (rates >= share * m && rates + 2 > 3 * m) total += averaged(angle + edge[p] + p, m, rates + 2 - 3 * m);
    }
    return total;
}

void vg_allan_slots(const double *rate, const int64_t *slot, size_t samples, const int64_t *edge, size_t stretches,
                    double *angle, int32_t *have) {
    size_t k = 0;
    for (size_t p = 0; p < stretches; p++) {
        size_t first = k;
        while (k < samples && slot[k] < edge[p + 1]) k++;
        size_t n = k - first;
        double base = n ? rate[first] : 0;
        double mean = n ? base + sum_about(rate + first, n, base) / (double)n : 0, sum = 0;
        double *x = angle + edge[p] + p;
        int32_t *h = have + edge[p] + p, number = 0;
        x[0] = 0, h[0] = 0;
        for (int64_t at = edge[p]; at < edge[p + 1]; at++) {
            if (first < k && slot[first] == at) sum += rate[first++] - mean, number++;
            *++x = sum, *++h = number;
        }
    }
}

int64_t vg_allan_lossy(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches, size_t m,
                       size_t stride, int order, size_t share, double need, double total[2]) {
    int64_t used = 0;
    total[0] = total[1] = 0;
    for (size_t p = 0; p < stretches; p++) {
        size_t slots = (size_t)(edge[p + 1] - edge[p]), at = (size_t)edge[p] + p, reach = (size_t)order * m;
        if (slots < share * m || slots < reach) continue;
        size_t count = (slots - reach) / stride + 1;
        used += VG_CHOOSE(allan_lossy)(angle + at, have + at, m, stride, order, count, need, total, total + 1);
    }
    return used;
}

typedef struct {
    double d, e, there;
} lossy_difference;

static lossy_difference difference_at(const double *x, const int32_t *n, size_t m, double need) {
    double p = n[m] - n[0], q = n[2 * m] - n[m];
    if (p < need || q < need) return (lossy_difference){0, 0, 0};
    double over_p = 1 / p, over_q = 1 / q;
    return (lossy_difference){(x[2 * m] - x[m]) * over_q - (x[m] - x[0]) * over_p, over_p + over_q - 2 / (double)m, 1};
}

/* One stretch of vg_allan_lossy_averaged: `count` means of `window` differences. */
static int64_t lossy_averaged(const double *x, const int32_t *n, size_t m, size_t stride, size_t window, size_t count,
                              double need, double least, double total[2]) {
    int64_t used = 0;
    for (size_t k = 0; k < count;) {
        lossy_difference sum = {0, 0, 0};
        for (size_t j = k; j < k + window; j++) {
            lossy_difference one = difference_at(x + j * stride, n + j * stride, m, need);
            sum.d += one.d, sum.e += one.e, sum.there += one.there;
        }
        double squares = 0, excess = 0;
        for (size_t stop = k + VG_ALLAN_BLOCK < count ? k + VG_ALLAN_BLOCK : count; k < stop; k++) {
            if (sum.there >= least) {
                double mean = sum.d / sum.there;
                squares += mean * mean, excess += sum.e / sum.there, used++;
            }
            if (k + 1 == stop) continue;
            size_t in = (k + window) * stride, out = k * stride;
            lossy_difference next = difference_at(x + in, n + in, m, need), gone = difference_at(x + out, n + out, m, need);
            sum.d += next.d - gone.d, sum.e += next.e - gone.e, sum.there += next.there - gone.there;
        }
        total[0] += squares, total[1] += excess;
    }
    return used;
}

int64_t vg_allan_lossy_averaged(const double *angle, const int32_t *have, const int64_t *edge, size_t stretches, size_t m,
                                size_t stride, size_t share, double need, double least, double total[2]) {
    int64_t used = 0;
    size_t window = m / stride, reach = 2 * m + (window - 1) * stride;
    total[0] = total[1] = 0;
    for (size_t p = 0; p < stretches; p++) {
        size_t slots = (size_t)(edge[p + 1] - edge[p]), at = (size_t)edge[p] + p;
        if (slots < share * m || slots < reach) continue;
        size_t count = (slots - reach) / stride + 1;
        used += lossy_averaged(angle + at, have + at, m, stride, window, count, need, least, total);
    }
    return used;
}

/* For y, the differences of every m-th angle a (n >= 4 of them), w those of y and v those of w:
   Σ_{k≥1} a, Σ y², Σ y y', Σ w², Σ w w', Σ v², Σ v v'. */
static void lag_sums(const double *angle, size_t m, size_t n, double *total) {
    double a = angle[3 * m], y = a - angle[2 * m], before = angle[2 * m] - angle[m], first = angle[m] - angle[0];
    double w = y - before, w_before = before - first, v = w - w_before;
    total[0] = angle[m] + angle[2 * m] + a;
    total[1] = first * first + before * before + y * y;
    total[2] = first * before + before * y;
    total[3] = w_before * w_before + w * w;
    total[4] = w_before * w;
    total[5] = v * v;
    total[6] = 0;
    for (size_t k = 4; k <= n;) {
        double part[7] = {0};
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
        for (int i = 0; i < 7; i++) total[i] += part[i];
    }
}

/* Adds one stretch of n means. The means and the line are taken off in closed form: with u = y - ȳ, p_k = k - (n-1)/2 and
   the slope b = Σpu / Σp²,  Σ(u - bp)² = Σu² - bΣpu  and
   Σ(u - bp)(u' - bp') = Σuu' - b(2Σpu + (n+1)/2·(u_first - u_last)) + b²(Σp² - (n²-1)/4). */
static void add_stretch(const double *angle, size_t m, size_t n, double *squares, double *products) {
    double sums[7], first[3], last[3], square[3], product[3], scale = 1 / ((double)m * (double)m);
    lag_sums(angle, m, n, sums);
    double head[3], tail[3];
    for (size_t i = 0; i < 3; i++) {
        head[i] = angle[(i + 1) * m] - angle[i * m];
        tail[i] = angle[(n - 2 + i) * m] - angle[(n - 3 + i) * m];
    }
    for (int order = 0; order < 3; order++) {
        first[order] = head[0], last[order] = tail[2 - order];
        for (int i = 0; i + order < 2; i++) head[i] = head[i + 1] - head[i], tail[i] = tail[i + 1] - tail[i];
    }
    double end = angle[n * m], total[3] = {end, last[0] - first[0], last[1] - first[1]};
    for (int order = 0; order < 3; order++) {
        double number = (double)n - order, mean = total[order] / number;
        square[order] = sums[1 + 2 * order] - mean * total[order];
        product[order] = sums[2 + 2 * order] - mean * (2 * total[order] - first[order] - last[order]);
        product[order] += (number - 1) * mean * mean;
    }
    double d = (double)n, half = (d + 1) / 2, along = half * end - sums[0], spread = d * (d * d - 1) / 12;
    double slope = along / spread;
    square[0] -= slope * along;
    product[0] -= slope * (2 * along + half * (first[0] - last[0]));
    product[0] += slope * slope * (spread - (d * d - 1) / 4);
    for (int order = 0; order < 3; order++) {
        squares[order] += square[order] > 0 ? square[order] * scale : 0;
        products[order] += product[order] * scale;
    }
}

void vg_allan_lags(const double *angle, const int64_t *edge, size_t stretches, size_t m, size_t fewest, double *squares,
                   double *products) {
    for (int order = 0; order < 3; order++) squares[order] = products[order] = 0;
    for (size_t p = 0; p < stretches; p++) {
        size_t n = (size_t)(edge[p + 1] - edge[p]) / m;
        if (n >= fewest) add_stretch(angle + edge[p] + p, m, n, squares, products);
    }
}
