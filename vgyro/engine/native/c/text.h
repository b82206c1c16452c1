/* Lines of a text log: rows of cells, numbers and stamps straight into columns. */
#ifndef TEXT_H
#define TEXT_H

#include <stddef.h>
#include <stdint.h>

/* Bytes that must be readable after the last line: cells are read eight at a time. */
enum { TEXT_PAD = 64 };

/* What becomes of a cell. TEXT_LITERAL: nothing, but it must hold the label and nothing else. */
enum { TEXT_SKIP = 0, TEXT_NUMBER, TEXT_HEX, TEXT_INTEGER, TEXT_DATE, TEXT_DAY, TEXT_WORDS, TEXT_LITERAL };
/* Order of the parts of a date. */
enum { TEXT_YMD = 0, TEXT_DMY, TEXT_MDY };
/* Why a line does not fit. TEXT_KIND: it begins neither with the table's word nor with another one. */
enum { TEXT_CELL = 1, TEXT_FEW, TEXT_MANY, TEXT_QUOTE, TEXT_LABEL, TEXT_LEAD, TEXT_CHECKSUM, TEXT_KIND };

/* The missing value of an integer or a stamp. */
#define TEXT_NULL INT64_MIN

/* label : what stands before the value in the cell, such as "gx:"
   split : of a date: its fraction of a second is in the next cell, for the delimiter is its decimal sign, too
   out   : double [room] of numbers, int64 [room] of integers (null: TEXT_NULL) and of stamps (ns),
           int64 [room][2] of words: offset and size
   decimals : the reader's own: how many the last number had, 0 at first */
typedef struct {
    const uint8_t *label;
    size_t label_size;
    void *out;
    int kind, order, split, decimals;
} text_field;

/* word      : with which the lines of the table begin; other lines that begin with a letter or a sign are not its own
   lead      : what ends the first cell instead of the delimiter, such as " -> "
   delimiter : ' ' stands for any blanks;  eol : '\n', or '\r' where there is no other
   checksum  : lines end with '*' and the XOR of all bytes between '$' and it, two hexadecimal digits */
typedef struct {
    text_field *fields;
    size_t count;
    const uint8_t *word, *lead;
    size_t word_size, lead_size;
    uint8_t delimiter, decimal, eol;
    int checksum;
} text_form;

/* A line that does not fit: where it begins, bytes without its end, line from 0, field from 0, why. */
typedef struct {
    int64_t at, size, line, field, why;
} text_bad;

/* consumed, lines : bytes and lines done;  first : line of the first row, -1 if there is none
   rows, bad       : that were found;  other : lines of other kinds */
typedef struct {
    int64_t consumed, lines, rows, bad, other, first;
} text_done;

/* Rows of data[0..size), which ends with eol and is followed by TEXT_PAD readable bytes. Stops where there is no room
   for another row or another bad line. Empty lines are passed over. */
void vg_text_rows(const text_form *form, const uint8_t *data, size_t size, int64_t room, int64_t bad_room, text_bad *bad,
                  text_done *done);

#endif
