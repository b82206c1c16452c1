/* Compiles the file VG_KERNELS once for each instruction set. Its functions are named VG(name); it has no include guard.

       #include "vg.h"
       #define VG_KERNELS "garch_kernels.h"
       #include "each_isa.h"
       void vg_garch(...) { VG_CHOOSE(garch)(...); }                                                               */

#define VG(name) name##_baseline
#include VG_KERNELS
#undef VG

#if defined(__x86_64__)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define VG(name) name##_avx2
#include VG_KERNELS
#undef VG
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif

#undef VG_KERNELS
