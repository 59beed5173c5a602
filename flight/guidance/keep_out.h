/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_KEEP_OUT_H
#define FLIGHT_GUIDANCE_KEEP_OUT_H

#include "flight/msg/attitude.h"
#include "flight/msg/orbit.h"
#include "flight/msg/slew.h"

#define KEEP_OUT_BORESIGHTS 2
#define KEEP_OUT_POINTS 2

/** Lead boresights around bright bodies on the way to a target, by way-points for SlewProfile.
 *  While the body turns about an eigenaxis by x, the cosine of the angle between a boresight and a body is
 *      a + b cos x + c sin x,
 *  whose largest value is known. If it stays below that of the half angle, with `margin`, on the turn to the target,
 *  the target passes. Else the way goes by one way-point, or two, where the body rests in N: of those that put the
 *  boresight which would come nearest on a ring around the body that it would come nearest to, in the attitude that is
 *  nearest to the middle of the turn, and those that differ from the start or the target by a turn about that body's
 *  direction, on which no boresight comes nearer to it, the shortest free way counts. From a start, or to a target,
 *  within the margin, the way goes no nearer than these are.
 *  A way is searched for at the first update after a reset, where the target jumps (as in SlewProfile), and where the
 *  target or a body has moved so that the way left does not keep the half angle: the margin is
 *  the hysteresis. A way-point is reached within `reached`.
 *  A target inside a cone passes, degraded. A body inside a cone is first led out, on a turn that goes no deeper,
 *  unless the turn to the target goes no deeper; where there is neither, the target passes. All that is degraded. Where
 *  no way is found from outside, the body stays where it was then, degraded, and each update searches again, in up to
 *  3,500 turns; else only an update that plans does.
 *  Without an orbit the direction to a body is that from the origin of N. A second body without a message does not
 *  count. Where a number is not finite, or a body has no direction, the last way is held, degraded.
 *  The way is that of a body which rests where a turn begins. At a rate w, SlewProfile first brings it to rest within
 *  0.75 w^2 / accel_max, and control has an error: what `margin` has to cover.
 *  Source: the angle by the rotation formula of Rodrigues; the largest value of a sinusoid on an arc. */
typedef struct KeepOut {
    struct {
        AttReference target;
        NavAttitude attitude;
        BodyState first;  ///< such as the Sun
        BodyState second; ///< optional, distinct first: such as the Moon or the Earth
        NavOrbit orbit;   ///< optional: without it bodies are seen from the origin of N
    } in;
    struct {
        AttReference way; ///< the target, or a way-point
        KeepOutStatus status;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 2]: number of boresights
        uint32_t spare;
        Vec3 boresights_B[KEEP_OUT_BORESIGHTS]; ///< [-] required, count n, non-zero: where the instruments look
        double first_angle;                     ///< [rad] required, > 0, <= 2: half angle of the first body's cone
        double second_angle;                    ///< [rad] >= 0, <= 2: half angle of the second body's cone; 0: none
        double margin;                          ///< [rad] in [0, 1]: which a new way keeps beside the half angles
        double reached;                         ///< [rad] required, > 0: within which a way-point is reached
        double jump;                            ///< [rad] required, > 0: by which a target jumps that is another one
    } par;
    struct {
        AttReference last;              ///< the last target
        Vec3 sigma_WN[KEEP_OUT_POINTS]; ///< [-] the way-points
        uint32_t points;                ///< [-] their number
        uint32_t next;                  ///< [-] how many of them were reached
        uint32_t running;               ///< [-] 0 until the first way after a reset
        uint32_t mode; ///< [-] 1: the body stays at the first way-point, as no way was found; 2: it leaves a cone by it
    } mem;
} KeepOut;

void keep_out_reset(KeepOut *m);
void keep_out_update(KeepOut *m, Tick t);

#endif
