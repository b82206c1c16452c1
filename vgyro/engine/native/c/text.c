/* For strtod_l. */
#define _GNU_SOURCE
#include "text.h"

#include "text_date.h"
#include "text_number.h"

/* A line while it is read: where the reader is, where the line's own bytes end (eol, or '*' before a checksum). */
typedef struct {
    const uint8_t *p;
    uint8_t delimiter, decimal, eol, end;
    int blanks;
} text_line;

VG_INLINE int text_is_blank(const text_line *line, uint8_t c) {
    return c == ' ' || c == '\r' || (c == '\t' && line->delimiter != '\t');
}

VG_INLINE void text_pass_blanks(text_line *line) {
    while (text_is_blank(line, *line->p) && *line->p != line->eol) line->p++;
}

VG_INLINE int text_at_end(const text_line *line, const uint8_t *p) { return *p == line->end || *p == line->eol; }

/* Does a cell end at p? */
VG_INLINE int text_ends(const text_line *line, const uint8_t *p) {
    return text_at_end(line, p) || (line->blanks ? text_is_blank(line, *p) : *p == line->delimiter);
}

/* End of the unquoted cell that begins at p. */
VG_INLINE const uint8_t *text_cell_end(const text_line *line, const uint8_t *p) {
    if (!line->blanks && line->end == line->eol) {
        const uint64_t delimiters = TEXT_ONES * line->delimiter, ends = TEXT_ONES * line->eol;
        for (;; p += 8) {
            const uint64_t chunk = text_load(p), a = chunk ^ delimiters, b = chunk ^ ends;
            /* The lowest marked byte is right; bytes above it may be marked by a borrow. */
            const uint64_t found = (((a - TEXT_ONES) & ~a) | ((b - TEXT_ONES) & ~b)) & (TEXT_ONES << 7);
            if (found) return p + (__builtin_ctzll(found) >> 3);
        }
    }
    while (!text_ends(line, p)) p++;
    return p;
}

/* The first cell, which `lead` ends: the reader stands before the lead. */
static int text_lead(text_line *line, const text_form *form, const uint8_t **a, const uint8_t **b) {
    *a = line->p;
    /* Byte by byte: the line's end stops it, for it is no part of the lead. */
    for (size_t k = 0; k < form->lead_size;) {
        if (line->p[k] == form->lead[k]) k++;
        else if (*line->p == line->eol) return TEXT_LEAD;
        else line->p++, k = 0;
    }
    *b = line->p;
    return 0;
}

/* A cell in quotes; a doubled quote belongs to it. */
static int text_quoted(text_line *line, const uint8_t **a, const uint8_t **b) {
    *a = ++line->p;
    for (;; line->p++) {
        if (*line->p == line->eol) return TEXT_QUOTE;
        if (*line->p == '"') {
            if (line->p[1] != '"') break;
            line->p++;
        }
    }
    *b = line->p++;
    if (!line->blanks) text_pass_blanks(line);
    return text_ends(line, line->p) ? 0 : TEXT_QUOTE;
}

/* Bounds of the next cell's value: [*a, *b), without quotes and blanks; the reader stands where the cell ends. */
static int text_bounds(text_line *line, const text_form *form, int led, const uint8_t **a, const uint8_t **b) {
    text_pass_blanks(line);
    int wrong = 0;
    if (led) {
        wrong = text_lead(line, form, a, b);
    } else if (*line->p == '"') {
        wrong = text_quoted(line, a, b);
    } else {
        *a = line->p;
        *b = line->p = text_cell_end(line, line->p);
    }
    if (wrong) return wrong;
    while (*b > *a && text_is_blank(line, (*b)[-1])) (*b)--;
    while (*b > *a && text_is_blank(line, **a)) (*a)++;
    return 0;
}

/* Take the label off the front of [*a, b). */
static int text_unlabelled(const text_line *line, const text_field *field, const uint8_t **a, const uint8_t *b) {
    if ((size_t)(b - *a) < field->label_size || memcmp(*a, field->label, field->label_size)) return TEXT_LABEL;
    *a += field->label_size;
    while (*a < b && text_is_blank(line, **a)) (*a)++;
    return 0;
}

/* Read the cell [a, b) into row `row` of the field's column. */
static int text_cell(const text_line *line, const text_field *field, const uint8_t *data, const uint8_t *a,
                     const uint8_t *b, int64_t row) {
    const uint8_t split = field->split ? line->delimiter : 0;
    int64_t *whole = (int64_t *)field->out + row;
    int good = 1;
    switch (field->kind) {
        case TEXT_NUMBER: good = text_number(a, b, line->decimal, (double *)field->out + row); break;
        case TEXT_HEX: good = text_bare_hex(a, b, (double *)field->out + row); break;
        case TEXT_INTEGER: good = text_integer(a, b, whole); break;
        case TEXT_DATE: good = text_date(a, b, field->order, split, whole); break;
        case TEXT_DAY: good = text_of_day(a, b, split, whole); break;
        case TEXT_WORDS:
            whole += row;
            whole[0] = a - data, whole[1] = b - a;
            break;
        case TEXT_LITERAL: good = a == b; break;
        default: break;
    }
    return good ? 0 : TEXT_CELL;
}

/* Any cell, with care. */
static int text_careful(text_line *line, const text_form *form, size_t k, const uint8_t *data, int64_t row) {
    const text_field *field = &form->fields[k];
    const uint8_t *a, *b;
    int wrong = text_bounds(line, form, k == 0 && form->lead_size, &a, &b);
    if (wrong) return wrong;
    if (field->split && *line->p == line->delimiter) {
        line->p = text_cell_end(line, line->p + 1);
        for (b = line->p; text_is_blank(line, b[-1]);) b--;
    }
    if (field->label_size && (wrong = text_unlabelled(line, field, &a, b))) return wrong;
    return text_cell(line, field, data, a, b, row);
}

/* A plain number at p, perhaps after a label and in quotes. Returns where its cell ends; NULL if it needs care. */
VG_INLINE const uint8_t *text_quick(const text_line *line, text_field *field, const uint8_t *p, int64_t row) {
    p += *p == ' ';
    for (size_t k = 0; k < field->label_size; k++)
        if (*p++ != field->label[k]) return NULL;
    const int quote = *p == '"';
    p = text_plain(p + quote, line->decimal, (double *)field->out + row, &field->decimals);
    if (p == NULL || (quote && *p != '"')) return NULL;
    p += quote;
    p += *p == '\r' && line->eol != '\r' && p[1] == line->eol;
    return *p == line->delimiter || *p == line->end ? p : NULL;
}

/* End of a cell that nobody wants, at p. Returns NULL if it needs care. */
VG_INLINE const uint8_t *text_skip(const text_line *line, const text_field *field, const uint8_t *p) {
    if (field->label_size || field->split || *p == '"' || text_is_blank(line, *p)) return NULL;
    return text_cell_end(line, p);
}

/* Step over what stands between two cells, at p; k: the second one. */
VG_INLINE const uint8_t *text_step(const text_line *line, const text_form *form, size_t k, const uint8_t *p) {
    if (k == 1 && form->lead_size) p += form->lead_size;
    else if (!line->blanks) return p + 1;
    if (line->blanks)
        while (text_is_blank(line, *p) && *p != line->eol) p++;
    return p;
}

/* The cells of a line, from the reader on. Returns what is wrong, and the number of the field in *at. */
VG_INLINE int text_row(text_line *line, const text_form *form, const uint8_t *data, int64_t row, int64_t *at) {
    const size_t count = form->count;
    /* A pointer of its own stays in a register. */
    const uint8_t *p = line->p;
    for (size_t k = 0; k < count; k++) {
        text_field *field = &form->fields[k];
        const uint8_t *quick = NULL;
        *at = (int64_t)k;
        line->p = p;
        if (k) {
            if (text_at_end(line, p)) return TEXT_FEW;
            p = text_step(line, form, k, p);
        }
        if (line->blanks && text_at_end(line, p)) return TEXT_FEW;
        if (k || !form->lead_size) {
            if (field->kind == TEXT_NUMBER) quick = text_quick(line, field, p, row);
            else if (field->kind == TEXT_SKIP) quick = text_skip(line, field, p);
        }
        if (quick == NULL) {
            line->p = p;
            const int wrong = text_careful(line, form, k, data, row);
            if (wrong) return wrong;
            quick = line->p;
        }
        p = quick;
    }
    /* Empty cells behind the last one do no harm. */
    for (; !text_at_end(line, p); p++)
        if (!text_is_blank(line, *p) && *p != line->delimiter) return TEXT_MANY;
    line->p = p;
    return 0;
}

/* Does the line [start, stop) end with the checksum of its bytes? */
static int text_checked(const uint8_t *start, const uint8_t *stop) {
    while (stop > start && (stop[-1] == ' ' || stop[-1] == '\t' || stop[-1] == '\r')) stop--;
    uint64_t stored;
    if (stop - start < 3 || stop[-3] != '*' || !text_hexadecimal(stop - 2, stop, &stored)) return 0;
    uint8_t sum = 0;
    for (const uint8_t *p = start + (*start == '$' || *start == '!'); p < stop - 3; p++) sum ^= *p;
    return sum == stored;
}

/* Pass the word of the table. Returns 0, or why the line is none of the table's; -1: it is of another kind. */
static int text_word(text_line *line, const text_form *form) {
    for (size_t k = 0; k < form->word_size; k++)
        if (line->p[k] != form->word[k]) goto other;
    const uint8_t *behind = line->p + form->word_size;
    if (*behind != line->delimiter && *behind != line->end && *behind != line->eol && !text_is_blank(line, *behind))
        goto other;
    line->p = behind;
    text_pass_blanks(line);
    if (!line->blanks && *line->p == line->delimiter) line->p++;
    return 0;
other:
    /* What begins like a number is the rest of a line. */
    return text_is_digit(*line->p) || *line->p == '.' || *line->p == '-' || *line->p == '+' ? TEXT_KIND : -1;
}

void vg_text_rows(const text_form *form, const uint8_t *data, size_t size, int64_t room, int64_t bad_room, text_bad *bad,
                  text_done *done) {
    text_line line = {data, form->delimiter, form->decimal, form->eol, form->checksum ? '*' : form->eol,
                      form->delimiter == ' '};
    const uint8_t *end = data + size;
    *done = (text_done){0, 0, 0, 0, 0, -1};
    while (line.p < end && done->rows < room && done->bad < bad_room) {
        const uint8_t *start = line.p;
        int64_t at = 0;
        int wrong = 0, checked = !form->checksum;
        text_pass_blanks(&line);
        if (*line.p == form->eol) {
            line.p++, done->lines++;
            continue;
        }
        if (form->word_size) wrong = text_word(&line, form);
        if (!wrong && form->checksum) {
            const uint8_t *first = start;
            while (text_is_blank(&line, *first)) first++;
            checked = text_checked(first, memchr(line.p, form->eol, (size_t)(end - line.p)));
            if (!checked) wrong = TEXT_CHECKSUM;
        }
        if (!wrong) wrong = text_row(&line, form, data, done->rows, &at);
        if (*line.p != form->eol) line.p = memchr(line.p, form->eol, (size_t)(end - line.p));
        if (wrong < 0) {
            done->other++;
        } else if (wrong) {
            bad[done->bad++] = (text_bad){start - data, line.p - start, done->lines, at, wrong};
        } else {
            if (done->first < 0) done->first = done->lines;
            done->rows++;
        }
        line.p++, done->lines++;
    }
    done->consumed = line.p - data;
}
