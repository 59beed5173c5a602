/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/housekeeping.h"

#include "ccsds/bytes.h"
#include "flight/exec/order.h"

#include <string.h>

enum {
    REPORT = 8,
    CHECK = 10,
    LEFT_OUT = 12,
    BYTES = 14,
    NUMBERS = 16
}; /* [bytes] places in the content of a packet */

/* How many choices count, also where memory was damaged. */
static uint32_t count_of(const HousekeepingReport *report)
{
    return report->n < HOUSEKEEPING_CHOICES ? report->n : HOUSEKEEPING_CHOICES;
}

/* Write the numbers of a choice, big-endian. Returns their bytes; 0: it names none, or has more than `room`. */
static uint32_t write_numbers(const CommandContext *context, const HousekeepingChoice *choice, uint8_t *to,
                              uint32_t room)
{
    uint32_t size = 0u;
    const uint8_t *output = choice->output < context->table->n_outputs
                                ? context->table->services->output(context->mission, choice->output, &size)
                                : NULL;
    const uint32_t n = element_span(choice->type, choice->offset, choice->n, size);
    if (n == 0u || n > room) {
        return 0u;
    }
    const ExecRun run = {n / choice->n, choice->n};
    memcpy(to, output + choice->offset, n);
    exec_big_endian(&run, 1u, to, 0u, n);
    return n;
}

static uint16_t crc_of(const HousekeepingReport *report)
{
    uint8_t bytes[HOUSEKEEPING_CHOICES * sizeof(HousekeepingChoice)];
    for (uint32_t i = 0u; i < count_of(report); i++) {
        const HousekeepingChoice *choice = &report->choices[i];
        uint8_t *row = bytes + i * sizeof *choice;
        ccsds_put16(row, choice->output);
        ccsds_put16(row + 2, choice->offset);
        ccsds_put16(row + 4, choice->type);
        ccsds_put16(row + 6, choice->n);
    }
    return ccsds_crc16(bytes, count_of(report) * (uint32_t)sizeof(HousekeepingChoice));
}

static uint32_t telemetry(const CommandContext *context, void *module, uint8_t *content)
{
    Housekeeping *m = module;
    uint32_t place = 0u, at = NUMBERS, left_out = 0u;
    while (place < HOUSEKEEPING_REPORTS && (m->mem.due >> place & 1u) == 0u) {
        place++;
    }
    if (place == HOUSEKEEPING_REPORTS) {
        return 0u;
    }
    const HousekeepingReport *report = &m->par.reports[place];
    for (uint32_t i = 0u; i < count_of(report); i++) {
        const uint32_t n = write_numbers(context, &report->choices[i], content + at, (uint32_t)COMMAND_DATA_MAX - at);
        left_out |= (n == 0u ? 1u : 0u) << i;
        at += n;
    }
    ccsds_put64(content, (uint64_t)context->t);
    ccsds_put16(content + REPORT, place);
    ccsds_put16(content + CHECK, crc_of(report));
    ccsds_put16(content + LEFT_OUT, left_out);
    ccsds_put16(content + BYTES, at - (uint32_t)NUMBERS);
    m->mem.due &= ~(1u << place);
    m->mem.bad = (m->mem.bad & ~(1u << place)) | (left_out != 0u ? 1u : 0u) << place;
    m->mem.sent++;
    return at;
}

const CommandService housekeeping_service = {.telemetry = telemetry, .stream = STREAM_SELECTED};

/* ---- the module */

void housekeeping_reset(Housekeeping *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void housekeeping_update(Housekeeping *m, Tick t)
{
    HousekeepingState *s = &m->out.state;
    for (uint32_t i = 0u; i < HOUSEKEEPING_REPORTS; i++) {
        const HousekeepingReport *report = &m->par.reports[i];
        const uint32_t bit = 1u << i, was = m->mem.on & bit;
        const int64_t turn = report->period > 0 ? t.t / report->period : t.t;
        m->mem.on = report->on != 0u ? m->mem.on | bit : m->mem.on & ~bit;
        if ((m->mem.on & bit) == 0u) {
            m->mem.bad &= ~bit;
        } else if (was == 0u || turn != m->mem.turn[i]) {
            m->mem.due |= bit;
        }
        m->mem.turn[i] = turn;
    }
    s->on = m->mem.on;
    s->bad = m->mem.bad;
    s->sent = m->mem.sent;
    s->head = head_next(s->head, t.t, m->mem.bad != 0u ? QUALITY_DEGRADED : QUALITY_GOOD);
}
