/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_ROD_CONFIG_H
#define FLIGHT_VEHICLE_ROD_CONFIG_H

#include "flight/msg/magnetics.h"

/** Publishes the vehicle's magnetic torque rods to the modules that need them, with unit axes.
 *  An axis of zero, and more rods than there is room for, make the message degraded. */
typedef struct RodConfig {
    struct {
        RodSet rods;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of rods
        uint32_t spare;
        Vec3 axes_B[RODS_MAX];  ///< [-] required, count n, non-zero: direction of a positive dipole
        double m_max[RODS_MAX]; ///< [A m^2] count n, >= 0: largest dipole; 0: unlimited
    } par;
} RodConfig;

void rod_config_reset(RodConfig *m);
void rod_config_update(RodConfig *m, Tick t);

#endif
