/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static WheelMonitor m = {.par = {.torque_max = 0.02, .persistence = 3, .least = 3}};
 *
 *     static WheelAvailability check(const WheelCommand *last, const WheelSpeeds *speeds, const WheelSet *set, Tick t)
 *     {
 *         m.in.command = *last;
 *         m.in.speeds = *speeds;
 *         m.in.wheels = *set;
 *         wheel_monitor_update(&m, t);
 *         return m.out.availability; // without a wheel that missed its command in three updates
 *     }
 */
#ifndef FLIGHT_PROTECTION_WHEEL_MONITOR_H
#define FLIGHT_PROTECTION_WHEEL_MONITOR_H

#include "flight/msg/protection.h"
#include "flight/msg/wheels.h"

/** Take wheels out of use that do not do what their motors are commanded: where
 *     |J (Omega - Omega_last) / dt - u_last| > torque_max
 *  for `persistence` updates in a row. The wheel is then not available until a reset of the module, for without a
 *  command it shows nothing. The module stands before the wheels' torques in its task, so that the command at its input
 *  is that of the last update. torque_max covers friction, the resolution of the tachometers, and the wheel's share
 *  J domega of the body's acceleration.
 *  Wheels in `off` are out of use in any case, of those in `on` no fault is believed, nor of the last `least` wheels.
 *  Without speeds no count changes, degraded.
 *  Source: the motion of a wheel, J (dOmega + g . domega) = u; thesis section 5.4.3, for persistence. */
typedef struct WheelMonitor {
    struct {
        WheelCommand command; ///< of the last update
        WheelSpeeds speeds;
        WheelSet wheels;
    } in;
    struct {
        WheelAvailability availability;
        ProtectionState state; ///< of the wheel that is worst among those in use; tripped: a wheel was taken out
    } out;
    struct {
        double torque_max;    ///< [N m] required, > 0: largest torque that may be missing
        uint32_t persistence; ///< [-] required, > 0: updates in a row beyond the limit that take a wheel out
        uint32_t off;         ///< [-] in [0, 255]: wheels that are out of use, a bit for each
        uint32_t on;          ///< [-] in [0, 255]: wheels that stay in use, a bit for each
        uint32_t least;       ///< [-] in [0, 8]: so many wheels stay in use: of the last ones no fault is believed
    } par;
    struct {
        double Omega[WHEELS_MAX];   ///< [rad/s] at the last update
        uint32_t count[WHEELS_MAX]; ///< [-] updates in a row beyond the limit
        int64_t last;               ///< [ns] when the speeds of the last update were taken
        uint32_t faulty;            ///< [-] wheels taken out, a bit for each
        uint32_t running;           ///< [-] 1: there was an update with speeds
    } mem;
} WheelMonitor;

void wheel_monitor_reset(WheelMonitor *m);
void wheel_monitor_update(WheelMonitor *m, Tick t);

#endif
