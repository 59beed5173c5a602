/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_PLANET_RADIATION_H
#define WORLD_ENVIRONMENT_PLANET_RADIATION_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** How bright a body is. */
typedef enum PlanetRadiationLaw {
    PLANET_RADIATION_CONSTANT = 0,   ///< the albedo and the emissivity everywhere
    PLANET_RADIATION_KNOCKE_1988 = 1 ///< those of the Earth, by latitude and season
} PlanetRadiationLaw;

/** The sunlight that a body reflects to a spacecraft, and the infrared that it radiates: for the pressure of light, and
 *  as a message for sensors and power. Python's `body` is the body, `light` the Sunlight that shines on it, `sky` says
 *  where it is and how it stands. What the craft sees of the body is a cap below it and rings about that, of elements
 *  that look equally large: 6 in the first ring, 12 in the second.
 *  Assumptions: the body is a sphere of its radius that reflects and radiates by Lambert's law; its infrared does not
 *  depend on the time of day, and nothing shades it. No clouds, land or sea but as means over the latitudes.
 *  Source: Knocke, Ries and Tapley 1988. */
typedef struct PlanetRadiation {
    struct {
        CraftState truth;
    } in;
    struct {
        PlanetLight planet;
    } out;
    struct {
        PlanetRadiationLaw law; ///< [-] how bright it is
        uint32_t rings;         ///< [-] in [0, 5]: of elements; 0: 2, which makes 19 elements
        double albedo;          ///< [-] in [0, 1]: share of the sunlight that it reflects; of the constant law
        double emissivity; ///< [-] in [0, 1]: infrared from each area, per a quarter of the Sun's irradiance, which
                           ///< is its mean over the body; of the constant law
    } par;
} PlanetRadiation;

#endif
