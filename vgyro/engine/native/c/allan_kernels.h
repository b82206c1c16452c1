/* Included once for each instruction set (each_isa.h). The order of all additions is fixed here. */

VG_INLINE v4 VG(allan_load)(const double *from) {
    v4 value;
    memcpy(&value, from, sizeof value);
    return value;
}

static double VG(allan_sum)(const double *x0, size_t m, size_t count) {
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

static void VG(allan_second)(const double *angle, const vg_allan_block *block, const int64_t *factor, size_t factors,
                             size_t blocks, size_t first, size_t last, double *sums) {
    /* All factors of one block: the near angles stay in the cache, and x[k+2m] of a factor is x[k+m] of another. */
    for (size_t b = first; b < last; b++) {
        for (size_t f = 0; f < factors; f++) {
            int64_t m = factor[f], count = block[b].left - 2 * m;
            if (count > VG_ALLAN_BLOCK) count = VG_ALLAN_BLOCK;
            int used = m <= block[b].most && count > 0;
            sums[f * blocks + b] = used ? VG(allan_sum)(angle + block[b].at, (size_t)m, (size_t)count) : 0;
        }
    }
}
