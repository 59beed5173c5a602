/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_SLEW_PROFILE_H
#define FLIGHT_GUIDANCE_SLEW_PROFILE_H

#include "flight/msg/attitude.h"
#include "flight/msg/slew.h"

/** Lead a reference R from where the body is to a target T, which may move, and then follow it exactly:
 *      [RN] = [M(chi u)] [M(phi e)] [TN].
 *  First the body's rate w relative to the target comes to rest, about its own axis u; then R turns about an eigenaxis
 *  e that rests in the target's frame, by the angle that is left, and ends at rest relative to the target. R begins
 *  with the attitude and the rate of the body. With x from 0 to 1 over a time T, each rate rises or falls as
 *      3 x^2 - 2 x^3,
 *  so that the acceleration is continuous; it has its peak of 1.5 rate / T at half the change. A turn by A
 *  without a coast takes sqrt(6 A / accel_max), else A / rate_max + 1.5 rate_max / accel_max.
 *  The limits hold relative to the target; the rate w with which it begins may be above. The target's own rate and
 *  acceleration, and the products of its rate with that of the turn, add to them. Torques: about an axis with the
 *  inertia I, accel_max <= (what wheels give about any axis - what control and disturbances need) / I.
 *  A slew begins at the first update after a reset, and where the target turns up farther from where its motion led to
 *  than `jump`, or with a rate that differs by more than `rate_jump`. While the body has no attitude then, and where a
 *  number is not finite, the last reference is held, degraded. A slew from an attitude that is not good is degraded.
 *  Source: Wie 2008, section 7.3, for slews about an eigenaxis; the composition by the rules of rates. */
typedef struct SlewProfile {
    struct {
        AttReference target;
        NavAttitude attitude; ///< where a slew begins; else it is not used
    } in;
    struct {
        AttReference reference;
        SlewStatus status;
    } out;
    struct {
        double rate_max;  ///< [rad/s]   required, > 0: largest rate about the eigenaxis
        double accel_max; ///< [rad/s^2] required, > 0: largest acceleration about the eigenaxis
        double jump;      ///< [rad]     required, > 0: by which a target jumps that is another one
        double rate_jump; ///< [rad/s]   >= 0: by which the rate of one jumps; 0: it is not looked at
    } par;
    struct {
        AttReference last; ///< the last target
        int64_t start;     ///< [ns]      when the slew began
        Vec3 u_R;          ///< [-]       axis of the rate that comes to rest
        Vec3 e_T;          ///< [-]       eigenaxis
        double w;          ///< [rad/s]   rate that comes to rest
        double stop;       ///< [s]       how long that takes
        double angle;      ///< [rad]     of the turn about the eigenaxis
        double peak;       ///< [rad/s]   its largest rate
        double ramp;       ///< [s]       how long its rate rises, and falls
        double coast;      ///< [s]       how long its rate is the largest
        Quality quality;   ///< [-]       of the attitude at the start
        uint32_t running;  ///< [-]       0 until the first slew after a reset
    } mem;
} SlewProfile;

void slew_profile_reset(SlewProfile *m);
void slew_profile_update(SlewProfile *m, Tick t);

#endif
