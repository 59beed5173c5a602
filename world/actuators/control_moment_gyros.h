/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ACTUATORS_CONTROL_MOMENT_GYROS_H
#define WORLD_ACTUATORS_CONTROL_MOMENT_GYROS_H

#include "flight/msg/gimbals.h"
#include "world/msg/fault.h"

/** Balanced control moment gyros of variable speed, a part of a spacecraft: wheels on gimbals, each with a motor. A
 *  gimbal's motor has a torque or a rate as its command; a rate is reached as exp(-t / lag), as far as the torque
 *  suffices. The motors hold a commanded torque through an update; near the limit of a speed or a rate they give what
 *  reaches it at the update's end. The spacecraft's mass has the gyros, its I_B does not have their inertias about
 *  their centres.
 *  The channels of its faults: 0 to 7 the commands of the wheels' motors, 8 to 15 those of the gimbals' (a torque or a
 *  rate), 16 to 23 the measured speeds, 24 to 31 the measured angles.
 *  Assumptions: no friction, no stops of the gimbals, centres of mass on the axes.
 *  Source: Schaub and Junkins, section 4.6. */
typedef struct ControlMomentGyros {
    struct {
        WheelCommand command;  ///< optional: torques of the wheels' motors; without it they are off
        GimbalRates rates;     ///< optional: rates of the gimbals
        GimbalTorques torques; ///< optional: torques of the gimbals' motors, where there are no rates
        FaultSet injected;     ///< optional: faults, besides the planned ones
    } in;
    struct {
        WheelSpeeds speeds;
        GimbalState gimbals;
        WheelCommand applied;          ///< torques of the wheels' motors after the limits
        GimbalTorques gimbals_applied; ///< torques of the gimbals' motors after the limits
    } out;
    struct {
        uint32_t n;                     ///< [-] in [1, 8]: number of gyros
        uint32_t n_faults;              ///< [-] in [0, 4]: number of planned faults
        Vec3 gimbal_axes_B[WHEELS_MAX]; ///< [-] required, count n, non-zero: axes of the gimbals
        Vec3 spin_axes_B[WHEELS_MAX];   ///< [-] required, count n, non-zero: of the wheels at angle 0; what is across
        double J[WHEELS_MAX];           ///< [kg m^2] required, count n, in [1e-9, 1e9]: of the wheel about its axis
        double J_g[WHEELS_MAX];         ///< [kg m^2] required, count n, in [1e-9, 1e9]: gimbal and wheel, about the
                                        ///< gimbal's axis
        double J_s[WHEELS_MAX];         ///< [kg m^2] count n, in [0, 1e9]: of the gimbal alone, about the wheel's axis
        double J_t[WHEELS_MAX];         ///< [kg m^2] count n, in [0, 1e9]: gimbal and wheel, about the third axis
        double u_max[WHEELS_MAX];       ///< [N m]   count n, >= 0: largest torque of a wheel's motor; 0: unlimited
        double Omega_max[WHEELS_MAX];   ///< [rad/s] count n, >= 0: speed limit of a wheel; 0: none
        double torque_max[WHEELS_MAX];  ///< [N m]   count n, >= 0: largest torque of a gimbal's motor; 0: unlimited
        double rate_max[WHEELS_MAX];    ///< [rad/s] count n, >= 0: limit of a gimbal's rate; 0: none
        double lag[WHEELS_MAX];         ///< [s]     count n, >= 0: of a gimbal's rate; 0: an update
        double Omega[WHEELS_MAX];       ///< [rad/s] count n, initial: speeds of the wheels
        double angle[WHEELS_MAX];       ///< [rad]   count n, in [-1e6, 1e6], initial: angles of the gimbals
        double rate[WHEELS_MAX];        ///< [rad/s] count n, initial: rates of the gimbals
        Fault faults[FAULTS_MAX];       ///< count n_faults: planned
    } par;
    struct {
        uint64_t saturated; ///< [-] updates in which a limit reduced a motor's torque
    } mem;
} ControlMomentGyros;

#endif
