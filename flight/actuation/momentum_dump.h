/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_MOMENTUM_DUMP_H
#define FLIGHT_ACTUATION_MOMENTUM_DUMP_H

#include "flight/msg/vehicle.h"
#include "flight/msg/wheels.h"

/** Ask for an external torque that takes surplus momentum out of the wheels:
 *     L = -gain (h - h_wanted),   h = sum J_i Omega_i g_i,   |L| <= torque_max
 *  from where the surplus exceeds h_start until it is below h_stop. Thrusters (ThrusterMapping) or rods (RodTorques)
 *  give the torque; the attitude control, which takes what they give as its known external torque, makes the wheels
 *  take it up. While the torque is given in full, h decays as exp(-gain t), or by torque_max per second.
 *  Without new speeds the torque is held, degraded, and after `hold` it is zero, degraded.
 *  Source: Wie 2008, section 7.3. */
typedef struct MomentumDump {
    struct {
        WheelSet wheels;
        WheelSpeeds speeds;
    } in;
    struct {
        BodyTorque torque; ///< wanted of thrusters or rods
    } out;
    struct {
        Vec3 h_wanted_B;   ///< [N m s] momentum that the wheels shall keep, B components
        double gain;       ///< [1/s] required, > 0: part of the surplus to take out per second
        double torque_max; ///< [N m] >= 0: largest torque; 0: none
        double h_start;    ///< [N m s] >= 0: surplus beyond which it begins
        double h_stop;     ///< [N m s] >= 0: surplus below which it ends
        double hold;       ///< [s] >= 0: how long old speeds count; 0: ten updates
    } par;
    struct {
        int64_t newest;   ///< [ns] the time of the newest speeds that were used
        uint32_t dumping; ///< [-] 1: it has begun and not ended
        uint32_t dumps;   ///< [-] that have begun
    } mem;
} MomentumDump;

void momentum_dump_reset(MomentumDump *m);
void momentum_dump_update(MomentumDump *m, Tick t);

#endif
