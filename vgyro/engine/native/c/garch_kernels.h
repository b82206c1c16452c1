/* The hot code of GARCH(1,1), four series in lockstep; compiled once for each instruction set. */

/* Takes the exponent off x > 0, adds it to *power, and returns the mantissa. */
VG_INLINE v4 VG(mantissa)(v4 x, m4 *power) {
    m4 bits = (m4)x;
    *power += (bits >> 52) - 1023;
    return (v4)((bits & INT64_C(0x000fffffffffffff)) | INT64_C(0x3ff0000000000000));
}

VG_INLINE double VG(log_of)(double mantissa, int64_t power) { return log(mantissa) + (double)power * M_LN2; }

#define STEPS 2  /* of Newton's method for the size of a trend */
#define BLOCK 16 /* samples between two looks at the exponent */

/* Loads four series in lane order, in units of their mean squares; sets outcome, mean_square and largest_share. */
static void VG(load)(const vg_garch_data_t *data, ptrdiff_t first, ptrdiff_t stop, double flat, v4 *square,
                     vg_garch_fit_t *fit) {
    const double *from[VG_LANES];
    for (int lane = 0; lane < VG_LANES; lane++) {
        ptrdiff_t number = first + lane < stop ? first + lane : stop - 1;
        from[lane] = data->r + number / data->series * data->window_stride;
        from[lane] += number % data->series * data->series_stride;
    }
    v4 sum = v4_set(0), low = v4_set(INFINITY), high = v4_set(-INFINITY), most = v4_set(0);
    m4 finite = sum == sum;
    for (ptrdiff_t t = 0, at = 0; t < data->samples; t++, at += data->sample_stride) {
        v4 r = {from[0][at], from[1][at], from[2][at], from[3][at]};
        v4 e = r * r;
        finite &= e - e == 0;
        low = v4_min(low, r);
        high = v4_max(high, r);
        sum += e;
        most = v4_max(most, e);
        square[t] = e;
    }
    v4 mean = sum / v4_set((double)data->samples);
    for (int lane = 0; lane < VG_LANES; lane++) {
        double width = high[lane] - low[lane], size = fmax(fabs(high[lane]), fabs(low[lane]));
        if (!finite[lane])
            fit[lane].outcome = VG_GARCH_FAILED;
        else if (width <= flat * size)
            fit[lane].outcome = VG_GARCH_FLAT;
        else
            fit[lane].outcome = mean[lane] > 1e-290 && mean[lane] < 1e290 ? VG_GARCH_FITTED : VG_GARCH_FAILED;
        fit[lane].mean_square = mean[lane];
        fit[lane].largest_share = most[lane] / sum[lane];
    }
    m4 good;
    for (int lane = 0; lane < VG_LANES; lane++) good[lane] = fit[lane].outcome == VG_GARCH_FITTED ? -1 : 0;
    v4 scale = v4_set(1) / v4_select(good, mean, v4_set(1));
    for (ptrdiff_t t = 0; t < data->samples; t++) square[t] = v4_select(good, square[t] * scale, v4_set(1));
}

/* A row of the grid, of four series. With y = e² - 1 and g_t = y_{t-1} + βg_{t-1}: h = 1 + αg + excess·(1 - β^t). One
   division for four samples. The sums for scoring belong to the usual columns only. */
VG_INLINE void VG(row)(const v4 *square, ptrdiff_t samples, double beta, const columns_t *columns, int shifted,
                       row_t *out) {
    const v4 one = v4_set(1), zero = v4_set(0), b = v4_set(beta), b4 = b * b * b * b;
    v4 g = zero, p = b, a[COLUMNS], x[COLUMNS], product[COLUMNS], sum[COLUMNS];
    v4 yg = zero, gg = zero, yp = zero, gp = zero;
    m4 power[COLUMNS];
    for (int i = 0; i < COLUMNS; i++) {
        a[i] = v4_set(columns->share[i] * (1 - beta));
        x[i] = v4_set(columns->excess[i]);
        product[i] = one;
        sum[i] = zero;
        power[i] = (m4){0, 0, 0, 0};
    }
    for (ptrdiff_t begin = 0; begin < samples; begin += BLOCK) {
        ptrdiff_t end = begin + BLOCK < samples ? begin + BLOCK : samples, t = begin;
        for (; t + 3 < end; t += 4) {
            v4 e0 = square[t], e1 = square[t + 1], e2 = square[t + 2], e3 = square[t + 3];
            v4 y0 = e0 - one, y1 = e1 - one, y2 = e2 - one, y3 = e3 - one;
            v4 g1 = y0 + b * g, g2 = y1 + b * g1, g3 = y2 + b * g2;
            for (int i = 0; i < COLUMNS; i++) {
                v4 h0 = one + a[i] * g, h1 = one + a[i] * g1, h2 = one + a[i] * g2, h3 = one + a[i] * g3;
                if (shifted) {
                    h0 += x[i] * (one - p), h1 += x[i] * (one - p * b);
                    h2 += x[i] * (one - p * b * b), h3 += x[i] * (one - p * b * b * b);
                }
                v4 left = h0 * h1, right = h2 * h3, all = left * right;
                sum[i] += ((e0 * h1 + e1 * h0) * right + (e2 * h3 + e3 * h2) * left) / all;
                product[i] *= all;
            }
            if (!shifted) {
                yg += (y0 * g + y1 * g1) + (y2 * g2 + y3 * g3);
                gg += (g * g + g1 * g1) + (g2 * g2 + g3 * g3);
                yp += p * (y0 + b * (y1 + b * (y2 + b * y3)));
                gp += p * (g + b * (g1 + b * (g2 + b * g3)));
            }
            g = y3 + b * g3;
            p *= b4;
        }
        for (; t < end; t++) {
            v4 y = square[t] - one;
            for (int i = 0; i < COLUMNS; i++) {
                v4 h = one + a[i] * g;
                if (shifted) h += x[i] * (one - p);
                sum[i] += square[t] / h;
                product[i] *= h;
            }
            yg += y * g;
            gg += g * g;
            yp += y * p;
            gp += g * p;
            g = y + b * g;
            p *= b;
        }
        for (int i = 0; i < COLUMNS; i++) product[i] = VG(mantissa)(product[i], &power[i]);
    }
    for (int lane = 0; lane < VG_LANES; lane++) {
        row_t *row = &out[lane * ROWS];
        for (int i = 0; i < COLUMNS; i++) {
            double log_h = VG(log_of)(product[i][lane], power[i][lane]);
            row->cost[i] = 0.5 * (log_h + sum[i][lane]) / (double)samples;
        }
        add_trend(row, beta, samples, p[lane], yp[lane], gp[lane], g[lane]);
        row->yg = yg[lane], row->gg = gg[lane];
    }
}

/* The best x of each trend, of four series, by STEPS steps of Newton's method, and its cost. */
static void VG(trend)(const v4 *square, ptrdiff_t samples, const trends_t *trends, v4 *x, v4 *cost) {
    const v4 one = v4_set(1), half = v4_set(0.5), quarter = v4_set(0.25), four = v4_set(4);
    v4 mean[BINS];
    for (ptrdiff_t b = 0; b < trends->bins; b++) {
        ptrdiff_t begin = b * samples / trends->bins, end = (b + 1) * samples / trends->bins;
        mean[b] = v4_set(0);
        for (ptrdiff_t t = begin; t < end; t++) mean[b] += square[t];
        mean[b] /= v4_set((double)(end - begin));
    }
    for (int i = 0; i < ROWS; i++) {
        const v4 least = v4_set(trends->least[i]);
        v4 at = v4_set(0);
        for (int step = 0; step < STEPS; step++) {
            v4 slope = v4_set(0), curvature = v4_set(0), metric = v4_set(1e-12);
            for (ptrdiff_t b = 0; b < trends->bins; b++) {
                v4 d = v4_set(trends->d[i][b]), u = one / (one + at * d), z = mean[b] * u, p = d * u;
                slope += p * (z - one);
                curvature += p * p * (z + z - one);
                metric += p * p;
            }
            v4 next = at + slope / v4_max(curvature, half * metric);
            next = v4_min(v4_max(next, quarter * (one + at) - one), four * (one + at) - one);
            at = v4_max(next, least);
        }
        v4 product = one, sum = v4_set(0);
        m4 power = {0, 0, 0, 0};
        for (ptrdiff_t b = 0; b < trends->bins; b++) {
            v4 h = one + at * v4_set(trends->d[i][b]);
            sum += mean[b] / h - mean[b];
            product *= h;
        }
        product = VG(mantissa)(product, &power);
        x[i] = at;
        for (int lane = 0; lane < VG_LANES; lane++) {
            double gain = VG(log_of)(product[lane], power[lane]) + sum[lane];
            cost[i][lane] = 0.5 + 0.5 * gain / (double)trends->bins;
        }
    }
}

/* Looks at all points of the grid, and says where the searches of four series begin. */
static void VG(begin)(const v4 *square, ptrdiff_t samples, const trends_t *trends, series_t *series) {
    v4 x[ROWS], cost[ROWS];
    row_t rows[VG_LANES * ROWS], shifted[VG_LANES * ROWS];
    v4 most = v4_set(0);
    for (ptrdiff_t t = 0; t < samples; t++) most = v4_max(most, square[t]);
    m4 outlier = most > LARGE_OUTLIER;
    for (int i = 0; i < ROWS; i++) VG(row)(square, samples, row_beta[i], &usual, 0, rows + i);
    for (int i = 0; i < ROWS && m4_any(outlier); i++) VG(row)(square, samples, row_beta[i], &robust, 1, shifted + i);
    VG(trend)(square, samples, trends, x, cost);
    for (int lane = 0; lane < VG_LANES; lane++) {
        series[lane] = (series_t){.best = {1, 0, 0}, .best_cost = 0.5, .outlier = outlier[lane] != 0};
        choose(rows + lane * ROWS, shifted + lane * ROWS, trends, x, cost, lane, samples, &series[lane]);
    }
}

/* Cost and derivatives at one point of each lane, by the recursions of dh/dx and d²h/dx², in the coordinates of
   garch_newton.h: dl = dh/dlevel, da = dh/dα, db = dh/dβ, and dlb, dab, dbb their derivatives with respect to β. */
VG_INLINE void VG(derivatives)(const v4 *square, ptrdiff_t samples, const v4 *x, int with_outer, point_t *out) {
    const v4 one = v4_set(1), zero = v4_set(0), w = x[0], a = x[1], b = x[2];
    v4 h = w + a + b, u = one / h, product = one, sum = zero;
    v4 dl = one, da = zero, db = zero, dlb = zero, dab = zero, dbb = zero;
    v4 g0 = zero, g1 = zero, g2 = zero;
    v4 m00 = zero, m01 = zero, m02 = zero, m11 = zero, m12 = zero, m22 = zero;
    v4 c00 = zero, c01 = zero, c02 = zero, c11 = zero, c12 = zero, c22 = zero;
    v4 s00 = zero, s01 = zero, s02 = zero, s11 = zero, s12 = zero, s22 = zero;
    m4 power = {0, 0, 0, 0};
    for (ptrdiff_t begin = 0; begin < samples; begin += BLOCK) {
        ptrdiff_t end = begin + BLOCK < samples ? begin + BLOCK : samples;
        for (ptrdiff_t t = begin; t < end; t++) {
            /* The division for the next sample begins before this one's sums: it takes as long as they do. */
            v4 e = square[t], next = (w + a * e) + b * h, next_u = one / next, z = e * u;
            product *= h;
            sum += z;
            v4 p = u * dl, q = u * da, r = u * db, d = one - z, c = z + z - one;
            v4 dp = d * p, dq = d * q, dr = d * r;
            g0 += dp;
            g1 += dq;
            g2 += dr;
            if (with_outer) {
                s00 += dp * dp;
                s01 += dp * dq;
                s02 += dp * dr;
                s11 += dq * dq;
                s12 += dq * dr;
                s22 += dr * dr;
            }
            v4 pp = p * p, pq = p * q, pr = p * r, qq = q * q, qr = q * r, rr = r * r, du = d * u;
            m00 += pp;
            m01 += pq;
            m02 += pr;
            m11 += qq;
            m12 += qr;
            m22 += rr;
            c00 += c * pp;
            c01 += c * pq;
            c02 += c * pr + du * dlb;
            c11 += c * qq;
            c12 += c * qr + du * dab;
            c22 += c * rr + du * dbb;
            dbb = (db + db) + b * dbb;
            dab = da + b * dab;
            dlb = dl + b * dlb;
            db = (h - one) + b * db;
            da = (e - one) + b * da;
            dl = one + b * dl;
            h = next;
            u = next_u;
        }
        product = VG(mantissa)(product, &power);
    }
    const v4 slope[3] = {g0, g1, g2}, curvature[6] = {c00, c01, c02, c11, c12, c22};
    const v4 metric[6] = {m00, m01, m02, m11, m12, m22}, outer[6] = {s00, s01, s02, s11, s12, s22};
    const double half = 0.5 / (double)samples;
    for (int lane = 0; lane < VG_LANES; lane++) {
        out[lane].cost = half * (VG(log_of)(product[lane], power[lane]) + sum[lane]);
        for (int i = 0; i < 3; i++) out[lane].slope[i] = half * slope[i][lane];
        for (int i = 0; i < 6; i++) {
            out[lane].metric[i] = half * metric[i][lane];
            out[lane].curvature[i] = half * curvature[i][lane];
            out[lane].outer[i] = 0.5 * half * outer[i][lane];
        }
    }
}

static __attribute__((noinline)) void VG(look)(const v4 *square, ptrdiff_t samples, const v4 *x, point_t *out) {
    VG(derivatives)(square, samples, x, 0, out);
}

static __attribute__((noinline)) void VG(look_with_outer)(const v4 *square, ptrdiff_t samples, const v4 *x,
                                                          point_t *out) {
    VG(derivatives)(square, samples, x, 1, out);
}

/* All searches of the series: a lane that is done with one takes the next. */
static void VG(search)(const v4 *square, ptrdiff_t samples, const vg_garch_search_t *search, series_t *series,
                       ptrdiff_t count, v4 *work) {
    const double idle[3] = {1, 0, 0};
    ptrdiff_t in_lane[VG_LANES], next = 0;
    newton_t newton[VG_LANES];
    point_t seen[VG_LANES];
    for (ptrdiff_t t = 0; t < samples; t++) work[t] = v4_set(1);
    for (int lane = 0; lane < VG_LANES; lane++) in_lane[lane] = -1;
    for (;;) {
        v4 x[3];
        int busy = 0;
        for (int lane = 0; lane < VG_LANES; lane++) {
            while (in_lane[lane] < 0 && next < count) {
                if (next_search(&series[next], &newton[lane])) {
                    in_lane[lane] = next;
                    const v4 *four = square + next / VG_LANES * samples;
                    for (ptrdiff_t t = 0; t < samples; t++) work[t][lane] = four[t][next % VG_LANES];
                }
                next++;
            }
            busy |= in_lane[lane] >= 0;
            for (int i = 0; i < 3; i++) x[i][lane] = in_lane[lane] < 0 ? idle[i] : newton[lane].trial[i];
        }
        if (!busy) return;
        VG(look)(work, samples, x, seen);
        for (int lane = 0; lane < VG_LANES; lane++) {
            if (in_lane[lane] < 0) continue;
            series_t *of = &series[in_lane[lane]];
            newton_t *n = &newton[lane];
            int state = newton_next(n, &seen[lane], search->omega_min, search->persistence_max);
            if (state == SEARCHING && !(of->best_cost < 0.5 && is_near(n, of->best, of->best_cost))) continue;
            if (n->at.cost < of->best_cost) {
                of->best_cost = n->at.cost;
                memcpy(of->best, n->x, sizeof n->x);
            }
            if (!next_search(of, n)) in_lane[lane] = -1;
        }
    }
}

static void VG(fit_piece)(const vg_garch_data_t *data, const vg_garch_search_t *search, ptrdiff_t first, ptrdiff_t stop,
                          v4 *square, v4 *work, series_t *series, vg_garch_fit_t *fit) {
    const ptrdiff_t samples = data->samples, count = stop - first;
    trends_t trends;
    set_trends(&trends, samples, search->omega_min, search->persistence_max);
    for (ptrdiff_t i = 0; i < count; i += VG_LANES) {
        v4 *four = square + i / VG_LANES * samples;
        VG(load)(data, first + i, stop, search->flat, four, fit + i);
        VG(begin)(four, samples, &trends, series + i);
    }
    VG(search)(square, samples, search, series, count, work);
    for (ptrdiff_t i = 0; i < count; i += VG_LANES) {
        v4 x[3];
        point_t seen[VG_LANES];
        for (int lane = 0; lane < VG_LANES; lane++)
            for (int j = 0; j < 3; j++) x[j][lane] = series[i + lane].best[j];
        VG(look_with_outer)(square + i / VG_LANES * samples, samples, x, seen);
        for (int lane = 0; lane < VG_LANES; lane++) {
            memcpy(fit[i + lane].parameters, series[i + lane].best, sizeof fit->parameters);
            fit[i + lane].cost = seen[lane].cost;
            standard_errors(&seen[lane], samples, fit[i + lane].stderr_);
        }
    }
}

static int VG(garch_fit)(const vg_garch_data_t *data, const vg_garch_search_t *search, ptrdiff_t first, ptrdiff_t stop,
                         vg_garch_fit_t *fit) {
    const size_t samples = (size_t)data->samples;
    const size_t padded = ((size_t)(stop - first) + VG_LANES - 1) / VG_LANES * VG_LANES;
    v4 *square = aligned_alloc(sizeof(v4), padded * samples * sizeof(double));
    v4 *work = aligned_alloc(sizeof(v4), samples * sizeof(v4));
    series_t *series = malloc(padded * sizeof *series);
    vg_garch_fit_t *fits = malloc(padded * sizeof *fits);
    const int ready = square && work && series && fits;
    if (ready) {
        VG(fit_piece)(data, search, first, stop, square, work, series, fits);
        memcpy(fit, fits, (size_t)(stop - first) * sizeof *fit);
    }
    free(square);
    free(work);
    free(series);
    free(fits);
    return ready ? 0 : -1;
}
