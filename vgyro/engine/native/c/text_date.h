/* Dates and times of day in text: nanoseconds. */
#ifndef TEXT_DATE_H
#define TEXT_DATE_H

#include "text.h"
#include "text_number.h"

#define TEXT_SECOND 1000000000ll

/* Up to `most` digits at *p, at least `least`; -1 if they are not there. Moves *p behind them. */
VG_INLINE int text_part(const uint8_t **p, const uint8_t *end, int least, int most) {
    int value = 0, count = 0;
    while (count < most && *p < end && text_is_digit(**p)) value = value * 10 + (*(*p)++ - '0'), count++;
    return count < least ? -1 : value;
}

/* Days since 1970 of a day of the Gregorian calendar, proleptic; after Howard Hinnant's days_from_civil. */
VG_INLINE int64_t text_days(int64_t year, int month, int day) {
    year -= month <= 2;
    const int64_t era = (year >= 0 ? year : year - 399) / 400, of_era = year - era * 400;
    const int64_t of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
    return era * 146097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719468;
}

static int text_month(const uint8_t **p, const uint8_t *end) {
    static const char names[] = "janfebmaraprmayjunjulaugsepoctnovdec";
    if (end - *p < 3) return -1;
    for (int month = 0; month < 12; month++) {
        const char *name = names + 3 * month;
        if (((*p)[0] | 32) == name[0] && ((*p)[1] | 32) == name[1] && ((*p)[2] | 32) == name[2]) {
            *p += 3;
            return month + 1;
        }
    }
    return -1;
}

VG_INLINE void text_blanks(const uint8_t **p, const uint8_t *end) {
    while (*p < end && (**p == ' ' || **p == '\t')) (*p)++;
}

/* Days since 1970 of the date at *p. Returns 0 if there is none. */
static int text_day(const uint8_t **p, const uint8_t *end, int order, int64_t *days) {
    static const int lengths[] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    const uint8_t *start = *p;
    int year, month, day;
    if (order == TEXT_YMD) {
        if ((year = text_part(p, end, 4, 4)) < 0 || *p == end) return 0;
        const uint8_t sign = **p;
        if (text_is_digit(sign)) {
            month = text_part(p, end, 2, 2);
            day = text_part(p, end, 2, 2);
        } else {
            if (sign != '-' && sign != '/' && sign != '.') return 0;
            (*p)++;
            if ((month = text_part(p, end, 1, 2)) < 0 || *p == end || *(*p)++ != sign) return 0;
            day = text_part(p, end, 1, 2);
        }
    } else {
        day = text_part(p, end, 1, 2);
        if (day < 0 || *p == end) return 0;
        const uint8_t sign = *(*p)++;
        const int named = *p < end && !text_is_digit(**p);
        if (sign != '-' && sign != '/' && sign != '.' && !(named && sign == ' ')) return 0;
        month = named ? text_month(p, end) : text_part(p, end, 1, 2);
        if (month < 0 || *p == end || *(*p)++ != sign) return 0;
        start = *p;
        year = text_part(p, end, 2, 4);
        if (year < 0 || *p - start == 3) return 0;
        if (*p - start == 2) year += year < 70 ? 2000 : 1900;
        if (order == TEXT_MDY && !named) {
            const int swapped = day;
            day = month, month = swapped;
        }
    }
    if (year < 1 || month < 1 || month > 12 || day < 1 || day > lengths[month - 1]) return 0;
    if (month == 2 && day == 29 && !(year % 4 == 0 && (year % 100 != 0 || year % 400 == 0))) return 0;
    *days = text_days(year, month, day);
    return 1;
}

/* Nanoseconds of the fraction at *p, behind its sign; what is beyond them must be zeros. Returns 0 if it is not. */
static int text_fraction(const uint8_t **p, const uint8_t *end, int64_t *ns) {
    int64_t value = 0;
    int count = 0;
    for (; *p < end && text_is_digit(**p); (*p)++, count++) {
        if (count < 9) value = value * 10 + (**p - '0');
        else if (**p != '0') return 0;
    }
    if (count == 0) return 0;
    for (; count < 9; count++) value *= 10;
    *ns = value;
    return 1;
}

/* Nanoseconds since midnight of the time at *p. split : a fraction may stand behind that sign, too. */
static int text_time(const uint8_t **p, const uint8_t *end, int needs_seconds, uint8_t split, int64_t *ns) {
    int64_t fraction = 0;
    int hour, minute, second = 0, has_seconds = 1;
    const uint8_t *start = *p;
    hour = text_part(p, end, 1, 2);
    if (*p < end && *p - start == 2 && text_is_digit(**p)) {
        minute = text_part(p, end, 2, 2);
        second = text_part(p, end, 2, 2);
    } else {
        if (hour < 0 || *p == end || *(*p)++ != ':') return 0;
        minute = text_part(p, end, 2, 2);
        has_seconds = *p < end && **p == ':';
        if (has_seconds) {
            (*p)++;
            second = text_part(p, end, 2, 2);
        }
    }
    if (minute < 0 || second < 0 || (needs_seconds && !has_seconds)) return 0;
    if (has_seconds && *p < end && (**p == '.' || **p == ',' || (split && **p == split))) {
        (*p)++;
        if (!text_fraction(p, end, &fraction)) return 0;
    }
    const uint8_t *before = *p;
    text_blanks(p, end);
    if (end - *p >= 2 && ((*p)[1] | 32) == 'm' && (((*p)[0] | 32) == 'a' || ((*p)[0] | 32) == 'p')) {
        if (hour < 1 || hour > 12) return 0;
        hour = hour % 12 + (((*p)[0] | 32) == 'p' ? 12 : 0);
        *p += 2;
    } else {
        *p = before;
    }
    if (hour > 23 || minute > 59 || second > 60) return 0;
    *ns = (hour * 3600ll + minute * 60ll + second) * TEXT_SECOND + fraction;
    return 1;
}

/* Nanoseconds that the zone at *p is ahead of UTC; 0 where nothing stands. */
static int text_zone(const uint8_t **p, const uint8_t *end, int64_t *ahead) {
    *ahead = 0;
    text_blanks(p, end);
    if (*p == end) return 1;
    if (text_is(*p, end, "z") || text_is(*p, end, "utc") || text_is(*p, end, "gmt")) {
        *p = end;
        return 1;
    }
    const int minus = **p == '-';
    if (!minus && **p != '+') return 0;
    (*p)++;
    const int hours = text_part(p, end, 2, 2);
    if (hours < 0 || hours > 23) return 0;
    int minutes = 0;
    if (*p < end) {
        if (**p == ':') (*p)++;
        minutes = text_part(p, end, 2, 2);
        if (minutes < 0 || minutes > 59) return 0;
    }
    *ahead = (hours * 3600ll + minutes * 60ll) * TEXT_SECOND * (minus ? -1 : 1);
    return *p == end;
}

/* Date, or date and time, in [a, b): ns since 1970, UTC where a zone stands. */
static int text_date(const uint8_t *a, const uint8_t *b, int order, uint8_t split, int64_t *value) {
    if (text_missing(a, b)) {
        *value = TEXT_NULL;
        return 1;
    }
    int64_t days, time = 0, ahead = 0, total;
    const uint8_t *p = a;
    if (!text_day(&p, b, order, &days)) return 0;
    if (p < b) {
        if ((*p | 32) == 't' || *p == '_') p++;
        else if (*p == ' ' || *p == '\t') text_blanks(&p, b);
        else return 0;
        if (!text_time(&p, b, 0, split, &time) || !text_zone(&p, b, &ahead)) return 0;
    }
    /* Within 1677 … 2262: the ends of int64 are half a day away from a whole one. */
    if (__builtin_mul_overflow(days, 86400 * TEXT_SECOND, &total) || __builtin_add_overflow(total, time - ahead, &total))
        return 0;
    *value = total;
    return total != TEXT_NULL;
}

/* Time of day in [a, b): ns since midnight. */
static int text_of_day(const uint8_t *a, const uint8_t *b, uint8_t split, int64_t *value) {
    if (text_missing(a, b)) {
        *value = TEXT_NULL;
        return 1;
    }
    const uint8_t *p = a;
    return text_time(&p, b, 1, split, value) && p == b;
}

#endif
