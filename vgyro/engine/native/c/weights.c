#include "weights.h"

#include "vg.h"

#define VG_KERNELS "weights_kernels.h"
#include "each_isa.h"

void vg_min_variance_weights(size_t n, const double *H, size_t count, double *w) {
    VG_CHOOSE(min_variance_weights)(n, H, count, w);
}

void vg_conditional_weights(const weights_windows *all, size_t start, size_t stop) {
    VG_CHOOSE(conditional_weights)(all, start, stop);
}
