/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_ATMOSPHERE_H
#define WORLD_ENVIRONMENT_ATMOSPHERE_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** How an atmosphere becomes thinner. */
typedef enum AtmosphereLaw {
    ATMOSPHERE_CONSTANT = 0,     ///< the density everywhere
    ATMOSPHERE_EXPONENTIAL = 1,  ///< by a factor e per scale height
    ATMOSPHERE_STANDARD_1976 = 2 ///< the US Standard Atmosphere 1976, to 1000 km
} AtmosphereLaw;

/** The atmosphere of a body, which turns with it: for the drag of spacecraft, and as a message. Altitudes are those
 *  over the body's ellipsoid. Python's `body` is the body, `sky` says where it is and how it turns.
 *  Assumptions: the density depends on altitude alone; the wind blows alike everywhere.
 *  Source: US Standard Atmosphere 1976. */
typedef struct Atmosphere {
    struct {
        CraftState truth;
    } in;
    struct {
        AirState air;
    } out;
    struct {
        AtmosphereLaw law; ///< [-] how it becomes thinner
        uint32_t spare;
        double density;      ///< [kg/m^3] >= 0, <= 1e6: at the base altitude; > 0, but for the standard
                             ///< atmosphere, which has its own
        double base;         ///< [m] >= -1e9, <= 1e9: altitude where it has that density; of the exponential law
        double scale_height; ///< [m] >= 0, <= 1e9: of the exponential law
        double spin;         ///< [rad/s] >= -1, <= 1: rate of the body about its pole, if there is no sky
        double wind_east;    ///< [m/s] >= -1e4, <= 1e4: of the air relative to the body
        double wind_north;   ///< [m/s] >= -1e4, <= 1e4: likewise
    } par;
} Atmosphere;

#endif
