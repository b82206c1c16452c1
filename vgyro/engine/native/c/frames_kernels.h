/* Kernels of frames.h. */

VG_INLINE uint64_t VG(stored_value)(const uint8_t *at, int width, int big_endian) {
    uint64_t value = 0;
    for (int k = 0; k < width; k++) value = value << 8 | at[big_endian ? k : width - 1 - k];
    return value;
}

/* Two sums that do not wait for each other. */
#define FRAMES_CRC_OF(type)                                                                    \
    VG_INLINE uint64_t VG(crc_##type)(const type *table, const uint8_t *bytes, size_t count) { \
        type even = 0, odd = 0;                                                                \
        size_t k = 0;                                                                          \
        for (; k + 4 <= count; k += 4, table += 1024) {                                        \
            even ^= table[bytes[k]] ^ table[512 + bytes[k + 2]];                               \
            odd ^= table[256 + bytes[k + 1]] ^ table[768 + bytes[k + 3]];                      \
        }                                                                                      \
        for (; k < count; k++, table += 256) even ^= table[bytes[k]];                          \
        return (type)(even ^ odd);                                                             \
    }
FRAMES_CRC_OF(uint8_t)
FRAMES_CRC_OF(uint16_t)
FRAMES_CRC_OF(uint32_t)
#undef FRAMES_CRC_OF

/* kind: the width of a CRC, or 0 for a sum; a constant where this is called, as in all that calls it. */
VG_INLINE int VG(is_whole)(const frames_layout *f, const uint8_t *frame, const int kind) {
    const uint8_t *bytes = frame + f->first;
    const size_t count = f->last - f->first;
    uint64_t value = f->zeros;
    if (kind == 0) {
        uint64_t sum = 0;
        for (size_t k = 0; k < count; k++) sum += bytes[k];
        value = sum & (((uint64_t)1 << (8 * f->width)) - 1);
    } else if (kind == 1) {
        value ^= VG(crc_uint8_t)(f->tables, bytes, count);
    } else if (kind == 2) {
        value ^= VG(crc_uint16_t)(f->tables, bytes, count);
    } else {
        value ^= VG(crc_uint32_t)(f->tables, bytes, count);
    }
    if (f->stored < 0) return value == f->equals;
    return value == VG(stored_value)(frame + f->stored, kind ? kind : f->width, f->big_endian);
}

#define FRAMES_WORD 8

/* Whether a byte occurs in count >= FRAMES_WORD bytes: eight at a time, the last eight perhaps twice. */
VG_INLINE int VG(occurs)(uint8_t byte, const uint8_t *bytes, size_t count) {
    const uint64_t ones = 0x0101010101010101u, tops = 0x8080808080808080u, wanted = ones * byte;
    uint64_t word, zero = 0;
    for (size_t k = 0; k + FRAMES_WORD <= count; k += FRAMES_WORD) {
        memcpy(&word, bytes + k, FRAMES_WORD);
        word ^= wanted;
        zero |= (word - ones) & ~word;
    }
    memcpy(&word, bytes + count - FRAMES_WORD, FRAMES_WORD);
    word ^= wanted;
    zero |= (word - ones) & ~word;
    return (zero & tops) != 0;
}

/* Where the byte comes next in data[place..end), else end. */
VG_INLINE size_t VG(next_place)(const uint8_t *data, size_t place, size_t end, uint8_t byte) {
    if (place >= end || data[place] == byte) return place;
    const uint8_t *next = memchr(data + place, byte, end - place);
    return next ? (size_t)(next - data) : end;
}

VG_INLINE size_t VG(find)(const frames_layout *f, const uint8_t *data, size_t size, size_t from, size_t room,
                          int64_t *good, size_t *good_count, int64_t *failed, size_t *failed_count, const int kind) {
    size_t whole = 0, broken = 0;
    const size_t end = size - f->length + 1, length = f->length, fixed_count = f->fixed_count;
    const uint8_t sync = f->fixed[0];
    size_t place = VG(next_place)(data, from, end, sync);
    while (place < end) {
        const uint8_t *frame = data + place;
        size_t k = 1, step = 1;
        while (k < fixed_count && frame[f->fixed_at[k]] == f->fixed[k]) k++;
        if (k == fixed_count) {
            if (whole == room || broken == room) break;
            if (kind < 0 || VG(is_whole)(f, frame, kind)) {
                good[whole++] = (int64_t)place;
                /* The usual case: no sync byte inside, and the next frame right behind. */
                if (length > FRAMES_WORD && !VG(occurs)(sync, frame + 1, length - 1)) step = length;
            } else {
                failed[broken++] = (int64_t)place;
            }
        }
        place = VG(next_place)(data, place + step, end, sync);
    }
    *good_count = whole, *failed_count = broken;
    return place < end ? place : size;
}

static size_t VG(frames_find)(const frames_layout *f, const uint8_t *data, size_t size, size_t from, size_t room,
                              int64_t *good, size_t *good_count, int64_t *failed, size_t *failed_count) {
#define FRAMES_FIND(kind) VG(find)(f, data, size, from, room, good, good_count, failed, failed_count, kind)
    if (size < f->length) return size;
    if (f->family == FRAMES_NO_CHECKSUM) return FRAMES_FIND(-1);
    if (f->family == FRAMES_SUM) return FRAMES_FIND(0);
    if (f->width == 1) return FRAMES_FIND(1);
    return f->width == 2 ? FRAMES_FIND(2) : FRAMES_FIND(4);
#undef FRAMES_FIND
}

#define FRAMES_VALUES_OF(type, swap)                                                                                \
    VG_INLINE void VG(values_##type)(const uint8_t *data, const int64_t *places, size_t count, int swapped,        \
                                     type *restrict out) {                                                         \
        type value;                                                                                                \
        if (swapped)                                                                                               \
            for (size_t k = 0; k < count; k++) memcpy(&value, data + places[k], sizeof value), out[k] = swap(value); \
        else                                                                                                       \
            for (size_t k = 0; k < count; k++) memcpy(&value, data + places[k], sizeof value), out[k] = value;     \
    }
#define FRAMES_AS_IT_IS(value) (value)
FRAMES_VALUES_OF(uint8_t, FRAMES_AS_IT_IS)
FRAMES_VALUES_OF(uint16_t, __builtin_bswap16)
FRAMES_VALUES_OF(uint32_t, __builtin_bswap32)
FRAMES_VALUES_OF(uint64_t, __builtin_bswap64)
#undef FRAMES_VALUES_OF
#undef FRAMES_AS_IT_IS

static void VG(frames_values)(const uint8_t *data, const int64_t *places, size_t count, const frames_column *column,
                              size_t first) {
    const int swapped = column->big_endian != (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__);
    data += column->at;
    switch (column->width) {
    case 1: VG(values_uint8_t)(data, places, count, swapped, (uint8_t *)column->out + first); break;
    case 2: VG(values_uint16_t)(data, places, count, swapped, (uint16_t *)column->out + first); break;
    case 4: VG(values_uint32_t)(data, places, count, swapped, (uint32_t *)column->out + first); break;
    case 8: VG(values_uint64_t)(data, places, count, swapped, (uint64_t *)column->out + first); break;
    default: {
        uint32_t *out = (uint32_t *)column->out + first;
        /* x ^ 2^23 - 2^23, modulo 2^32, spreads the sign. */
        const uint32_t top = column->is_signed ? (uint32_t)1 << 23 : 0;
        for (size_t k = 0; k < count; k++)
            out[k] = ((uint32_t)VG(stored_value)(data + places[k], 3, column->big_endian) ^ top) - top;
    }
    }
}

/* So many frames stay in the nearest cache while their columns are read one by one. */
#define FRAMES_NEAR 256

static void VG(frames_columns)(const uint8_t *data, const int64_t *places, size_t count, const frames_column *columns,
                               size_t column_count) {
    for (size_t first = 0; first < count; first += FRAMES_NEAR) {
        const size_t near = count - first < FRAMES_NEAR ? count - first : FRAMES_NEAR;
        for (size_t c = 0; c < column_count; c++) VG(frames_values)(data, places + first, near, columns + c, first);
    }
}

#undef FRAMES_NEAR
#undef FRAMES_WORD

static size_t VG(frames_breaks)(const int64_t *start, const int64_t *counter, size_t count, int64_t length,
                                int64_t step, int64_t modulus, int64_t *rows) {
    size_t found = 0;
    if (count) rows[found++] = 0;
    for (size_t k = 1; k < count; k++) {
        int follows = start[k] - start[k - 1] == length;
        if (counter) {
            const int64_t difference = counter[k] - counter[k - 1];
            follows &= (difference == step) | (difference == step - modulus);
        }
        rows[found] = (int64_t)k;
        found += !follows;
    }
    return found;
}

#define FRAMES_BLOCK 64

/* Four vectors of maxima that do not wait for each other. */
VG_INLINE double VG(longest_step)(const double *time) {
    v4 longest[4] = {v4_set(0.0), v4_set(0.0), v4_set(0.0), v4_set(0.0)}, later, earlier;
    for (size_t k = 0; k < FRAMES_BLOCK; k += VG_LANES) {
        memcpy(&later, time + k, sizeof later);
        memcpy(&earlier, time + k - 1, sizeof earlier);
        const size_t own = k / VG_LANES % 4;
        longest[own] = v4_max(longest[own], later - earlier);
    }
    const v4 all = v4_max(v4_max(longest[0], longest[1]), v4_max(longest[2], longest[3]));
    const double even = all[0] > all[2] ? all[0] : all[2], odd = all[1] > all[3] ? all[1] : all[3];
    return even > odd ? even : odd;
}

/* In noise equal neighbours are rare and three equal ones rarer: a block is looked at one by one only where a run in it
   could be the longest. `running`: the sample before is in a run, which began at `since`. `mask` is as wide as `type`. */
#define FRAMES_RUN_OF(type, mask)                                                                                \
    static double VG(frames_run_##type)(const type *values, const double *time, size_t count, double since,      \
                                        double *began, double *duration) {                                       \
        int running = 1;                                                                                         \
        if (time[0] - since > *duration) *began = since, *duration = time[0] - since;                            \
        for (size_t block = 1; block < count; block += FRAMES_BLOCK) {                                           \
            const type *here = values + block;                                                                   \
            const size_t size = count - block < FRAMES_BLOCK ? count - block : FRAMES_BLOCK;                     \
            if (size == FRAMES_BLOCK && block > 1) {                                                             \
                mask two = 0, three = 0;                                                                         \
                for (ptrdiff_t k = 0; k < FRAMES_BLOCK; k++) {                                                   \
                    const mask same = here[k] == here[k - 1], before = here[k - 1] == here[k - 2];               \
                    two |= same, three |= same & before;                                                         \
                }                                                                                                \
                if (!two || (!three && VG(longest_step)(time + block) <= *duration)) {                           \
                    running = here[FRAMES_BLOCK - 1] == here[FRAMES_BLOCK - 2];                                  \
                    if (running) since = time[block + FRAMES_BLOCK - 2];                                         \
                    continue;                                                                                    \
                }                                                                                                \
            }                                                                                                    \
            for (size_t k = block; k < block + size; k++) {                                                      \
                const int same = values[k] == values[k - 1];                                                     \
                if (same) {                                                                                      \
                    if (!running) since = time[k - 1];                                                           \
                    if (time[k] - since > *duration) *began = since, *duration = time[k] - since;                \
                }                                                                                                \
                running = same;                                                                                  \
            }                                                                                                    \
        }                                                                                                        \
        return running ? since : time[count - 1];                                                                \
    }
FRAMES_RUN_OF(int8_t, int8_t)
FRAMES_RUN_OF(int16_t, int16_t)
FRAMES_RUN_OF(int32_t, int32_t)
FRAMES_RUN_OF(int64_t, int64_t)
FRAMES_RUN_OF(float, int32_t)
FRAMES_RUN_OF(double, int64_t)
#undef FRAMES_RUN_OF
#undef FRAMES_BLOCK
