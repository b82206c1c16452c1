/* The extended Kalman filter and the bank of filters: sample by sample, the states or the members in lockstep. */

VG_INLINE double VG(adaptive_sum)(v4 x) { return (x[0] + x[1]) + (x[2] + x[3]); }

/* Where the parts of the filter lie; rows of `wide` vectors, padded with zeros. */
typedef struct {
    v4 *covariance; /* [2N] rows */
    v4 *level;      /* [N] rows: what one whitened reading says of β, in the places of β */
    v4 *turned;     /* [N] rows: the same in the places of σ, for a rate of 1 */
    v4 *walk;       /* [N-1] rows: process noise of β */
    v4 *state, *seen, *gain, *change;
    double *scale, *left;
} VG(adaptive_parts);

VG_INLINE VG(adaptive_parts) VG(adaptive_laid)(const vg_adaptive_array *m, v4 *scratch, ptrdiff_t n, ptrdiff_t wide) {
    VG(adaptive_parts) a;
    a.covariance = scratch;
    a.level = a.covariance + 2 * n * wide;
    a.turned = a.level + n * wide;
    a.walk = a.turned + n * wide;
    a.state = a.walk + n * wide;
    a.seen = a.state + wide;
    a.gain = a.seen + wide;
    a.change = a.gain + wide;
    a.scale = (double *)(a.change + wide);
    a.left = a.scale + n;
    for (ptrdiff_t i = 0; i < n; i++) {
        for (ptrdiff_t k = 0; k < n - 1; k++) {
            double sum = 0.0;
            for (ptrdiff_t j = 0; j <= i; j++) sum += m->white[i * n + j] * m->basis[j * (n - 1) + k];
            VG_AT(a.level, wide, i, 2 + k) = sum;
            VG_AT(a.turned, wide, i, n + 1 + k) = sum;
            if (i < n - 1) VG_AT(a.walk, wide, i, 2 + k) = m->walk[i * (n - 1) + k];
        }
    }
    return a;
}

VG_INLINE void VG(adaptive_predict)(const vg_adaptive_array *m, VG(adaptive_parts) a, ptrdiff_t n, ptrdiff_t wide) {
    v4 *P = a.covariance;
    const v4 step = v4_set(m->period);
    a.state[0][0] += m->period * a.state[0][1];
    for (ptrdiff_t k = 0; k < wide; k++) P[k] += step * P[wide + k];
    P[0][0] += m->period * P[0][1];
    P[0][0] += m->drive[0];
    P[0][1] += m->drive[1];
    P[wide][1] += m->drive[2];
    for (ptrdiff_t j = 1; j < 2 * n; j++) P[j * wide][0] = VG_AT(P, wide, 0, j);
    for (ptrdiff_t k = 0; k < (n - 1) * wide; k++) P[2 * wide + k] += a.walk[k];
}

/* Error of each gyro's reading at the predicted state, and its scale 1 + s. */
VG_INLINE void VG(adaptive_innovations)(const vg_adaptive_array *m, VG(adaptive_parts) a, const double *y,
                                        ptrdiff_t n) {
    const double w = a.state[0][0];
    for (ptrdiff_t i = 0; i < n; i++) {
        double scale = 1.0, bias = 0.0;
        for (ptrdiff_t k = 0; k < n - 1; k++) {
            bias += m->basis[i * (n - 1) + k] * VG_AT(a.state, 1, 0, 2 + k);
            scale += m->basis[i * (n - 1) + k] * VG_AT(a.state, 1, 0, n + 1 + k);
        }
        a.scale[i] = scale;
        a.left[i] = y[i] - scale * w - bias;
    }
}

/* One whitened reading, of variance 1. Joseph's form for the optimal gain, P - g·g' with g = P·h/√S: bit for bit
   symmetric. The linearisation is that of the predicted state for all gyros, so their order does not matter. */
VG_INLINE void VG(adaptive_update)(const vg_adaptive_array *m, VG(adaptive_parts) a, ptrdiff_t row, ptrdiff_t n,
                                   ptrdiff_t wide) {
    v4 *P = a.covariance, *h = a.seen, *g = a.gain, *change = a.change;
    double scale = 0.0, left = 0.0;
    for (ptrdiff_t i = 0; i <= row; i++) {
        scale += m->white[row * n + i] * a.scale[i];
        left += m->white[row * n + i] * a.left[i];
    }
    const v4 w = v4_set(a.state[0][0]), first = v4_set(scale);
    for (ptrdiff_t k = 0; k < wide; k++) {
        h[k] = a.level[row * wide + k] + w * a.turned[row * wide + k];
        g[k] = first * P[k];
    }
    for (ptrdiff_t j = 2; j < 2 * n; j++) {
        const v4 seen = v4_set(VG_AT(h, wide, 0, j));
        for (ptrdiff_t k = 0; k < wide; k++) g[k] += seen * P[j * wide + k];
    }
    h[0][0] = scale;
    v4 spread = h[0] * g[0], told = h[0] * change[0];
    for (ptrdiff_t k = 1; k < wide; k++) {
        spread += h[k] * g[k];
        told += h[k] * change[k];
    }
    const double root = 1.0 / sqrt(1.0 + VG(adaptive_sum)(spread));
    const v4 roots = v4_set(root), size = v4_set((left - VG(adaptive_sum)(told)) * root);
    for (ptrdiff_t k = 0; k < wide; k++) {
        g[k] *= roots;
        change[k] += g[k] * size;
    }
    for (ptrdiff_t j = 0; j < 2 * n; j++) {
        const v4 gain = v4_set(VG_AT(g, wide, 0, j));
        for (ptrdiff_t k = 0; k < wide; k++) P[j * wide + k] -= gain * g[k];
    }
}

VG_INLINE void VG(adaptive_run)(const vg_adaptive_array *m, VG(adaptive_parts) a, const double *rate, ptrdiff_t samples,
                                ptrdiff_t n, double *estimate) {
    const ptrdiff_t wide = vectors(2 * n);
    for (ptrdiff_t t = 0; t < samples; t++) {
        VG(adaptive_predict)(m, a, n, wide);
        VG(adaptive_innovations)(m, a, rate + t * n, n);
        for (ptrdiff_t k = 0; k < wide; k++) a.change[k] = v4_set(0.0);
        for (ptrdiff_t row = 0; row < n; row++) VG(adaptive_update)(m, a, row, n, wide);
        for (ptrdiff_t k = 0; k < wide; k++) a.state[k] += a.change[k];
        estimate[t] = a.state[0][0];
    }
}

static void VG(adaptive_scale_bias)(const vg_adaptive_array *m, const double *rate, ptrdiff_t samples, v4 *scratch,
                                    double *state, double *covariance, double *estimate) {
    const ptrdiff_t n = m->gyros, states = 2 * n, wide = vectors(states);
    VG(adaptive_parts) a = VG(adaptive_laid)(m, scratch, n, wide);
    for (ptrdiff_t i = 0; i < states; i++) {
        VG_AT(a.state, wide, 0, i) = state[i];
        for (ptrdiff_t j = 0; j < states; j++) VG_AT(a.covariance, wide, i, j) = covariance[i * states + j];
    }
    /* Constant sizes let the compiler unroll. */
    switch (n) {
    case 2: VG(adaptive_run)(m, a, rate, samples, 2, estimate); break;
    case 3: VG(adaptive_run)(m, a, rate, samples, 3, estimate); break;
    case 4: VG(adaptive_run)(m, a, rate, samples, 4, estimate); break;
    case 6: VG(adaptive_run)(m, a, rate, samples, 6, estimate); break;
    default: VG(adaptive_run)(m, a, rate, samples, n, estimate);
    }
    for (ptrdiff_t i = 0; i < states; i++) {
        state[i] = VG_AT(a.state, wide, 0, i);
        for (ptrdiff_t j = 0; j < states; j++) covariance[i * states + j] = VG_AT(a.covariance, wide, i, j);
    }
}

/* e^x for x ≤ 0, to some 2e-16 of itself; below -700 it is e^-700. Not libm's: that has other bits on other machines.
   x = k·log 2 + r, |r| ≤ log 2 / 2; Taylor's series of e^r to r^13/13!, and k into the exponent. */
VG_INLINE v4 VG(adaptive_exp)(v4 x) {
    const v4 shift = v4_set(0x1.8p52);
    x = v4_max(x, v4_set(-700.0));
    v4 k = x * v4_set(0x1.71547652b82fep+0) + shift;
    const u4 power = ((u4)k + 1023) << 52;
    k -= shift;
    /* log 2 in two parts: the first has so few bits that k times it is exact. */
    const v4 r = (x - k * v4_set(0x1.62e42fee00000p-1)) - k * v4_set(0x1.a39ef35793c76p-33);
    v4 sum = v4_set(1.0);
    for (int order = 13; order > 0; order--) sum = v4_set(1.0) + r * sum * v4_set(1.0 / order);
    return sum * (v4)power;
}

/* Mean of the gyros by one R, and the parity part of e'S⁻¹e with log|R| added. d: y_i - y_0 from i = 1 on. */
VG_INLINE void VG(adaptive_weigh)(const vg_adaptive_bank *m, ptrdiff_t j, const double *d, ptrdiff_t n, double *mean,
                                  double *distance) {
    const double *share = m->share + j * (n - 1), *parity = m->parity + j * (n - 1) * (n - 1);
    double sum = 0.0, square = m->size[j];
    for (ptrdiff_t i = 0; i < n - 1; i++) {
        double whitened = 0.0;
        for (ptrdiff_t k = 0; k <= i; k++) whitened += parity[i * (n - 1) + k] * d[k];
        square += whitened * whitened;
        sum += share[i] * d[i];
    }
    *mean = sum;
    *distance = square;
}

VG_INLINE void VG(adaptive_bank)(const vg_adaptive_bank *m, const double *rate, ptrdiff_t samples, ptrdiff_t n,
                                 v4 *scratch, double *estimate) {
    const ptrdiff_t wide = vectors(m->walks), groups = m->noises * wide;
    v4 *x = scratch, *P = x + groups, *p = P + groups, *total = p + groups, *q = total + groups, *least = q + groups;
    v4 *distance = least + groups;
    double *d = (double *)(distance + groups);
    const v4 half = v4_set(-0.5);
    for (ptrdiff_t t = 0; t < samples; t++) {
        const double *y = rate + t * n;
        for (ptrdiff_t i = 1; i < n; i++) d[i - 1] = y[i] - y[0];
        v4 nearest = v4_set(INFINITY);
        for (ptrdiff_t j = 0; j < m->noises; j++) {
            double mean, parity;
            VG(adaptive_weigh)(m, j, d, n, &mean, &parity);
            const v4 z = v4_set(y[0] + mean), other = v4_set(parity), noise = v4_set(m->noise[j]);
            for (ptrdiff_t g = j * wide; g < (j + 1) * wide; g++) {
                const v4 before = P[g] + q[g], inverse = v4_set(1.0) / (before + noise), error = z - x[g];
                const v4 gain = before * inverse, share = noise * inverse;
                x[g] += gain * error;
                P[g] = gain * noise;
                distance[g] = other + error * error * inverse;
                nearest = v4_min(nearest, distance[g]);
                p[g] *= (v4){sqrt(share[0]), sqrt(share[1]), sqrt(share[2]), sqrt(share[3])};
            }
        }
        const double lowest = fmin(fmin(nearest[0], nearest[1]), fmin(nearest[2], nearest[3]));
        v4 sum = v4_set(0.0);
        for (ptrdiff_t g = 0; g < groups; g++) {
            p[g] *= VG(adaptive_exp)(half * (distance[g] - v4_set(lowest)));
            sum += p[g];
        }
        v4 inverse = v4_set(1.0 / VG(adaptive_sum)(sum));
        sum = v4_set(0.0);
        for (ptrdiff_t g = 0; g < groups; g++) {
            p[g] = v4_max(p[g] * inverse, least[g]);
            sum += p[g];
        }
        inverse = v4_set(1.0 / VG(adaptive_sum)(sum));
        sum = v4_set(0.0);
        for (ptrdiff_t g = 0; g < groups; g++) {
            p[g] *= inverse;
            total[g] += p[g];
            sum += p[g] * x[g];
        }
        estimate[t] = VG(adaptive_sum)(sum);
    }
}

static void VG(adaptive_mix)(const vg_adaptive_bank *m, const double *rate, ptrdiff_t samples, v4 *scratch,
                             double *mean, double *variance, double *probability, double *total, double *estimate) {
    const ptrdiff_t n = m->gyros, wide = vectors(m->walks), groups = m->noises * wide;
    double *columns[] = {mean, variance, probability, total};
    for (ptrdiff_t j = 0; j < m->noises; j++) {
        for (ptrdiff_t k = 0; k < wide * VG_LANES; k++) {
            /* The lanes without a member copy the last one, with a probability that is and stays zero. */
            const ptrdiff_t walk = k < m->walks ? k : m->walks - 1;
            for (ptrdiff_t c = 0; c < 4; c++) {
                const double value = columns[c][j * m->walks + walk];
                VG_AT(scratch + c * groups, wide, j, k) = k < m->walks || c < 2 ? value : 0.0;
            }
            VG_AT(scratch + 4 * groups, wide, j, k) = m->process[walk];
            VG_AT(scratch + 5 * groups, wide, j, k) = k < m->walks ? m->least : 0.0;
        }
    }
    switch (n) {
    case 2: VG(adaptive_bank)(m, rate, samples, 2, scratch, estimate); break;
    case 3: VG(adaptive_bank)(m, rate, samples, 3, scratch, estimate); break;
    case 4: VG(adaptive_bank)(m, rate, samples, 4, scratch, estimate); break;
    case 6: VG(adaptive_bank)(m, rate, samples, 6, scratch, estimate); break;
    default: VG(adaptive_bank)(m, rate, samples, n, scratch, estimate);
    }
    for (ptrdiff_t j = 0; j < m->noises; j++) {
        for (ptrdiff_t k = 0; k < m->walks; k++) {
            for (ptrdiff_t c = 0; c < 4; c++) columns[c][j * m->walks + k] = VG_AT(scratch + c * groups, wide, j, k);
        }
    }
}
