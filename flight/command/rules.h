/* SPDX-License-Identifier: Apache-2.0 */
/* Checks parameters by the rules of their headers but `required`: those that a program sets on the desktop
 * (sim/check.cpp), and on a target those that come from outside, by commands and tables. */
#ifndef FLIGHT_COMMAND_RULES_H
#define FLIGHT_COMMAND_RULES_H

#include "flight/exec/bounds.h"
#include "flight/exec/element.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    COMMAND_NON_ZERO = 1 << 4, ///< no number is 0, or, if `row` is 3, no vector
    COMMAND_INERTIA = 1 << 5,  ///< of each nine numbers: they are the inertia of a body
    COMMAND_START = 1 << 6     ///< an initial value: flight's first instant has used it up
};

#define COMMAND_ALL_ROWS UINT32_MAX

/** The rule of a field. All numbers must also be computable (exec_computable). */
typedef struct CommandRule {
    const char *name;
    const char *text; ///< "0 or of size 1e-100 to 1e100, > 0 N m"
    uint32_t offset;  ///< [bytes] in the block
    uint32_t n;       ///< numbers
    uint32_t row;     ///< numbers in each row
    uint32_t rows_at; ///< [bytes] the offset of a uint32_t, the number of rows to check; COMMAND_ALL_ROWS: all rows
    uint32_t flags;   ///< FLEDGE_HAS_LO ... and COMMAND_...
    FledgeType number;
    double low;
    double high;
} CommandRule;

/** The first rule that a block breaks, and the index of the number that breaks it; NULL: the block keeps all rules. */
const CommandRule *command_check(const CommandRule *rules, uint32_t n, const void *block, uint32_t *element);

#ifdef __cplusplus
}
#endif

#endif
