/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_SUNLIGHT_H
#define WORLD_ENVIRONMENT_SUNLIGHT_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** Sunlight at a spacecraft, and the eclipses by any bodies: for solar radiation pressure, and as a message for
 *  sensors and power. Python's `sun` is the Sun, `shadows` the bodies that may hide it, `sky` says where they are.
 *  Assumptions: all bodies are spheres, and the Sun's disc is equally bright all over; two bodies do not hide the
 *  same part of it. Neither light time nor aberration, neither albedo nor an atmosphere.
 *  Source: Montenbruck and Gill, section 3.4.2; Kopp and Lean 2011 for the irradiance. */
typedef struct Sunlight {
    struct {
        CraftState truth;
    } in;
    struct {
        Illumination light;
    } out;
    struct {
        double irradiance; ///< [W/m^2] >= 0, <= 1e9: at 1 AU; 0: 1361
    } par;
} Sunlight;

#endif
