/* One search for (ω, α, β) by Newton's method within a trust region and the constraints. It is told the cost and its
   derivatives at each point that it asks for.

   Derivatives and steps are in the coordinates (level, α, β), ω = level - α - β: along the ridge of constant variance
   the data say nothing of β, and here that direction is an axis. */

#ifndef VG_GARCH_NEWTON_H
#define VG_GARCH_NEWTON_H

#include <math.h>
#include <string.h>

enum { SEARCHING, ENDED };
#define TOLERANCE 1e-8 /* predicted gain a sample of the last step; what is left after it is of higher order */
#define STALLED 1e-12  /* the same where the quadratic model had to be bent or damped */
#define PASSES 100     /* at most, for one search */
#define RADIUS 0.3     /* of the first step: about the relative change of h */
#define FLOOR 1e-6     /* least diagonal of the metric */
#define FLATTEST 1e-9  /* least curvature, in units of the metric */
#define SAME 0.03      /* distance, in units of the metric, at which two optima may count as one */
#define SAME_GAIN 0.1  /* its square, at most, as a share of the gain over the constant variance */

/* cost, slope and curvature of ½·mean(log h + e²/h); metric: its expected curvature;
   outer: mean of the outer product of the scores. Symmetric matrices as 00 01 02 11 12 22. */
typedef struct {
    double cost, slope[3], curvature[6], metric[6], outer[6];
} point_t;

/* x is the best point so far, `at` what was seen there; trial = x + step is the point that the search asks for.
   bend: see descend; convex, exact: did the model of the step need no bending, and no damping either? */
typedef struct {
    double x[3], trial[3], step[3];
    point_t at;
    double radius, size, predicted, bend;
    unsigned active;
    int convex, exact, passes;
} newton_t;

/* Constraints on a step s, normal·s >= -room: of ω, α, β, and α + β; and the directions that leave each as it is. */
static const double normal[4][3] = {{1, -1, -1}, {0, 1, 0}, {0, 0, 1}, {0, -1, -1}};
static const double within[4][2][3] = {
    {{1, 1, 0}, {1, 0, 1}}, {{1, 0, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 1, 0}}, {{1, 0, 0}, {0, 1, -1}}};

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void times(const double *m, const double *s, double *out) {
    out[0] = m[0] * s[0] + m[1] * s[1] + m[2] * s[2];
    out[1] = m[1] * s[0] + m[3] * s[1] + m[4] * s[2];
    out[2] = m[2] * s[0] + m[4] * s[1] + m[5] * s[2];
}

/* The directions that leave the constraints of `work` as they are: their number. */
static int free_directions(unsigned work, double z[3][3]) {
    int held[4], count = 0;
    for (int k = 0; k < 4; k++)
        if (work >> k & 1) held[count++] = k;
    if (count == 0) {
        memset(z, 0, 9 * sizeof(double));
        z[0][0] = z[1][1] = z[2][2] = 1;
    } else if (count == 1) {
        memcpy(z, within[held[0]], 6 * sizeof(double));
    } else if (count == 2) {
        cross(normal[held[0]], normal[held[1]], z[0]);
    }
    return count < 3 ? 3 - count : 0;
}

/* p = the minimiser of q'p + ½p'Bp along the free directions; true where B is convex there. Where it is not, the share
   `bend` of the downward curvature counts as if it were upward, and at least a little of the metric. */
static int descend(const double *b, const double *metric, double bend, const double *q, unsigned work, double *p) {
    double z[3][3], m[3][3], y[3], bz[3], mz[3];
    int n = free_directions(work, z), convex = 1;
    p[0] = p[1] = p[2] = 0;
    for (int i = 0; i < n; i++) {
        times(b, z[i], bz);
        for (int j = 0; j <= i; j++) m[i][j] = dot(z[j], bz);
        y[i] = -dot(z[i], q);
    }
    for (int i = 0; i < n; i++) {
        times(metric, z[i], mz);
        double least = FLATTEST * dot(z[i], mz);
        for (int j = 0; j < i; j++) {
            for (int k = 0; k < j; k++) m[i][j] -= m[i][k] * m[j][k] * m[k][k];
            m[i][j] /= m[j][j];
            m[i][i] -= m[i][j] * m[i][j] * m[j][j];
        }
        if (!(m[i][i] > least)) {
            m[i][i] = fmax(-bend * m[i][i], least);
            convex = 0;
        }
        for (int j = 0; j < i; j++) y[i] -= m[i][j] * y[j];
    }
    for (int i = n - 1; i >= 0; i--) {
        y[i] /= m[i][i];
        for (int j = i + 1; j < n; j++) y[i] -= m[j][i] * y[j];
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < 3; j++) p[j] += y[i] * z[i][j];
    return convex;
}

/* The constraint of `work` whose multiplier is the most negative; -1 if none is. */
static int wrongly_held(const double *q, unsigned work) {
    int worst = -1;
    double least = 0;
    for (int k = 0; k < 4; k++) {
        if (!(work >> k & 1)) continue;
        double z[3][3], away[3] = {normal[k][0], normal[k][1], normal[k][2]};
        unsigned others = work & ~(1u << k);
        int n = free_directions(others, z);
        if (n == 2) { /* one other: drop the part along its normal */
            double across[3];
            cross(z[0], z[1], across);
            double part = dot(away, across) / dot(across, across);
            for (int i = 0; i < 3; i++) away[i] -= part * across[i];
        } else if (n == 1) {
            double part = dot(normal[k], z[0]) / dot(z[0], z[0]);
            for (int i = 0; i < 3; i++) away[i] = part * z[0][i];
        }
        double multiplier = dot(q, away);
        if (multiplier < least) least = multiplier, worst = k;
    }
    return worst;
}

/* s = the minimiser of g's + ½s'Bs within the constraints, by a primal active set; true where B is convex there. */
static int bounded_step(const double *b, const double *metric, double bend, const double *g, const double *room,
                        double *s, unsigned *active) {
    unsigned work = 0;
    int convex = 1;
    double q[3] = {g[0], g[1], g[2]};
    for (int k = 0; k < 4; k++)
        if (room[k] <= 0) work |= 1u << k;
    s[0] = s[1] = s[2] = 0;
    for (int round = 0; round < 12; round++) {
        double p[3], share = 1;
        int hit = -1;
        convex = descend(b, metric, bend, q, work, p);
        for (int k = 0; k < 4; k++) {
            double slope = dot(normal[k], p);
            if (work >> k & 1 || slope >= 0) continue;
            double reach = fmax((room[k] + dot(normal[k], s)) / -slope, 0);
            if (reach < share) share = reach, hit = k;
        }
        for (int i = 0; i < 3; i++) s[i] += share * p[i];
        times(b, s, q);
        for (int i = 0; i < 3; i++) q[i] += g[i];
        int wrong = hit < 0 ? wrongly_held(q, work) : -1;
        *active = work;
        if (hit >= 0)
            work |= 1u << hit;
        else if (wrong >= 0)
            work &= ~(1u << wrong);
        else
            return convex;
    }
    return 0;
}

/* The parameters a step away, exactly on the constraints that it met. */
static void go(const double *x, const double *s, unsigned active, double omega_min, double most, double *out) {
    out[0] = active & 1 ? omega_min : fmax(x[0] + s[0] - s[1] - s[2], omega_min);
    out[1] = active & 2 ? 0 : fmin(fmax(x[1] + s[1], 0), most);
    out[2] = active & 4 ? 0 : fmax(x[2] + s[2], 0);
    if (active & 8 || out[1] + out[2] > most) {
        if (active & 4)
            out[1] = most;
        else
            out[2] = most - out[1];
    }
}

/* The next trial: the step of the quadratic model, damped until it stays within the radius. */
static void propose(newton_t *n, double omega_min, double most) {
    const double *metric = n->at.metric;
    const double room[4] = {n->x[0] - omega_min, n->x[1], n->x[2], most - (n->x[1] + n->x[2])};
    double damping = 0, low = 0, high = INFINITY;
    for (int i = 0; i < 30; i++) {
        double b[6], bent[3];
        for (int j = 0; j < 6; j++) b[j] = n->at.curvature[j] + damping * metric[j];
        n->convex = bounded_step(b, metric, n->bend, n->at.slope, room, n->step, &n->active);
        times(metric, n->step, bent);
        n->size = sqrt(dot(n->step, bent));
        times(n->at.curvature, n->step, bent);
        n->predicted = -dot(n->at.slope, n->step) - 0.5 * dot(n->step, bent);
        n->exact = n->convex && damping == 0;
        if (n->size > n->radius || (n->predicted <= 0 && !n->exact))
            low = damping;
        else if (n->size < 0.5 * n->radius && damping > 1e-6 && i < 10)
            high = damping;
        else
            break;
        damping = low == 0 ? fmin(1, high) * 0.1 : high < INFINITY ? sqrt(low * high) : 10 * low;
    }
    go(n->x, n->step, n->active, omega_min, most, n->trial);
}

static void newton_begin(newton_t *n, const double *start) {
    memcpy(n->trial, start, sizeof n->trial);
    n->radius = RADIUS;
    n->bend = 1;
    n->passes = 0;
}

/* Is the search about to end at an optimum that is known already? */
static int is_near(const newton_t *n, const double *known, double cost) {
    double away[3] = {0, known[1] - n->x[1], known[2] - n->x[2]}, along[3];
    away[0] = known[0] - n->x[0] + away[1] + away[2];
    times(n->at.metric, away, along);
    return n->at.cost > cost && dot(away, along) < fmin(SAME * SAME, SAME_GAIN * (0.5 - cost));
}

/* Takes the derivatives at n->trial and asks for the next trial; ENDED: n->x and n->at.cost are the optimum. */
static int newton_next(newton_t *n, const point_t *seen, double omega_min, double most) {
    const int first = n->passes++ == 0;
    double ratio = first ? 1 : (n->at.cost - seen->cost) / n->predicted;
    if (ratio > 1e-3) {
        memcpy(n->x, n->trial, sizeof n->x);
        n->at = *seen;
        n->at.metric[0] += FLOOR, n->at.metric[3] += FLOOR, n->at.metric[5] += FLOOR;
    }
    if (!(ratio > 0.25)) {
        n->radius = 0.25 * n->size;
        n->bend = 1;
    } else if (ratio > 0.75 && !first) {
        n->radius = fmax(n->radius, 2.5 * n->size);
        if (!n->convex) n->bend *= 0.1;
    }
    propose(n, omega_min, most);
    if (n->passes < PASSES && n->predicted > (n->exact ? TOLERANCE : STALLED)) return SEARCHING;
    if (n->exact) {
        memcpy(n->x, n->trial, sizeof n->x);
        n->at.cost -= n->predicted;
    }
    return ENDED;
}

#endif
