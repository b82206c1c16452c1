#include "frames.h"

#include "vg.h"

#define VG_KERNELS "frames_kernels.h"
#include "each_isa.h"

size_t vg_frames_find(const frames_layout *layout, const uint8_t *data, size_t size, size_t from, size_t room,
                      int64_t *good, size_t *good_count, int64_t *failed, size_t *failed_count) {
    *good_count = *failed_count = 0;
    return VG_CHOOSE(frames_find)(layout, data, size, from, room, good, good_count, failed, failed_count);
}

void vg_frames_columns(const uint8_t *data, const int64_t *places, size_t count, const frames_column *columns,
                       size_t column_count) {
    VG_CHOOSE(frames_columns)(data, places, count, columns, column_count);
}

size_t vg_frames_breaks(const int64_t *start, const int64_t *counter, size_t count, int64_t length, int64_t step,
                        int64_t modulus, int64_t *rows) {
    return VG_CHOOSE(frames_breaks)(start, counter, count, length, step, modulus, rows);
}

#define FRAMES_RUN_CALL(type) \
    FRAMES_RUN(type) { return VG_CHOOSE(frames_run_##type)(values, time, count, since, began, duration); }
FRAMES_RUN_CALL(int8_t)
FRAMES_RUN_CALL(int16_t)
FRAMES_RUN_CALL(int32_t)
FRAMES_RUN_CALL(int64_t)
FRAMES_RUN_CALL(float)
FRAMES_RUN_CALL(double)
