/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_WHEEL_CONFIG_H
#define FLIGHT_VEHICLE_WHEEL_CONFIG_H

#include "flight/msg/wheels.h"

/** The wheels' data, given once and wired to every module that needs them.
 *  Axes are normalised on the way out. An axis of length zero stays zero, so that wheel is useless,
 *  and n is at most WHEELS_MAX; the set is then degraded. */
typedef struct WheelConfig {
    struct {
        WheelSet wheels;
    } out;
    struct {
        uint32_t n; ///< [-] in [1, 8]: number of wheels
        uint32_t spare;
        Vec3 axes_B[WHEELS_MAX];  ///< [-]      required, count n, non-zero: spin axes
        double J[WHEELS_MAX];     ///< [kg m^2] required, count n, > 0: inertia about the spin axis
        double u_max[WHEELS_MAX]; ///< [N m]    count n, >= 0: largest motor torque; 0: unlimited
    } par;
} WheelConfig;

void wheel_config_reset(WheelConfig *m);
void wheel_config_update(WheelConfig *m, Tick t);

#endif
