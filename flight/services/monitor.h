/* SPDX-License-Identifier: Apache-2.0 */
/* A check of a number of an output, with persistence: that of monitors and of rules of the fault protection. */
#ifndef FLIGHT_SERVICES_MONITOR_H
#define FLIGHT_SERVICES_MONITOR_H

#include "ccsds/bytes.h"
#include "flight/command/command.h"
#include "flight/exec/event.h"
#include "flight/msg/head.h"

#include <string.h>

/** What a monitor checks. */
typedef enum MonitorKind {
    MONITOR_NOTHING = 0,
    MONITOR_LIMITS = 1,   ///< the number is in [low, high]
    MONITOR_DELTA = 2,    ///< its change from writing to writing is
    MONITOR_EXPECTED = 3, ///< it equals low
    MONITOR_BITS = 4      ///< of a whole number of up to 32 bits none of `bits` is set
} MonitorKind;

/** A check of a number of an output. */
typedef struct Monitor {
    double low;       ///< [SI] of what is right
    double high;      ///< [SI] of what is right
    int64_t hold;     ///< [ns] >= 0: it is wrong for so long,
    uint32_t count;   ///< [-] and at so many successive instants, before the monitor fires
    MonitorKind kind; ///< [-] what is checked
    uint32_t on;      ///< [-] in [0, 1]: 1: it is
    uint32_t output;  ///< [-] place in the dictionary
    uint32_t offset;  ///< [-] bytes from the output's beginning
    uint32_t type;    ///< [-] in [0, 11]: FledgeType of the number
    uint32_t n;       ///< [-] numbers in a row that are measured
    uint32_t measure; ///< [-] in [0, 2]: ExecMeasure: the number, the norm, the largest magnitude
    uint32_t list;    ///< [-] in [0, 15]: the sequence of stored commands that it starts; 0: none
    uint32_t bits;    ///< [-] a mask: bit i is that of 2^i
} Monitor;

/** What a monitor remembers. */
typedef struct MonitorMemory {
    ExecEvent event;
    double last;       ///< [SI] the number of the last writing
    uint32_t sequence; ///< [-] of it; 0: none yet
    uint32_t wrong;    ///< [-] 1: what it checked last
} MonitorMemory;

/** What a look has found. */
typedef enum MonitorFinding {
    MONITOR_SAME,  ///< nothing new
    MONITOR_FIRES, ///< the check stayed wrong for long enough
    MONITOR_ENDS,  ///< the check of one that had fired is right again
    MONITOR_BAD    ///< it names no number of an output
} MonitorFinding;

/** One that has seen nothing yet. */
static inline MonitorMemory monitor_new(void)
{
    return (MonitorMemory){exec_armed(), 0.0, 0u, 0u};
}

/** Whether the numbers are wrong. NaN is. */
static inline int monitor_wrong(const Monitor *monitor, MonitorMemory *memory, const void *numbers)
{
    const double value = exec_measured((ExecMeasure)monitor->measure, (FledgeType)monitor->type, numbers, monitor->n);
    const double change = value - memory->last;
    const int first = memory->sequence == 0u;
    memory->last = value;
    switch (monitor->kind) {
    case MONITOR_LIMITS: return !(value >= monitor->low && value <= monitor->high);
    case MONITOR_DELTA: return first ? 0 : !(change >= monitor->low && change <= monitor->high);
    case MONITOR_EXPECTED: return !(value >= monitor->low && value <= monitor->low);
    case MONITOR_BITS: return ((uint32_t)(int64_t)value & monitor->bits) != 0u;
    default: return 0;
    }
}

/** Evaluate a monitor on the output of the last instant. A monitor that is off forgets. */
static inline MonitorFinding monitor_evaluate(const Monitor *monitor, MonitorMemory *memory,
                                              const CommandContext *context)
{
    if (monitor->on == 0u || monitor->kind == MONITOR_NOTHING) {
        *memory = monitor_new();
        return MONITOR_SAME;
    }
    uint32_t size = 0u;
    const void *output = monitor->output < context->table->n_outputs
                             ? context->table->services->output(context->mission, (uint16_t)monitor->output, &size)
                             : NULL;
    const int whole = monitor->type >= (uint32_t)FLEDGE_I8 && monitor->type <= (uint32_t)FLEDGE_U32;
    if (element_span(monitor->type, monitor->offset, monitor->n, size) == 0u ||
        (monitor->kind == MONITOR_BITS && (!whole || monitor->measure != (uint32_t)EXEC_ELEMENT))) {
        return MONITOR_BAD;
    }
    Head head;
    memcpy(&head, output, sizeof head);
    /* The quality in a head may change without a writing, so limits look at each instant. */
    if (head_written(head) && (head.sequence != memory->sequence || monitor->kind != MONITOR_DELTA)) {
        memory->wrong = (uint32_t)monitor_wrong(monitor, memory, (const uint8_t *)output + monitor->offset);
        memory->sequence = head.sequence;
    }
    const int was = memory->event.armed < 0, wrong = memory->wrong != 0u;
    if (exec_fires(&memory->event, wrong, !wrong, monitor->hold, (int32_t)monitor->count, 0, context->t)) {
        return MONITOR_FIRES;
    }
    return was && memory->event.armed > 0 ? MONITOR_ENDS : MONITOR_SAME;
}

/** Write a command of a service's own, with n arguments of 16 bits. Returns its length. */
static inline uint32_t monitor_command(const CommandTable *table, CommandCode code, const uint16_t *arguments,
                                       uint32_t n, uint32_t sequence, uint8_t *packet)
{
    const uint32_t size = (uint32_t)COMMAND_HEADER + 2u + 2u * n;
    uint8_t sum = 0xFFu;
    ccsds_put16(packet, table->stream);
    ccsds_put16(packet + 2, 0xC000u | (sequence & 0x3FFFu));
    ccsds_put16(packet + 4, size - 7u);
    packet[6] = (uint8_t)code;
    packet[7] = 0u;
    ccsds_put16(packet + COMMAND_HEADER, table->version);
    for (uint32_t i = 0u; i < n; i++) {
        ccsds_put16(packet + COMMAND_HEADER + 2u + 2u * i, arguments[i]);
    }
    for (uint32_t i = 0u; i < size; i++) {
        sum ^= packet[i];
    }
    packet[7] = sum;
    return size;
}

/** One that starts a sequence of stored commands. */
static inline uint32_t monitor_start(const CommandTable *table, uint32_t list, uint32_t sequence, uint8_t *packet)
{
    const uint16_t arguments[] = {(uint16_t)list, LIST_START, 0u};
    return monitor_command(table, COMMAND_CONTROL, arguments, 3u, sequence, packet);
}

#endif
