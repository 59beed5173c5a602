/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_PROTECTION_ATTITUDE_MISCOMPARE_H
#define FLIGHT_PROTECTION_ATTITUDE_MISCOMPARE_H

#include "flight/msg/attitude.h"
#include "flight/msg/protection.h"

/** Compare two navigated attitudes, as of a prime and a redundant estimator. Trip where they differ by more than an
 *  angle, or their rates by more than a rate, for `persistence` updates in a row, and stay so until they agreed for
 *  `release` updates in a row. The attitude of a is passed on; with `prefer_b`, and while a is missing, that of b.
 *  Which of the two is wrong the module cannot know; an event of the mission chooses, by `prefer_b` or by a mode.
 *  Where one is missing or old there is nothing to compare: no count changes, and the state is degraded.
 *  Source: thesis section 5.4.3, for comparisons that need persistence. */
typedef struct AttitudeMiscompare {
    struct {
        NavAttitude a;
        NavAttitude b; ///< distinct a: of another source
    } in;
    struct {
        ProtectionState state;
        NavAttitude attitude;
    } out;
    struct {
        double angle_max;     ///< [rad] required, > 0: largest difference of the attitudes
        double rate_max;      ///< [rad/s] required, > 0: largest difference of the rates
        uint32_t persistence; ///< [-] required, > 0: updates in a row beyond a limit that trip
        uint32_t release;     ///< [-] updates in a row within the limits that release; 0: only a reset does
        uint32_t prefer_b;    ///< [-] in [0, 1]: 1: b is passed on
        uint32_t spare;
    } par;
    struct {
        Judgement judgement; ///< of the last update
    } mem;
} AttitudeMiscompare;

void attitude_miscompare_reset(AttitudeMiscompare *m);
void attitude_miscompare_update(AttitudeMiscompare *m, Tick t);

#endif
