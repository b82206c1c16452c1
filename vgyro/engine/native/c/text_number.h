/* A number in text: the double nearest to it, as strtod gives it, but mostly without strtod. */
#ifndef TEXT_NUMBER_H
#define TEXT_NUMBER_H

#include <locale.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#if defined(__APPLE__)
#include <xlocale.h>
#endif

#include "vg.h"

#define TEXT_ONES 0x0101010101010101ull
#define TEXT_EXACT_POWER 27 /* 5^27 is the last one that fits in 63 bits */

static const double TEXT_TENS[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                   1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
static const uint64_t TEXT_WHOLE_TENS[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000};

VG_INLINE uint64_t text_load(const uint8_t *p) {
    uint64_t chunk;
    memcpy(&chunk, p, 8);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    chunk = __builtin_bswap64(chunk);
#endif
    return chunk;
}

VG_INLINE int text_is_digit(uint8_t c) { return (uint8_t)(c - '0') <= 9; }

/* Digits at the beginning of eight bytes: 0 to 8. */
VG_INLINE int text_digits(uint64_t chunk) {
    const uint64_t high = chunk & 0xF0F0F0F0F0F0F0F0ull;
    const uint64_t wrong = (high ^ 0x3030303030303030ull) | (((chunk + 0x0606060606060606ull) & 0xF0F0F0F0F0F0F0F0ull) ^ high);
    return wrong ? __builtin_ctzll(wrong) >> 3 : 8;
}

/* Value of eight digits, of which the first are at the low end (Lemire's three multiplications). */
VG_INLINE uint64_t text_eight(uint64_t digits) {
    digits = digits * 10 + (digits >> 8);
    return (((digits & 0x000000FF000000FFull) * 0x000F424000000064ull) +
            (((digits >> 16) & 0x000000FF000000FFull) * 0x0000271000000001ull)) >> 32;
}

/* The double nearest to (high · 2^64 + low, and a little more if `more`) · 2^exponent; ties go to the even one. Only
   for results that are normal doubles; high or low is not 0. */
static double text_rounded(uint64_t high, uint64_t low, int more, int exponent) {
    if (high == 0) {
        high = low, low = 0, exponent -= 64;
    }
    const int shift = __builtin_clzll(high);
    if (shift) {
        high = high << shift | low >> (64 - shift);
        low <<= shift;
    }
    exponent += 64 - shift;
    uint64_t whole = high >> 11;
    const uint64_t rest = high & 0x7FF, half = 0x400;
    const int beyond = low != 0 || more;
    if (rest > half || (rest == half && (beyond || (whole & 1)))) whole++;
    const uint64_t bits = (uint64_t)(exponent + 11 + 1023) << 52;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return (double)whole * scale;
}

/* digits · 10^power, exactly rounded, for any 64-bit digits and |power| <= TEXT_EXACT_POWER. */
static double text_scaled(uint64_t digits, int power) {
    if (digits == 0) return 0.0;
    uint64_t five = 1;
    for (int k = power < 0 ? -power : power; k > 0; k--) five *= 5;
    if (power >= 0) {
        const unsigned __int128 product = (unsigned __int128)digits * five;
        return text_rounded((uint64_t)(product >> 64), (uint64_t)product, 0, power);
    }
    /* Both with their top bit set, the numerator half: a quotient of 63 or 64 bits, and whether anything is left. */
    const int up = __builtin_clzll(digits), down = __builtin_clzll(five);
    const unsigned __int128 numerator = (unsigned __int128)(digits << up) << 63;
    const uint64_t denominator = five << down;
    const uint64_t quotient = (uint64_t)(numerator / denominator);
    return text_rounded(0, quotient, numerator % denominator != 0, power - up + down - 63);
}

/* Read a plain number at p, which a byte that is no part of a number ends. Returns where it ends; NULL if there is
   none, or if it needs more care: over 19 digits, or a large exponent.

   decimals : how many there were in the column's last number. Where there are as many again, the processor may go on
              behind them without having counted them: that is worth a third of the time. */
VG_INLINE const uint8_t *text_plain(const uint8_t *p, uint8_t point, double *value, int *decimals) {
    const int minus = *p == '-';
    p += minus | (*p == '+');
    const uint8_t *start = p;
    uint64_t digits = 0;
    while (text_is_digit(*p)) digits = digits * 10 + (uint64_t)(*p++ - '0');
    int64_t count = p - start;
    int power = 0;
    if (*p == point) {
        p++;
        int found;
        do {
            const uint64_t chunk = text_load(p);
            found = text_digits(chunk);
            if (found == 0) break;
            int step = *decimals;
            if (found != step) *decimals = step = found;
            /* The compiler must not see that both are equal: it would wait for the count. */
            __asm__("" : "+r"(step));
            const uint64_t aligned = (chunk & 0x0F0F0F0F0F0F0F0Full) << (64 - 8 * step);
            digits = digits * TEXT_WHOLE_TENS[step] + text_eight(aligned);
            p += step, power -= step, count += step;
        } while (found == 8);
    }
    if (count == 0 || count > 19) return NULL;
    if ((*p | 32) == 'e') {
        p++;
        const int negative = *p == '-';
        p += negative | (*p == '+');
        if (!text_is_digit(*p)) return NULL;
        int exponent = 0;
        while (text_is_digit(*p)) {
            if (exponent < 100000) exponent = exponent * 10 + (*p - '0');
            p++;
        }
        power += negative ? -exponent : exponent;
    }
    double found;
    if (digits >> 53 == 0 && power >= -22 && power <= 22)
        found = power < 0 ? (double)digits / TEXT_TENS[-power] : (double)digits * TEXT_TENS[power];
    else if (power >= -TEXT_EXACT_POWER && power <= TEXT_EXACT_POWER)
        found = text_scaled(digits, power);
    else
        return NULL;
    /* The sign by its bit: a jump would be guessed wrong half the time. */
    uint64_t bits;
    memcpy(&bits, &found, sizeof bits);
    bits |= (uint64_t)minus << 63;
    memcpy(value, &bits, sizeof bits);
    return p;
}

/* Is [a, b) this word of small letters, whatever the case? */
VG_INLINE int text_is(const uint8_t *a, const uint8_t *b, const char *word) {
    for (; a < b && *word; a++, word++) {
        const uint8_t c = *a >= 'A' && *a <= 'Z' ? (uint8_t)(*a + 32) : *a;
        if (c != (uint8_t)*word) return 0;
    }
    return a == b && *word == 0;
}

/* Does [a, b) stand for a missing value? */
static int text_missing(const uint8_t *a, const uint8_t *b) {
    static const char *const words[] = {"nan", "null", "na", "n/a", "none", "-nan", "+nan"};
    if (a == b) return 1;
    for (size_t k = 0; k < sizeof words / sizeof *words; k++)
        if (text_is(a, b, words[k])) return 1;
    return 0;
}

/* Up to 16 hexadecimal digits. Returns 1 if [a, b) is nothing else. */
static int text_hexadecimal(const uint8_t *a, const uint8_t *b, uint64_t *value) {
    if (a == b || b - a > 16) return 0;
    for (*value = 0; a < b; a++) {
        const uint8_t low = *a | 32;
        if (text_is_digit(*a)) *value = *value << 4 | (uint64_t)(*a - '0');
        else if (low >= 'a' && low <= 'f') *value = *value << 4 | (uint64_t)(low - 'a' + 10);
        else return 0;
    }
    return 1;
}

/* [a, b) by strtod, after a check of its form: strtod accepts more. */
static int text_by_library(const uint8_t *a, const uint8_t *b, uint8_t point, double *value) {
    static locale_t plain = (locale_t)0;
    const size_t size = (size_t)(b - a);
    const uint8_t *p = a;
    size_t digits = 0;
    while (p < b && text_is_digit(*p)) p++, digits++;
    if (p < b && *p == point)
        for (p++; p < b && text_is_digit(*p); p++) digits++;
    if (digits == 0) return 0;
    if (p < b && (*p | 32) == 'e') {
        p++;
        if (p < b && (*p == '-' || *p == '+')) p++;
        if (p == b) return 0;
        while (p < b && text_is_digit(*p)) p++;
    }
    if (p != b) return 0;
    char small[256], *copy = size < sizeof small ? small : malloc(size + 1);
    if (copy == NULL) return 0;
    memcpy(copy, a, size);
    copy[size] = 0;
    char *sign = memchr(copy, point, size);
    if (sign) *sign = '.';
    locale_t mine = __atomic_load_n(&plain, __ATOMIC_ACQUIRE);
    if (mine == (locale_t)0) {
        mine = newlocale(LC_ALL_MASK, "C", (locale_t)0);
        locale_t nobody = (locale_t)0;
        if (!__atomic_compare_exchange_n(&plain, &nobody, mine, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) {
            freelocale(mine);
            mine = nobody;
        }
    }
    *value = strtod_l(copy, NULL, mine);
    if (copy != small) free(copy);
    return 1;
}

/* The number that the cell [a, b) holds; a missing one is NaN. Returns 0 if it holds none. */
static int text_number(const uint8_t *a, const uint8_t *b, uint8_t point, double *value) {
    if (text_missing(a, b)) {
        *value = NAN;
        return 1;
    }
    /* A cell ends before a delimiter, a blank, a quote or the line's end: none of them is part of a number. */
    int decimals = 0;
    if (text_plain(a, point, value, &decimals) == b) return 1;
    const int minus = *a == '-';
    a += minus || *a == '+';
    uint64_t bits;
    if (text_is(a, b, "inf") || text_is(a, b, "infinity")) *value = INFINITY;
    else if (b - a > 2 && a[0] == '0' && (a[1] | 32) == 'x' && text_hexadecimal(a + 2, b, &bits)) *value = (double)bits;
    else if (!text_by_library(a, b, point, value)) return 0;
    if (minus) *value = -*value;
    return 1;
}

/* A bare hexadecimal number, with or without 0x. */
static int text_bare_hex(const uint8_t *a, const uint8_t *b, double *value) {
    uint64_t bits;
    if (text_missing(a, b)) *value = NAN;
    else {
        if (b - a > 2 && a[0] == '0' && (a[1] | 32) == 'x') a += 2;
        if (!text_hexadecimal(a, b, &bits)) return 0;
        *value = (double)bits;
    }
    return 1;
}

/* A whole number of at most 19 digits. */
static int text_integer(const uint8_t *a, const uint8_t *b, int64_t *value) {
    if (text_missing(a, b)) {
        *value = INT64_MIN;
        return 1;
    }
    const int minus = *a == '-';
    a += minus || *a == '+';
    if (a == b || b - a > 19) return 0;
    uint64_t whole = 0;
    for (; a < b; a++) {
        if (!text_is_digit(*a)) return 0;
        whole = whole * 10 + (uint64_t)(*a - '0');
    }
    if (whole > INT64_MAX) return 0;
    *value = minus ? -(int64_t)whole : (int64_t)whole;
    return 1;
}

#endif
