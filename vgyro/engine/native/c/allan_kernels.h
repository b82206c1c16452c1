/* Included once for each instruction set (each_isa.h). The order of all additions is fixed here. */

static void VG(allan_second)(const double *angle, size_t points, const int64_t *factor, size_t factors, size_t blocks,
                             size_t first, size_t last, double *sums) {
    for (size_t block = first; block < last; block++) {
        /* All factors of one block: the near angles stay in the cache, and x[k+2m] of a factor is x[k+m] of another. */
        const double *x0 = angle + block * VG_ALLAN_BLOCK;
        for (size_t f = 0; f < factors; f++) {
            size_t m = (size_t)factor[f], start = block * VG_ALLAN_BLOCK, used = 0;
            if (start + 2 * m < points) used = points - 2 * m - start;
            if (used > VG_ALLAN_BLOCK) used = VG_ALLAN_BLOCK;
            const double *x1 = x0 + m, *x2 = x1 + m;
            v4 even = v4_set(0), odd = v4_set(0);
            size_t k = 0;
            for (; k + 8 <= used; k += 8) {
                v4 d = allan_load(x2 + k) - 2 * allan_load(x1 + k) + allan_load(x0 + k);
                v4 e = allan_load(x2 + k + 4) - 2 * allan_load(x1 + k + 4) + allan_load(x0 + k + 4);
                even += d * d;
                odd += e * e;
            }
            even += odd;
            double sum = (even[0] + even[1]) + (even[2] + even[3]);
            for (; k < used; k++) {
                double d = x2[k] - 2 * x1[k] + x0[k];
                sum += d * d;
            }
            sums[f * blocks + block] = sum;
        }
    }
}
