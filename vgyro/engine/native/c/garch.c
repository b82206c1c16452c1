#include "garch.h"

#include "vg.h"
#include "garch_newton.h"

/* The grid that finds where to begin: rows of β, and columns of α = share·(1 - β), ω = (1 - share + excess)(1 - β).
   The second set of columns is for series with large outliers, whose mean square is far from their usual variance. */
#define ROWS 8
#define COLUMNS 4
#define STARTS 8
#define LARGE_OUTLIER 20 /* in units of the mean square */
#define WORTH 0.3        /* share of the best gain so far that a start must have; with large outliers all are tried */
static const double row_beta[ROWS] = {0.0, 0.4, 0.7, 0.85, 0.93, 0.97, 0.99, 0.997};
typedef struct {
    double share[COLUMNS], excess[COLUMNS];
} columns_t;
static const columns_t usual = {{0.12, 0.35, 0.65, 0.95}, {0, 0, 0, 0}};
static const columns_t robust = {{1, 1, 0.5, 0.1}, {0.2, 0.6, -0.2, -0.1}};
static const double quiet[3] = {1e-3, 0.5, 0.4}; /* all but silent after an outlier */

/* What a row of the grid says of one series: the cost of its columns, and the sums that one step of scoring from the
   constant variance needs: h = 1 + αg + δd, y = e² - 1, g_t = y_{t-1} + βg_{t-1}, d_t = 1 + βd_{t-1}. */
typedef struct {
    double cost[COLUMNS], yg, yd, gg, gd, dd, last;
} row_t;

/* The sums that hold d_t = (1 - β^t)/(1 - β), from Σyβ^t, Σgβ^t, and β^t and g after the last sample; Σy = 0. */
static void add_trend(row_t *row, double beta, ptrdiff_t samples, double power, double yp, double gp, double g) {
    const double rest = 1 - beta, sum = (beta - power) / rest;
    const double squares = (beta * beta - power * power) / (rest * (1 + beta));
    row->yd = -yp / rest;
    row->gd = (-g / rest - gp) / rest;
    row->dd = ((double)samples - 2 * sum + squares) / (rest * rest);
    row->last = (1 - power) / rest;
}

/* Trends of the variance, α = 0: h_t = 1 + x·d_t, d_t = (1 - β^t)/(1 - β^T), for rows of 1/(1 - β) in lengths of the
   series. They are looked at in coarse bins of time, d at their middles: it is only to find where to begin. */
#define BINS 16
static const double row_length[ROWS] = {0.1, 0.2, 0.4, 0.8, 1.6, 4, 12, INFINITY};
typedef struct {
    double beta[ROWS], change[ROWS], least[ROWS]; /* 1 - β^T, and the least x */
    double d[ROWS][BINS];
    ptrdiff_t bins;
} trends_t;

static void set_trends(trends_t *trends, ptrdiff_t samples, double omega_min, double most) {
    const ptrdiff_t bins = trends->bins = samples < BINS ? samples : BINS;
    for (int i = 0; i < ROWS; i++) {
        double beta = fmin(exp(-1 / (row_length[i] * (double)samples)), most), rate = log(beta);
        trends->beta[i] = beta;
        trends->change[i] = -expm1(rate * (double)samples);
        trends->least[i] = (omega_min / (1 - beta) - 1) * trends->change[i];
        for (ptrdiff_t b = 0; b < bins; b++) {
            double middle = 0.5 * (double)(b * samples / bins + (b + 1) * samples / bins + 1);
            trends->d[i][b] = -expm1(rate * middle) / trends->change[i];
        }
    }
}

/* One series on its way: the points that its searches begin at, in order of their cost, and the best optimum so far. */
typedef struct {
    double x[STARTS][3], cost[STARTS];
    double best[3], best_cost;
    int count, next, outlier;
} series_t;

/* Keeps the starts in order of their cost, the best STARTS of them. */
static void add_start(series_t *series, const double *x, double cost) {
    int place = series->count < STARTS ? series->count++ : STARTS;
    for (; place > 0 && series->cost[place - 1] > cost; place--)
        if (place < STARTS) {
            memcpy(series->x[place], series->x[place - 1], sizeof series->x[place]);
            series->cost[place] = series->cost[place - 1];
        }
    if (place < STARTS) {
        memcpy(series->x[place], x, sizeof series->x[place]);
        series->cost[place] = cost;
    }
}

/* One step of scoring from the constant variance at a given β, α >= 0: the point, and the cost that it promises. */
static double scored(const row_t *row, double beta, ptrdiff_t samples, double *x) {
    double determinant = row->gg * row->dd - row->gd * row->gd;
    double a = (row->yg * row->dd - row->yd * row->gd) / determinant;
    double d = (row->yd * row->gg - row->yg * row->gd) / determinant;
    if (!(a > 0)) a = 0, d = row->yd / row->dd;
    double gain = 0.25 * (a * row->yg + d * row->yd) / (double)samples;
    a = fmin(a, 0.9 * (1 - beta));
    d = fmin(fmax(d, fmax(-0.8 / row->last, -0.9 * (1 - beta - a))), 3 / row->last);
    x[0] = 1 - beta - a + d;
    x[1] = a;
    x[2] = beta;
    return 0.5 - gain;
}

/* The best column of each row: its point and its cost. */
static void best_columns(const row_t *rows, const columns_t *columns, double (*x)[3], double *cost) {
    for (int i = 0; i < ROWS; i++) {
        int best = 0;
        for (int j = 1; j < COLUMNS; j++)
            if (rows[i].cost[j] < rows[i].cost[best]) best = j;
        cost[i] = rows[i].cost[best];
        x[i][0] = (1 - columns->share[best] + columns->excess[best]) * (1 - row_beta[i]);
        x[i][1] = columns->share[best] * (1 - row_beta[i]);
        x[i][2] = row_beta[i];
    }
}

/* Searches begin at the local optima along β. */
static void add_optima(series_t *series, double (*x)[3], const double *cost, double below) {
    for (int i = 0; i < ROWS; i++)
        if (cost[i] < below && !(i > 0 && cost[i - 1] <= cost[i]) && !(i + 1 < ROWS && cost[i + 1] < cost[i]))
            add_start(series, x[i], cost[i]);
}

/* Where the searches of one series of four begin; `shifted` are its rows with the robust columns, slope the best x of
   each trend. */
static void choose(const row_t *rows, const row_t *shifted, const trends_t *trends, const v4 *slope,
                   const v4 *slope_cost, int lane, ptrdiff_t samples, series_t *series) {
    double x[ROWS][3], cost[ROWS];
    best_columns(rows, &usual, x, cost);
    add_optima(series, x, cost, 0.5);
    for (int i = 0; i < ROWS; i++) cost[i] = scored(&rows[i], row_beta[i], samples, x[i]);
    add_optima(series, x, cost, INFINITY);
    if (cost[0] < cost[1]) /* a short memory: β = 0 and an optimum inside are easily taken for one */
        add_start(series, x[2], cost[2]);
    else if (cost[1] < cost[2])
        add_start(series, x[0], cost[0]);
    for (int i = 0; i < ROWS; i++) {
        x[i][0] = (1 + slope[i][lane] / trends->change[i]) * (1 - trends->beta[i]);
        x[i][1] = 0;
        x[i][2] = trends->beta[i];
        cost[i] = slope_cost[i][lane];
    }
    add_optima(series, x, cost, 0.5);
    if (series->outlier) {
        best_columns(shifted, &robust, x, cost);
        add_optima(series, x, cost, INFINITY);
        add_start(series, quiet, 0.5);
    }
}

/* Begins the next search of a series; 0 where there is none left that could win. */
static int next_search(series_t *series, newton_t *newton) {
    while (series->next < series->count) {
        int i = series->next++;
        if (!series->outlier && 0.5 - series->cost[i] < WORTH * (0.5 - series->best_cost)) continue;
        newton_begin(newton, series->x[i]);
        return 1;
    }
    return 0;
}

/* Bollerslev & Wooldridge's robust standard errors of (ω, α, β), H⁻¹(ΣSS')H⁻¹; NaN where H is not positive definite. */
static void standard_errors(const point_t *at, ptrdiff_t samples, double *out) {
    /* rows: ω, α, β in the coordinates (level, α, β) */
    const double rows[3][3] = {{1, -1, -1}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        double minus[3] = {-rows[i][0], -rows[i][1], -rows[i][2]}, solved[3], spread[3];
        out[i] = NAN;
        if (!descend(at->curvature, at->metric, 1, minus, 0, solved)) continue;
        times(at->outer, solved, spread);
        out[i] = sqrt(dot(solved, spread) / (double)samples);
    }
}

#define VG_KERNELS "garch_kernels.h"
#include "each_isa.h"

int vg_garch_fit(const vg_garch_data_t *data, const vg_garch_search_t *search, ptrdiff_t first, ptrdiff_t stop,
                 vg_garch_fit_t *fit) {
    return VG_CHOOSE(garch_fit)(data, search, first, stop, fit);
}

void vg_garch_variance(const vg_garch_data_t *data, const double *start, const double *omega, const double *alpha,
                       const double *beta, double *variance) {
    const ptrdiff_t n = data->series;
    for (ptrdiff_t i = 0; i < n; i++) variance[i] = start[i];
    for (ptrdiff_t t = 1; t < data->samples; t++)
        for (ptrdiff_t i = 0; i < n; i++) {
            double r = data->r[(t - 1) * data->sample_stride + i * data->series_stride];
            variance[t * n + i] = omega[i] + alpha[i] * (r * r) + beta[i] * variance[(t - 1) * n + i];
        }
}
