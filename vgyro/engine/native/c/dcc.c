#include "dcc.h"

#define VG_KERNELS "dcc_kernels.h"
#include "each_isa.h"

static v4 *vectors(ptrdiff_t count) { return aligned_alloc(sizeof(v4), sizeof(v4) * (size_t)(count + 1)); }

static double *numbers(ptrdiff_t count) { return malloc(sizeof(double) * (size_t)(count + 1)); }

static void close_memory(dcc_memory *m) {
    free(m->window.h);
    free(m->window.quarter);
    free(m->filled);
    free(m->ring);
    free(m->sums);
    free(m->moments);
    free(m->checkpoint);
    free(m->block);
    free(m->each);
}

/* Returns 0 where there is no memory. */
static int open_memory(dcc_memory *m, const dcc_windows *all) {
    const ptrdiff_t samples = all->samples, n = all->n;
    *m = (dcc_memory){.window = {.samples = samples, .n = all->n}};
    m->window.quarter = vectors((samples + 3) / 4 * n);
    if (!m->window.quarter) return 0;
    if (!all->omega) return 1;
    m->window.h = numbers(samples * n);
    m->filled = numbers(samples * n);
    return m->window.h && m->filled;
}

static int open_test(dcc_memory *m, ptrdiff_t size, ptrdiff_t n) {
    m->ring = vectors(size * ((n * (n - 1) / 2 + 3) / 4));
    m->sums = vectors(size * (size + 1));
    m->moments = numbers(size * (size + 2));
    return m->ring && m->sums && m->moments;
}

static int open_errors(dcc_memory *m, ptrdiff_t samples, ptrdiff_t n) {
    const ptrdiff_t blocks = (samples + DCC_BLOCK - 1) / DCC_BLOCK;
    m->checkpoint = vectors(blocks * DCC_TRI(n));
    m->block = vectors(DCC_BLOCK * DCC_KEPT(n));
    m->each = numbers(2 * samples);
    return m->checkpoint && m->block && m->each;
}

int vg_dcc_fit(const dcc_windows *all, const dcc_rules *rules, double *values, double *target, uint8_t *state,
               ptrdiff_t start, ptrdiff_t stop) {
    dcc_memory memory;
    const ptrdiff_t n = all->n;
    const int ready = open_memory(&memory, all) && open_test(&memory, rules->lags + 1, n);
    for (ptrdiff_t k = start; ready && k < stop; k++)
        state[k] = VG_CHOOSE(dcc_fit)(all, rules, k, &memory, values + k * DCC_VALUES, target + k * n * n);
    close_memory(&memory);
    return ready ? 0 : -1;
}

int vg_dcc_errors(const dcc_windows *all, const double *optimum, const uint8_t *wanted, double *hessian, double *robust,
                  ptrdiff_t start, ptrdiff_t stop) {
    dcc_memory memory;
    const int ready = open_memory(&memory, all) && open_errors(&memory, all->samples, all->n);
    for (ptrdiff_t k = start; ready && k < stop; k++)
        if (wanted[k])
            VG_CHOOSE(dcc_errors)(all, k, &memory, optimum + 2 * k, wanted[k] == 2, hessian + 2 * k, robust + 2 * k);
    close_memory(&memory);
    return ready ? 0 : -1;
}
