/* SPDX-License-Identifier: Apache-2.0 */
/* The parts of an executive, with any times of a run, any numbers of each type, and any bits in between.
 *
 * options: -eva-split-return auto */
#include "flight/exec/assign.h"
#include "flight/exec/bounds.h"
#include "flight/exec/condition.h"
#include "flight/exec/drift.h"
#include "flight/exec/event.h"
#include "flight/exec/message.h"
#include "flight/exec/order.h"
#include "flight/exec/task.h"

static uint8_t bytes[8], row[24];

/* A number of a type, at the end of memory. */
static void number(FledgeType type)
{
    const uint32_t size = element_size(type);
    void *to = bytes + sizeof bytes - size;
    AssignNumber given;
    any_bits(&given, sizeof given);
    any_bits(bytes, sizeof bytes);
    any_bits(row, sizeof row);
    (void)element_read(type, to);
    (void)exec_measured((ExecMeasure)any_integer(EXEC_ELEMENT, EXEC_MAX_ABS), type, row + sizeof row - 3u * size, 3u);
    double x;
    any_bits(&x, sizeof x);
    element_write(type, to, x);
    if (type != FLEDGE_STRUCT) {
        given.sign = (int)any_integer(-1, 1);
        (void)assign_number(type, to, given);
        (void)assign_number(type, to, assign_whole(any_integer(INT64_MIN, INT64_MAX)));
    }
}

static void condition(FledgeType left, FledgeType right)
{
    const ExecOperand a = {
        .measure = (ExecMeasure)any_integer(EXEC_ELEMENT, EXEC_MAX_ABS), .type = left, .at = bytes, .elements = 1u};
    ExecOperand b = a;
    b.type = right;
    any_bits(bytes, sizeof bytes);
    (void)exec_compare(&a, (ExecRelation)any_integer(EXEC_LESS, EXEC_NOT_EQUAL), &b);
}

static void spans(void)
{
    /*@ loop unroll 16; */
    for (uint32_t type = 0u; type < 16u; type++) {
        (void)element_span(type, (uint32_t)any_unsigned(0u, UINT32_MAX), (uint32_t)any_unsigned(0u, UINT32_MAX),
                           (uint32_t)any_unsigned(0u, UINT32_MAX));
    }
}

/* A struct of four runs, and each part of it at whose ends numbers begin. */
static void order(void)
{
    static const ExecRun runs[] = {{8u, 1u}, {4u, 2u}, {2u, 2u}, {1u, 4u}};
    static uint8_t part[24];
    (void)exec_number_at(runs, 4u, (uint32_t)any_unsigned(0u, UINT32_MAX));
    /*@ loop unroll 30; */
    for (uint32_t from = 0u; from < 24u; from++) {
        /*@ loop unroll 30; */
        for (uint32_t to = from; to <= 24u; to++) {
            if (exec_number_at(runs, 4u, from) != 0u && (to == 24u || exec_number_at(runs, 4u, to) != 0u)) {
                any_bits(part, sizeof part);
                exec_big_endian(runs, 4u, part + 24u - (to - from), from, to);
            }
        }
    }
}

static void parameters(void)
{
    double m[3][3], x, lo, hi;
    any_bits(m, sizeof m);
    any_bits(&x, sizeof x);
    any_bits(&lo, sizeof lo);
    any_bits(&hi, sizeof hi);
    (void)exec_inertia(m);
    (void)exec_computable(x);
    (void)exec_within((uint32_t)any_unsigned(0u, 15u), lo, hi, x);
}

static void times(void)
{
    const ExecRate rate = {any_integer(1, PROVE_TIME), any_integer(0, PROVE_TIME)};
    ExecTask task = exec_start(rate, any, any_integer(0, PROVE_TIME));
    ExecEvent event = any ? exec_armed() : exec_disarmed();
    Head head;
    any_bits(&head, sizeof head);
    head.quality = (Quality)any_integer(QUALITY_NONE, QUALITY_GOOD);
    while (any) {
        const int64_t t = any_integer(0, PROVE_TIME);
        if (exec_due(&task, t)) {
            (void)exec_begin(&task, rate, t);
        }
        (void)exec_switch(&task, any, rate, t);
        (void)exec_next(&task, rate, any, t);
        (void)exec_fires(&event, any, any, any_integer(0, INT64_MAX), (int32_t)any_integer(0, INT32_MAX), any, t);
        (void)exec_takes((ExecChoice)any_integer(EXEC_SOLE, EXEC_IN_MODE), head, head, t, any_integer(0, PROVE_TIME));
        exec_age(&head, t, any_integer(0, PROVE_TIME));
    }
    /* a clock of up to 1 % that was set before */
    ExecClock clock = {.drift = (int32_t)any_integer(-10000000, 10000000), .slew = (int32_t)any_integer(0, 10000000)};
    exec_clock_set(&clock, any_integer(0, PROVE_TIME), any_integer(INT64_MIN, INT64_MAX),
                   any_integer(-PROVE_TIME, PROVE_TIME));
    (void)exec_clock_time(&clock, any_integer(0, PROVE_TIME));
}

void main(void)
{
    /*@ loop unroll 16; */
    for (uint32_t type = 0u; type <= (uint32_t)FLEDGE_STRUCT; type++) {
        number((FledgeType)type);
        condition((FledgeType)type, FLEDGE_F64);
        condition((FledgeType)type, FLEDGE_I64);
        condition(FLEDGE_U64, (FledgeType)type);
    }
    (void)exec_join(any_unsigned(0u, UINT64_MAX), (ExecJoin)any_integer(EXEC_COMPARE, EXEC_INVERSE), any);
    spans();
    order();
    parameters();
    times();
}
