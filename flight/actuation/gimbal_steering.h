/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_GIMBAL_STEERING_H
#define FLIGHT_ACTUATION_GIMBAL_STEERING_H

#include "flight/msg/gimbals.h"
#include "flight/msg/sensors.h"
#include "flight/msg/vehicle.h"

/** Map a wanted torque L on the body to rates of the gimbals of control moment gyros. With the axes g_i of the gimbals
 *  and s_i of the wheels, the columns t_i = g_i x s_i of A and the wheels' momentum h = H sum s_i, the rates solve
 *    H A rates = -(L + omega x h)
 *  by the robust inverse A^T (A A^T + lambda 1)^-1, lambda = 0.01 exp(-10 det(A A^T)), which has a result where the
 *  gyros are singular, too: near there, where lambda > 0.005, the torque is not the wanted one, and the rates are
 *  degraded. Where a gimbal would pass rate_max, all are slowed alike. Where no rates can be computed, the last ones
 *  are held, degraded; after `hold` without new data of the torque they are zero, degraded.
 *  Source: Nakamura and Hanafusa 1986 for the inverse; Bedrossian, Paradiso, Bergmann and Rowell 1990 for gyros. */
typedef struct GimbalSteering {
    struct {
        BodyTorque torque;
        GyroRate rate; ///< of the body
        GimbalState gimbals;
    } in;
    struct {
        GimbalRates rates;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of gyros
        uint32_t spare;
        Vec3 axes_B[WHEELS_MAX];  ///< [-] required, count n, non-zero: axes of the gimbals
        Vec3 spins_B[WHEELS_MAX]; ///< [-] required, count n, non-zero: axes of the wheels at angle 0, across those
        double H;                 ///< [N m s] required, > 0: momentum of a wheel
        double rate_max;          ///< [rad/s] required, > 0: of a gimbal
        double hold;              ///< [s] >= 0: how long the rates go on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest;     ///< [ns] the time of the newest wanted torque that was used
        uint64_t saturated; ///< [-]  updates in which rate_max slowed the gimbals
    } mem;
} GimbalSteering;

void gimbal_steering_reset(GimbalSteering *m);
void gimbal_steering_update(GimbalSteering *m, Tick t);

#endif
