/* Included once for each instruction set (each_isa.h). The order of all additions is fixed here. */

VG_INLINE v4 VG(allan_load)(const double *from) {
    v4 value;
    memcpy(&value, from, sizeof value);
    return value;
}

static double VG(allan_sum_2)(const double *x0, size_t m, size_t count) {
    const double *x1 = x0 + m, *x2 = x1 + m;
    v4 even = v4_set(0), odd = v4_set(0);
    size_t k = 0;
    for (; k + 8 <= count; k += 8) {
        v4 d = VG(allan_load)(x2 + k) - 2 * VG(allan_load)(x1 + k) + VG(allan_load)(x0 + k);
        v4 e = VG(allan_load)(x2 + k + 4) - 2 * VG(allan_load)(x1 + k + 4) + VG(allan_load)(x0 + k + 4);
        even += d * d;
        odd += e * e;
    }
    even += odd;
    double sum = (even[0] + even[1]) + (even[2] + even[3]);
    for (; k < count; k++) {
        double d = x2[k] - 2 * x1[k] + x0[k];
        sum += d * d;
    }
    return sum;
}

static double VG(allan_sum_3)(const double *x0, size_t m, size_t count) {
    const double *x1 = x0 + m, *x2 = x1 + m, *x3 = x2 + m;
    v4 lanes = v4_set(0);
    size_t k = 0;
    for (; k + 4 <= count; k += 4) {
        v4 d = VG(allan_load)(x3 + k) - VG(allan_load)(x0 + k);
        d += 3 * (VG(allan_load)(x1 + k) - VG(allan_load)(x2 + k));
        lanes += d * d;
    }
    double sum = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    for (; k < count; k++) {
        double d = x3[k] - x0[k] + 3 * (x1[k] - x2[k]);
        sum += d * d;
    }
    return sum;
}

static void VG(allan_differences)(const double *angle, const vg_allan_block *block, const int64_t *factor,
                                  size_t factors, int order, size_t blocks, size_t first, size_t last, double *sums) {
    /* All factors of one block: the near angles stay in the cache, and x[k+2m] of a factor is x[k+m] of another. */
    for (size_t b = first; b < last; b++) {
        for (size_t f = 0; f < factors; f++) {
            int64_t m = factor[f], count = block[b].left - order * m;
            if (count > VG_ALLAN_BLOCK) count = VG_ALLAN_BLOCK;
            int used = m <= block[b].most && count > 0;
            const double *x = angle + block[b].at;
            double sum = 0;
            if (used && order == 2) sum = VG(allan_sum_2)(x, (size_t)m, (size_t)count);
            if (used && order == 3) sum = VG(allan_sum_3)(x, (size_t)m, (size_t)count);
            sums[f * blocks + b] = sum;
        }
    }
}

/* Four values, `stride` apart. */
VG_INLINE v4 VG(allan_lanes)(const double *x, size_t stride) {
    return stride == 1 ? VG(allan_load)(x) : (v4){x[0], x[stride], x[2 * stride], x[3 * stride]};
}

VG_INLINE v4 VG(allan_counts)(const int32_t *n, size_t stride) {
    return (v4){(double)n[0], (double)n[stride], (double)n[2 * stride], (double)n[3 * stride]};
}

/* What four differences add: `lanes` of them count. */
VG_INLINE void VG(allan_lossy_step)(const double *x, const int32_t *n, size_t m, size_t stride, int order, m4 lanes,
                                    double need, v4 *squares, v4 *excess, m4 *used) {
    v4 one = v4_set(1), least = v4_set(need), share = v4_set(1 / (double)m);
    v4 x1 = VG(allan_lanes)(x + m, stride), x2 = VG(allan_lanes)(x + 2 * m, stride);
    v4 h1 = VG(allan_counts)(n + m, stride), h2 = VG(allan_counts)(n + 2 * m, stride);
    v4 a = x1 - VG(allan_lanes)(x, stride), b = x2 - x1;
    v4 p = h1 - VG(allan_counts)(n, stride), q = h2 - h1;
    m4 valid = lanes & (p >= least) & (q >= least);
    v4 over_p = one / v4_max(p, one), over_q = one / v4_max(q, one), d, e;
    if (order == 2) {
        d = b * over_q - a * over_p;
        e = over_p + over_q - 2 * share;
    } else {
        v4 c = VG(allan_lanes)(x + 3 * m, stride) - x2, r = VG(allan_counts)(n + 3 * m, stride) - h2;
        v4 over_r = one / v4_max(r, one);
        valid &= r >= least;
        d = c * over_r - 2 * (b * over_q) + a * over_p;
        e = over_p + 4 * over_q + over_r - 6 * share;
    }
    *squares += v4_select(valid, d * d, v4_set(0));
    *excess += v4_select(valid, e, v4_set(0));
    *used -= valid;
}

/* `count` differences of one stretch; where none of a block's samples is lost they are plain ones. */
VG_INLINE int64_t VG(allan_lossy_stretch)(const double *x, const int32_t *n, size_t m, size_t stride, int order,
                                          size_t count, double need, double *squares, double *excess) {
    const m4 lane = {0, 1, 2, 3}, none = {0, 0, 0, 0};
    int64_t total = 0;
    for (size_t k = 0; k < count;) {
        v4 s = v4_set(0), e = v4_set(0);
        m4 used = none;
        size_t stop = k + VG_ALLAN_BLOCK < count ? k + VG_ALLAN_BLOCK : count, reach = stop - 1 + (size_t)order * m;
        if (stride == 1 && (size_t)(n[reach] - n[k]) == reach - k) {
            double sum = order == 2 ? VG(allan_sum_2)(x + k, m, stop - k) : VG(allan_sum_3)(x + k, m, stop - k);
            *squares += sum / ((double)m * (double)m);
            total += (int64_t)(stop - k);
            k = stop;
            continue;
        }
        for (; k + 4 <= stop; k += 4)
            VG(allan_lossy_step)(x + k * stride, n + k * stride, m, stride, order, ~none, need, &s, &e, &used);
        for (; k < stop; k++) {
            /* One at a time: four times the same, of which one lane counts. */
            m4 first = lane == none;
            VG(allan_lossy_step)(x + k * stride, n + k * stride, m, 0, order, first, need, &s, &e, &used);
        }
        *squares += (s[0] + s[1]) + (s[2] + s[3]);
        *excess += (e[0] + e[1]) + (e[2] + e[3]);
        total += used[0] + used[1] + used[2] + used[3];
    }
    return total;
}

static int64_t VG(allan_lossy)(const double *x, const int32_t *n, size_t m, size_t stride, int order, size_t count,
                               double need, double *squares, double *excess) {
    if (stride == 1) return VG(allan_lossy_stretch)(x, n, m, 1, order, count, need, squares, excess);
    return VG(allan_lossy_stretch)(x, n, m, stride, order, count, need, squares, excess);
}
