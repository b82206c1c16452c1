#include "vg.h"

const char *vg_instruction_set(void) {
#if defined(__x86_64__)
    return vg_isa() == VG_AVX2 ? "x86-64 with AVX2" : "x86-64";
#else
    return "portable";
#endif
}
