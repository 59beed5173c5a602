/* SPDX-License-Identifier: Apache-2.0 */
/* What surrounds a spacecraft, where it is: air, magnetic field, sunlight, light of a planet. */
#ifndef WORLD_MSG_ENVIRONMENT_H
#define WORLD_MSG_ENVIRONMENT_H

#include "flight/math/vec.h"
#include "flight/msg/head.h"

/** The air about a spacecraft. */
typedef struct AirState {
    Head head;
    double density;     ///< [kg/m^3] of the air
    double altitude;    ///< [m] of the spacecraft over the ellipsoid of the body
    Vec3 v_AN_N;        ///< [m/s] velocity of the air relative to N, N components
    double temperature; ///< [K] of the air; 0: the model does not know it
    double molar_mass;  ///< [kg/mol] mean; 0: the model does not know it
} AirState;

/** The magnetic field at a spacecraft. */
typedef struct MagneticField {
    Head head;
    Vec3 B_N; ///< [T] flux density, N components
} MagneticField;

/** How the Sun shines on a spacecraft. */
typedef struct Illumination {
    Head head;
    double visible;    ///< [-] in [0, 1]: share of the Sun's disc that no body hides
    double irradiance; ///< [W/m^2] of the sunlight, eclipse included
    Vec3 s_N;          ///< [-] unit vector towards the Sun, N components
} Illumination;

/** How a planet shines on a spacecraft: the sunlight that it reflects, and its infrared. */
typedef struct PlanetLight {
    Head head;
    Vec3 reflected_N; ///< [W/m^2] towards where the reflected light comes from, N components; its length is the
                      ///< irradiance of a plate that faces there
    Vec3 infrared_N;  ///< [W/m^2] the same of the infrared
    double sunlight;  ///< [W/m^2] irradiance of the Sun at the planet
} PlanetLight;

#endif
