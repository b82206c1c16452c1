/* What all kernels share: vectors of doubles, and the choice of the instruction set at run time. */
#ifndef VG_H
#define VG_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Four series in lockstep. Compilers split the vector where the registers are narrower. */
typedef double v4 __attribute__((vector_size(32)));
typedef int64_t m4 __attribute__((vector_size(32)));
#define VG_LANES 4

#define VG_INLINE static inline __attribute__((always_inline, unused))

/* Macros, so that they belong to the instruction set of the function that uses them. */
#define v4_set(x) ({ const double vg_x = (x); (v4){vg_x, vg_x, vg_x, vg_x}; })
/* mask ? yes : no, lane by lane; a mask is all ones or all zeros. */
#define v4_select(mask, yes, no) ({ const m4 vg_mask = (mask); (v4)(((m4)(yes) & vg_mask) | ((m4)(no) & ~vg_mask)); })
#define v4_max(a, b) ({ const v4 vg_a = (a), vg_b = (b); v4_select(vg_a > vg_b, vg_a, vg_b); })
#define v4_min(a, b) ({ const v4 vg_a = (a), vg_b = (b); v4_select(vg_a < vg_b, vg_a, vg_b); })
#define m4_any(mask) ({ const m4 vg_any = (mask); (vg_any[0] | vg_any[1] | vg_any[2] | vg_any[3]) != 0; })

/* Instruction sets that kernels are compiled for, from each_isa.h. The results have the same bits on all of them:
   no contraction to fused multiply-add, no reordering (see setup.py). */
enum { VG_BASELINE = 0, VG_AVX2 = 1 };

/* The best instruction set of this machine; VGYRO_ISA=baseline forces the plain one. */
VG_INLINE int vg_isa(void) {
#if defined(__x86_64__)
    const char *wanted = getenv("VGYRO_ISA");
    if (wanted && strcmp(wanted, "baseline") == 0) return VG_BASELINE;
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") ? VG_AVX2 : VG_BASELINE;
#else
    return VG_BASELINE;
#endif
}

/* In a file that includes each_isa.h: the variant of a kernel for this machine. */
#if defined(__x86_64__)
#define VG_CHOOSE(name) (vg_isa() == VG_AVX2 ? name##_avx2 : name##_baseline)
#else
#define VG_CHOOSE(name) (name##_baseline)
#endif

#endif
