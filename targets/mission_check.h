/* SPDX-License-Identifier: Apache-2.0 */
/* Checks parameters from outside, such as tables, by the rules of their headers. The rules are those of sim/check.cpp
 * without `required`. */
#ifndef TARGETS_MISSION_CHECK_H
#define TARGETS_MISSION_CHECK_H

#include "flight/exec/bounds.h"
#include "flight/exec/element.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    MISSION_NON_ZERO = 1 << 4, ///< no number is 0, or, if `row` is 3, no vector
    MISSION_INERTIA = 1 << 5   ///< nine numbers: the inertia of a body
};

#define MISSION_ALL UINT32_MAX

/** The rule of a field. All numbers must also be computable (exec_computable). */
typedef struct MissionRule {
    const char *name;
    const char *text; ///< "0 or of size 1e-100 to 1e100, > 0 N m"
    uint32_t offset;  ///< [bytes] in the block
    uint32_t n;       ///< numbers
    uint32_t row;     ///< numbers in each row
    uint32_t rows_at; ///< [bytes] the offset of a uint32_t, the number of rows to check; MISSION_ALL: all rows
    uint32_t flags;   ///< FLEDGE_HAS_LO ... and MISSION_...
    FledgeType number;
    double low;
    double high;
} MissionRule;

/** The first rule that a block breaks, and the index of the number that breaks it; NULL: the block keeps all rules. */
const MissionRule *mission_check(const MissionRule *rules, uint32_t n, const void *block, uint32_t *element);

#ifdef __cplusplus
}
#endif

#endif
