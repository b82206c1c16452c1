"""Binding of c/text.h: lines in, columns out, no numerics. All arrays are C-contiguous."""

from libc.stdint cimport int64_t, uint8_t
from libc.stdlib cimport free, malloc


cdef extern from "text.h":
    int TEXT_PAD, TEXT_SKIP, TEXT_NUMBER, TEXT_HEX, TEXT_INTEGER, TEXT_DATE, TEXT_DAY, TEXT_WORDS, TEXT_LITERAL
    ctypedef struct text_field:
        const uint8_t *label
        size_t label_size
        void *out
        int kind, order, split, decimals
    ctypedef struct text_form:
        text_field *fields
        size_t count
        const uint8_t *word
        const uint8_t *lead
        size_t word_size, lead_size
        uint8_t delimiter, decimal, eol
        int checksum
    ctypedef struct text_bad:
        pass
    ctypedef struct text_done:
        int64_t consumed, lines, rows, bad, other, first
    void vg_text_rows(const text_form *form, const uint8_t *data, size_t size, int64_t room, int64_t bad_room,
                      text_bad *bad, text_done *done) nogil


PAD = TEXT_PAD
KINDS = {
    "skip": TEXT_SKIP, "number": TEXT_NUMBER, "hex": TEXT_HEX, "integer": TEXT_INTEGER, "date": TEXT_DATE,
    "day": TEXT_DAY, "words": TEXT_WORDS, "literal": TEXT_LITERAL,
}


cdef class Form:
    """The form of a table's lines; keeps the bytes that it points at."""

    cdef text_form form
    cdef text_field *fields
    cdef object kept

    def __cinit__(self, list fields, bytes word, bytes lead, int delimiter, int decimal, int eol, bint checksum):
        """fields : tuples (kind, order, split, label)"""
        cdef size_t k, count = len(fields)
        cdef bytes label
        self.fields = <text_field *>malloc(max(count, 1) * sizeof(text_field))
        if self.fields == NULL:
            raise MemoryError
        self.kept = word, lead, fields
        for k in range(count):
            self.fields[k].kind, self.fields[k].order, self.fields[k].split, label = fields[k]
            self.fields[k].label, self.fields[k].label_size = label, len(label)
            self.fields[k].out, self.fields[k].decimals = NULL, 0
        self.form.fields, self.form.count = self.fields, count
        self.form.word, self.form.word_size = word, len(word)
        self.form.lead, self.form.lead_size = lead, len(lead)
        self.form.delimiter, self.form.decimal, self.form.eol = delimiter, decimal, eol
        self.form.checksum = checksum

    def __dealloc__(self):
        free(self.fields)

    def rows(self, const uint8_t[::1] data, size_t size, list outs, int64_t room, int64_t[:, ::1] bad):
        """(consumed, lines, rows, bad, other, first); outs: int64 views of the columns, None where a cell is skipped.

        data has PAD bytes more than `size`, and data[size - 1] is the end of a line; bad is [n, 5], n > 0.
        """
        cdef text_done done
        cdef size_t k
        cdef int64_t[::1] out
        for k in range(self.form.count):
            if outs[k] is not None:
                out = outs[k]
                self.fields[k].out = <void *>&out[0]
        with nogil:
            vg_text_rows(&self.form, &data[0], size, room, bad.shape[0], <text_bad *>&bad[0, 0], &done)
        return done.consumed, done.lines, done.rows, done.bad, done.other, done.first
