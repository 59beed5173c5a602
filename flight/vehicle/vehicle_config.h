/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     static VehicleConfig m = {.par = {.I_B = {{{9.0, 0.0, 0.0}, {0.0, 8.0, 0.0}, {0.0, 0.0, 7.0}}}}};
 *     vehicle_config_reset(&m); // publishes the data, to which every other module is wired
 *     const VehicleData vehicle = m.out.vehicle;
 */
#ifndef FLIGHT_VEHICLE_VEHICLE_CONFIG_H
#define FLIGHT_VEHICLE_VEHICLE_CONFIG_H

#include "flight/msg/vehicle.h"

/** The vehicle's data, given once and wired to every module that needs them. */
typedef struct VehicleConfig {
    struct {
        VehicleData vehicle;
    } out;
    struct {
        Mat3 I_B; ///< [kg m^2] required, inertia: inertia about the centre of mass of the vehicle
                  ///< with its wheels, less the wheels' inertia about their spin axes
    } par;
} VehicleConfig;

void vehicle_config_reset(VehicleConfig *m);
void vehicle_config_update(VehicleConfig *m, Tick t);

#endif
