/* SPDX-License-Identifier: Apache-2.0 */
/* Checks parameters that come from outside, as tables do, against the rules of their headers. The rules
 * are those of sim/check.cpp without `required`: a parameter that comes from outside was given. */
#ifndef TARGETS_MISSION_CHECK_H
#define TARGETS_MISSION_CHECK_H

#include "flight/exec/bounds.h"
#include "flight/exec/element.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    MISSION_NON_ZERO = 1 << 4, ///< no number is 0, or with `row` 3 no vector
    MISSION_INERTIA = 1 << 5   ///< nine numbers: the inertia of a body
};

#define MISSION_ALL UINT32_MAX

/** What must hold of a field, besides that its numbers are finite. */
typedef struct MissionRule {
    const char *name;
    const char *text; ///< "finite, > 0 N m"
    uint32_t offset;  ///< [bytes] in the block
    uint32_t n;       ///< numbers
    uint32_t row;     ///< numbers in each row
    uint32_t rows_at; ///< [bytes] where a uint32_t says how many rows count; MISSION_ALL: all do
    uint32_t flags;   ///< FLEDGE_HAS_LO ... and the two above
    FledgeType number;
    double low;
    double high;
} MissionRule;

/** The first rule that a block breaks, and which number breaks it; NULL: it keeps all rules. */
const MissionRule *mission_check(const MissionRule *rules, uint32_t n, const void *block, uint32_t *element);

#ifdef __cplusplus
}
#endif

#endif
