/* SPDX-License-Identifier: Apache-2.0 */
/* What a program may assign to a field of a header: numbers that the field's type holds, in a shape that it takes. The
 * objects of the desktop (python/fledge/core/store.cpp) and those of a script on a target
 * (targets/micropython/assign.c) bring their values into this form. */
#ifndef FLIGHT_EXEC_ASSIGN_H
#define FLIGHT_EXEC_ASSIGN_H

#include "flight/exec/element.h"

#include <stddef.h>

enum { ASSIGN_DIMENSIONS = 4 };

typedef struct AssignField {
    FledgeType type;
    uint32_t size;         ///< [bytes]
    uint32_t n_dimensions; ///< 0: no array
    uint32_t shape[ASSIGN_DIMENSIONS];
    const char *count;   ///< the name of the field that says how many leading rows count; NULL: all
    const char *unit;    ///< "" or "-": none
    const char *struct_; ///< of a FLEDGE_STRUCT, the name of its type
} AssignField;

/* --- numbers --------------------------------------------------------------------------------------- */

/** A number as it is given. */
typedef struct AssignNumber {
    double real;    ///< the number, or the double nearest to it
    uint64_t whole; ///< the magnitude of a whole number
    int sign;       ///< of a whole number -1 or 1; 0: `real` is the number
} AssignNumber;

static inline AssignNumber assign_real(double x)
{
    return (AssignNumber){x, 0u, 0};
}

static inline AssignNumber assign_whole(int64_t x)
{
    return (AssignNumber){(double)x, x < 0 ? 0u - (uint64_t)x : (uint64_t)x, x < 0 ? -1 : 1};
}

static inline int assign_is_float(FledgeType type)
{
    return type == FLEDGE_F64 || type == FLEDGE_F32;
}

static inline int assign_has_sign(FledgeType type)
{
    return type == FLEDGE_I8 || type == FLEDGE_I16 || type == FLEDGE_I32 || type == FLEDGE_I64 || type == FLEDGE_ENUM;
}

/** The highest whole number of a type; the lowest is 0, or -1 less of this. */
static inline uint64_t assign_highest(FledgeType type)
{
    return UINT64_MAX >> (64u - 8u * element_size(type) + (assign_has_sign(type) ? 1u : 0u));
}

/** Write a number as one of that type. Returns 0 if the type does not hold it. */
static inline int assign_number(FledgeType type, void *to, AssignNumber x)
{
    if (assign_is_float(type)) {
        element_write(type, to, x.real);
        return 1;
    }
    if (x.sign == 0) {
        const double size = x.real < 0.0 ? -x.real : x.real;
        /* open: NaN is not below 2^64, so it is not converted, which the analyser does not see */
        if (!(size < 18446744073709551616.0) || (double)(uint64_t)size != size) {
            return 0;
        }
        x.whole = (uint64_t)size;
        x.sign = x.real < 0.0 ? -1 : 1;
    }
    const uint64_t highest = assign_highest(type);
    if (x.whole > (x.sign > 0 ? highest : assign_has_sign(type) ? highest + 1u : 0u)) {
        return 0;
    }
    if (element_size(type) < 8u) {
        element_write(type, to, x.sign > 0 ? (double)x.whole : -(double)x.whole);
    } else {
        const uint64_t bits = x.sign > 0 ? x.whole : 0u - x.whole;
        memcpy(to, &bits, sizeof bits);
    }
    return 1;
}

/* --- shapes ---------------------------------------------------------------------------------------- */

/** How a field takes the numbers that are given: the i-th becomes its element i * step. */
typedef struct AssignSpread {
    uint32_t step;
    uint32_t copies; ///< so many elements get the first number; 1: each has its own
    uint32_t rows;   ///< that count then, of a field with a count
} AssignSpread;

typedef enum AssignFit {
    ASSIGN_FITS,
    ASSIGN_WRONG_SHAPE,
    ASSIGN_NO_ROWS ///< one number for all rows that count, of which there are none yet
} AssignFit;

/** shape, depth: of what is given; depth 0: one number. rows: of the field, that count now. */
static inline AssignFit assign_spread(const AssignField *field, const size_t *shape, uint32_t depth, uint32_t rows,
                                      AssignSpread *spread)
{
    int same = depth == field->n_dimensions; /* but for the first dimension */
    for (uint32_t i = 1u; same && i < depth; i++) {
        same = shape[i] == field->shape[i];
    }
    *spread = (AssignSpread){1u, 1u, 1u};
    if (field->count != NULL) {
        if (depth == 0u && field->n_dimensions == 1u) {
            spread->rows = spread->copies = rows;
            return rows > 0u ? ASSIGN_FITS : ASSIGN_NO_ROWS;
        }
        if (same && shape[0] > 0u && shape[0] <= field->shape[0]) {
            spread->rows = (uint32_t)shape[0];
            return ASSIGN_FITS;
        }
        return ASSIGN_WRONG_SHAPE;
    }
    if (same && (depth == 0u || shape[0] == field->shape[0])) {
        return ASSIGN_FITS;
    }
    if (field->n_dimensions != 2u || field->shape[0] != field->shape[1] || depth > 1u ||
        (depth == 1u && shape[0] != field->shape[0])) {
        return ASSIGN_WRONG_SHAPE;
    }
    spread->step = field->shape[0] + 1u; /* along the diagonal */
    spread->copies = depth == 1u ? 1u : field->shape[0];
    return ASSIGN_FITS;
}

/* --- words ----------------------------------------------------------------------------------------- */

/** Where a text goes, piece by piece. */
typedef struct AssignText {
    void *to;
    void (*put)(void *to, const char *text, size_t n);
} AssignText;

static inline void assign_put(AssignText text, const char *words)
{
    text.put(text.to, words, strlen(words));
}

static inline void assign_put_whole(AssignText text, uint64_t x)
{
    char digits[20];
    size_t i = sizeof digits;
    do {
        digits[--i] = (char)('0' + (int)(x % 10u));
        x /= 10u;
    } while (x > 0u);
    text.put(text.to, &digits[i], sizeof digits - i);
}

/** What a field takes, for an error that goes on with "; found": "shape (3, 3), or 3 numbers for the diagonal, or one
 *  for a multiple of the identity, in kg m^2". Of an enumeration, only the shape. */
static inline void assign_expected(AssignText text, const AssignField *field)
{
    const FledgeType type = field->type;
    if (type == FLEDGE_CHAR) {
        assign_put(text, "a text of up to ");
        assign_put_whole(text, field->size - 1u);
        assign_put(text, " bytes");
        return;
    }
    if (type == FLEDGE_STRUCT) {
        if (field->n_dimensions > 0u) {
            assign_put(text, field->count != NULL ? "a list of up to " : "a list of ");
            assign_put_whole(text, field->shape[0]);
            assign_put(text, ", each a ");
        }
        assign_put(text, field->struct_);
        assign_put(text, " or dict of its fields");
        return;
    }
    for (uint32_t i = 0u; i < field->n_dimensions; i++) {
        assign_put(text, i > 0u ? ", " : "shape (");
        if (i == 0u && field->count != NULL) {
            assign_put(text, field->count);
            assign_put(text, " <= ");
        }
        assign_put_whole(text, field->shape[i]);
        assign_put(text, i + 1u == field->n_dimensions ? ")" : "");
    }
    if (assign_is_float(type)) {
        assign_put(text, field->n_dimensions > 0u ? "" : "a number");
    } else if (type != FLEDGE_ENUM) {
        assign_put(text, field->n_dimensions > 0u ? " of whole numbers from " : "a whole number from ");
        assign_put(text, assign_has_sign(type) ? "-" : "");
        assign_put_whole(text, assign_has_sign(type) ? assign_highest(type) + 1u : 0u);
        assign_put(text, " to ");
        assign_put_whole(text, assign_highest(type));
    }
    if (field->n_dimensions == 1u && field->count != NULL) {
        assign_put(text, ", or one number for all");
    } else if (field->n_dimensions == 2u && field->count == NULL && field->shape[0] == field->shape[1]) {
        assign_put(text, ", or ");
        assign_put_whole(text, field->shape[0]);
        assign_put(text, " numbers for the diagonal, or one for a multiple of the identity");
    }
    if (field->unit[0] != '\0' && strcmp(field->unit, "-") != 0) {
        assign_put(text, ", in ");
        assign_put(text, field->unit);
    }
}

#endif
