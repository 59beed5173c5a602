/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static Triad m = {.par = {.separation_min = 0.1, .together = 1.0, .gate = 5.0}};
 *
 *     static StarAttitude fix(const SeenDirection *sun, const SeenDirection *field, Tick t)
 *     {
 *         m.in.primary = *sun;
 *         m.in.secondary = *field;
 *         triad_update(&m, t);
 *         return m.out.attitude;
 *     }
 */
#ifndef FLIGHT_NAVIGATION_TRIAD_H
#define FLIGHT_NAVIGATION_TRIAD_H

#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"

/** The attitude from two directions, by two triads of axes. The primary direction w1 is met exactly; of the secondary
 *  w2, only the turn about the primary counts. With c = w1 . w2, s = |w1 x w2| and the standard deviations s1, s2,
 *      [BN] = W V^T,   W = [w1, w3 x w1, w3],   w3 = unit(w1 x w2),   V as W of the known ones,
 *      P_B = s1^2 I + ((s2^2 - s1^2) w1 w1^T + s1^2 c (w1 w2^T + w2 w1^T)) / s^2.
 *  An attitude is made from directions that no attitude had before and whose times are up to `together` apart; its
 *  time is that of the newer, so a rate of the body adds its turn between both. It is degraded where one direction is,
 *  and where the angles between the two, as seen and as known, differ by more than `gate` standard deviations. With
 *  one direction alone, or with both nearly parallel or opposite, it is held, degraded; state has the reason.
 *  Sources: H. D. Black, AIAA Journal 2(7), 1964; M. D. Shuster, S. D. Oh, JGC 4(1), 1981. */
typedef struct Triad {
    struct {
        SeenDirection primary; ///< the one to trust more
        SeenDirection secondary;
    } in;
    struct {
        StarAttitude attitude;
        AttitudeFixState state;
    } out;
    struct {
        double separation_min; ///< [rad] required, > 0, <= 1.5: least angle between the directions, and to the opposite
        double together;       ///< [s] required, > 0: largest difference of their times
        double gate;           ///< [-] required, > 0: normalised misfit above which the attitude is degraded
    } par;
} Triad;

void triad_reset(Triad *m);
void triad_update(Triad *m, Tick t);

#endif
