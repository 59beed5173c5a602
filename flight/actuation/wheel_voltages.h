/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_WHEEL_VOLTAGES_H
#define FLIGHT_ACTUATION_WHEEL_VOLTAGES_H

#include "flight/msg/volts.h"

/** Turn motor torques into the voltages that give them: V = R u / k + e Omega, and `dead` more in the direction of u.
 *  With a gain, the torque that the wheel's speed shows over the last update is fed back:
 *     u = u_c + gain (u_last - J (Omega - Omega_last) / dt)
 *  where u_last is that of the last update, and dt the time between two measurements of the speeds. Without speeds
 *  there is neither back-EMF nor feedback, degraded where one of them is in use; without newer ones there is no
 *  feedback. Voltages end at `volts_max`. A wheel that may not be used has none.
 *  Where no voltage can be computed, the output is held, degraded. After `hold` without new commands, which includes
 *  one that is not good and gets older, the voltages are zero, degraded.
 *  Source: a direct-current motor's static equation; WheelDriveCounts is the same behind a converter. */
typedef struct WheelVoltages {
    struct {
        WheelCommand command;
        WheelSet wheels;
        WheelSpeeds speeds;             ///< optional: without it no back-EMF and no feedback
        WheelAvailability availability; ///< optional: without it all wheels may be used
    } in;
    struct {
        WheelVolts drive;
    } out;
    struct {
        double volts_max;       ///< [V] required, > 0: largest voltage
        double torque_constant; ///< [N m/A] required, > 0: k
        double resistance;      ///< [ohm] required, > 0: R
        double back_emf;        ///< [V s] >= 0: e, volts per rad/s
        double dead;            ///< [V] >= 0: up to which the motor gives no torque
        double gain;            ///< [-] in [0, 1]: on the torque that was missing; 0: off
        double hold;            ///< [s] >= 0: how long the voltages go on without new commands; 0: ten updates
    } par;
    struct {
        double u[WHEELS_MAX];     ///< [N m] commanded at the last update
        double Omega[WHEELS_MAX]; ///< [rad/s] at the last update
        uint64_t saturated;       ///< [-] updates in which a voltage was limited
        int64_t taken;            ///< [ns] when the last speeds were measured
        int64_t newest;           ///< [ns] the time of the newest commands that were used
        uint32_t knows;           ///< [-] wheels whose torque and speed the last update had, a bit for each
        uint32_t spare;
    } mem;
} WheelVoltages;

void wheel_voltages_reset(WheelVoltages *m);
void wheel_voltages_update(WheelVoltages *m, Tick t);

#endif
