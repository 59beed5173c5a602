/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_SOLAR_PRESSURE_H
#define WORLD_DYNAMICS_SOLAR_PRESSURE_H

#include "world/msg/craft.h"

#define SOLAR_FACETS_MAX 16

/** The pressure of sunlight, a part of a spacecraft: of a sphere of an area, or of flat facets. Python's `light` is
 *  the model of the sunlight, with its eclipses; `radiation`, if it is given, the PlanetRadiation whose reflected
 *  sunlight and infrared push too. It acts at each stage of the integrator, where the craft is then. A facet that is
 *  mounted on a panel of the attribute `panels`, counted from 1, turns with it, and its force turns the hinge;
 *  normals_B and centres_B are for theta = 0.
 *  Assumptions: facets do not shade one another, and have their optical properties on the side of their normal, the
 *  other side being dark; what a facet absorbs it does not radiate to one side.
 *  Source: Montenbruck and Gill, section 3.4. */
typedef struct SolarPressure {
    struct {
        ForceTorque load; ///< what sunlight does to the spacecraft
    } out;
    struct {
        double Cr;     ///< [-] >= 0, <= 2: of the area: 1 if it absorbs all, without facets; for infrared, too
        double area;   ///< [m^2] >= 0, <= 1e9: cross section, without facets
        Vec3 centre_B; ///< [m] centre of pressure, in B, without facets
        uint32_t n;    ///< [-] in [0, 16]: number of facets
        uint32_t spare;
        Vec3 normals_B[SOLAR_FACETS_MAX];  ///< [-] count n, non-zero: outward normals of the facets
        double areas[SOLAR_FACETS_MAX];    ///< [m^2] count n, >= 0, <= 1e9: areas of the facets
        Vec3 centres_B[SOLAR_FACETS_MAX];  ///< [m] count n: middles of the facets, in B
        double specular[SOLAR_FACETS_MAX]; ///< [-] count n, in [0, 1]: share that a facet reflects as a mirror
        double diffuse[SOLAR_FACETS_MAX];  ///< [-] count n, in [0, 1]: share that it scatters; the rest is absorbed
        uint32_t panel[SOLAR_FACETS_MAX];  ///< [-] count n, in [0, 8], initial: of `panels`, that it is on; 0: none
        double diffuse_infrared[SOLAR_FACETS_MAX]; ///< [-] count n, in [0, 1]: share of the infrared that it scatters;
                                                   ///< the rest is absorbed
    } par;
} SolarPressure;

#endif
