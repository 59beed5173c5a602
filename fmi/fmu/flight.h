/* SPDX-License-Identifier: Apache-2.0 */
/* What the systems of flight software have in common: an exported mission, flight on the emulated computer, and flight
 * in a simulation. */
#ifndef FMI_FMU_FLIGHT_H
#define FMI_FMU_FLIGHT_H

#include "flight/command/command.h"
#include "flight/command/rules.h"
#include "fmi/fmu/system.h"

#include <stdio.h>

/** Whether the parameters at `from` keep the rules of their block; else the log has the number that does not. */
static inline int flight_keeps_rules(const FmuHost *host, const CommandBlock *block, const char *path,
                                     const uint8_t *from)
{
    uint32_t element = 0u;
    const CommandRule *rule = command_check(block->rules, block->n_rules, from, &element);
    char index[16] = "";
    char text[512];
    if (rule == NULL) {
        return 1;
    }
    if (rule->n > 1u) {
        (void)snprintf(index, sizeof index, "[%lu]", (unsigned long)element + 1u);
    }
    (void)snprintf(text, sizeof text, "%s.%s%s must be %s; found %.17g", path, rule->name, index, rule->text,
                   element_read(rule->number, from + rule->offset + (size_t)element * element_size(rule->number)));
    host->log(host->user, FMU_ERROR, "errors", text);
    return 0;
}

/** Whether a mode may be entered now; else the log has why. */
static inline int flight_may_enter(const FmuHost *host, const CommandTable *commands, void *mission, uint16_t mode,
                                   const char *name)
{
    char text[160];
    if (commands->may_enter == NULL || commands->may_enter(mission, mode)) {
        return 1;
    }
    (void)snprintf(text, sizeof text, "the condition of the mode %.100s does not hold", name);
    host->log(host->user, FMU_WARNING, "modes", text);
    return 0;
}

/** [bytes] The size of the unit with which n bytes to flight begin: a space packet, or all of them where flight speaks
 *  frames. */
static inline size_t flight_unit_size(const uint8_t *bytes, size_t n, int framed)
{
    const size_t size = framed || n < 7u ? n : 7u + ((size_t)bytes[4] << 8u) + bytes[5];
    return size < n ? size : n;
}

#endif
