/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_QUEST_H
#define FLIGHT_NAVIGATION_QUEST_H

#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

/** The attitude from two to four directions w_i, known as v_i, with errors of s_i: the one with the least sum
 *      misfit = sum |w_i - [BN] v_i|^2 / s_i^2   (Wahba),   on average 2 n - 3.
 *  Its quaternion belongs to the largest eigenvalue of Davenport's matrix, found by Newton's method and without
 *  Gibbs' vector, which turns by 180 degrees have not; two steps by the attitude itself then remove what unequal errors
 *  cost of its digits. Its covariance is
 *      P_B = (sum (I - w_i w_i^T) / s_i^2)^-1.
 *  An attitude is made from directions that no attitude had before and whose times are up to `together` before the
 *  newest, whose time is its own: a rate of the body adds its turn in between. Where two are good, degraded ones do
 *  not count. It is degraded where one that counts is, and where the misfit exceeds the square of `gate`. With one
 *  direction alone, or with all of them nearly parallel or opposite, it is held, degraded; state has the reason.
 *  Sources: M. D. Shuster, S. D. Oh, JGC 4(1), 1981; F. L. Markley, D. Mortari, Journal of the Astronautical Sciences
 *  48(2), 2000. */
typedef struct Quest {
    struct {
        SeenDirection first;
        SeenDirection second;
        SeenDirection third;  ///< optional: one more
        SeenDirection fourth; ///< optional: one more
    } in;
    struct {
        StarAttitude attitude;
        AttitudeFixState state;
    } out;
    struct {
        double separation_min; ///< [rad] required, > 0, <= 1.5: least angle between any two, and to the opposite
        double together;       ///< [s] required, > 0: largest difference of their times
        double gate;           ///< [-] required, > 0: square root of the misfit above which the attitude is degraded
    } par;
} Quest;

void quest_reset(Quest *m);
void quest_update(Quest *m, Tick t);

#endif
