/* SPDX-License-Identifier: Apache-2.0 */
/* Conditions of events as data: comparisons, joined by and, or, not in postfix order. The exported C of a mission
 * writes them out as expressions (python/fledge/export/c_condition.py). */
#ifndef FLIGHT_EXEC_CONDITION_H
#define FLIGHT_EXEC_CONDITION_H

#include "flight/exec/event.h"

/** A number to compare: a constant, an element of a field, or a measure of its elements. */
typedef struct ExecOperand {
    const void *at;    ///< the first element
    uint32_t elements; ///< how many are measured
    FledgeType type;   ///< of the elements
    ExecMeasure measure;
} ExecOperand;

typedef enum ExecRelation {
    EXEC_LESS,
    EXEC_LESS_EQUAL,
    EXEC_GREATER,
    EXEC_GREATER_EQUAL,
    EXEC_EQUAL,
    EXEC_NOT_EQUAL
} ExecRelation;

/** What joins the results of the two parts before it, or changes that of the one; EXEC_COMPARE: a comparison. */
typedef enum ExecJoin { EXEC_COMPARE, EXEC_BOTH, EXEC_EITHER, EXEC_INVERSE } ExecJoin;

enum { EXEC_DEPTH = 64 }; ///< so many results may wait at most: the bits in which exec_join keeps them

static inline double exec_value(const ExecOperand *o)
{
    return exec_measured(o->measure, o->type, o->at, o->elements);
}

/** Whether a double need not represent it. */
static inline int exec_wide(const ExecOperand *o)
{
    return o->measure == EXEC_ELEMENT && (o->type == FLEDGE_I64 || o->type == FLEDGE_U64);
}

/** Its number, exactly. */
static inline ExecNumber exec_number(const ExecOperand *o)
{
    if (!exec_wide(o)) {
        return exec_real(exec_value(o));
    }
    uint64_t bits;
    memcpy(&bits, o->at, sizeof bits);
    return o->type == FLEDGE_I64 ? exec_signed((int64_t)bits) : exec_unsigned(bits);
}

static inline int exec_compare(const ExecOperand *left, ExecRelation relation, const ExecOperand *right)
{
    const int exact = exec_wide(left) || exec_wide(right);
    const double a = exact ? exec_difference(exec_number(left), exec_number(right)) : exec_value(left);
    const double b = exact ? 0.0 : exec_value(right);
    switch (relation) {
    case EXEC_LESS: return a < b;
    case EXEC_LESS_EQUAL: return a <= b;
    case EXEC_GREATER: return a > b;
    case EXEC_GREATER_EQUAL: return a >= b;
    case EXEC_EQUAL: return a == b;
    case EXEC_NOT_EQUAL: return a != b;
    }
    return 0;
}

/** The results that wait, the last in bit 0, after one more part; holds: of a comparison. Begin with 0: after the last
 *  part, bit 0 is the condition's. */
static inline uint64_t exec_join(uint64_t results, ExecJoin join, int holds)
{
    const uint64_t last = results & 1u, rest = results >> 1u;
    /* undecided: there are no others */
    switch (join) {
    case EXEC_COMPARE: return results << 1u | (uint64_t)(holds != 0);
    case EXEC_BOTH: return rest & (last | ~UINT64_C(1));
    case EXEC_EITHER: return rest | last;
    case EXEC_INVERSE: return results ^ 1u;
    }
    return 0u;
}

#endif
