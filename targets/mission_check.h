/* SPDX-License-Identifier: Apache-2.0 */
/* Whether parameters keep the rules of their headers, as data and one function: for parameters that
 * come from outside, as tables do. The rules are the desktop's (sim/check.cpp), all but `required`:
 * what comes from outside was given. */
#ifndef TARGETS_MISSION_CHECK_H
#define TARGETS_MISSION_CHECK_H

#include "targets/mission_io.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    MISSION_HAS_LOW = 1 << 0,
    MISSION_HAS_HIGH = 1 << 1,
    MISSION_LOW_OPEN = 1 << 2,
    MISSION_HIGH_OPEN = 1 << 3,
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
    uint32_t flags;
    MissionNumber number;
    double low;
    double high;
} MissionRule;

/** The first rule that a block breaks, and the number that does; NULL: it keeps them all. */
const MissionRule *mission_check(const MissionRule *rules, uint32_t n, const void *block, uint32_t *element);

#ifdef __cplusplus
}
#endif

#endif
