/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_SUNLIGHT_H
#define WORLD_ENVIRONMENT_SUNLIGHT_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** Sunlight at a spacecraft, and the eclipses by any bodies: for solar radiation pressure, and as a message for
 *  sensors and power. Python's `sun` is the Sun, `shadows` the bodies that may hide it, `sky` says where they are.
 *  Assumptions: the Sun is a sphere, equally bright all over its disc; bodies have no atmosphere. What they reflect and
 *  radiate is that of PlanetRadiation.
 *  Source: Montenbruck and Gill, section 3.4.2; Kopp and Lean 2011 for the irradiance. */
typedef struct Sunlight {
    struct {
        CraftState truth;
    } in;
    struct {
        Illumination light;
    } out;
    struct {
        double irradiance;   ///< [W/m^2] >= 0, <= 1e9: at 1 AU; 0: 1361
        uint32_t oblate;     ///< [-] in [0, 1]: 1: bodies that hide it are ellipsoids about their poles; 0: spheres
        uint32_t light_time; ///< [-] in [0, 1]: 1: they stand where the light passes them, d/c before it arrives from
                             ///< the distance d; 0: where they are as it arrives
    } par;
} Sunlight;

#endif
