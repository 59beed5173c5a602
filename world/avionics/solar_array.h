/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_SOLAR_ARRAY_H
#define WORLD_AVIONICS_SOLAR_ARRAY_H

#include "flight/msg/panels.h"
#include "world/msg/craft.h"
#include "world/msg/environment.h"
#include "world/msg/power.h"

#define SOLAR_PANELS_MAX 8

/** Solar panels: their electrical power from the sunlight, eclipses included. A panel with an axis is turned about it
 *  by its angle of `angles`, from world.ArrayDrive or world.HingedPanels; the others are fixed to the body. They use
 *  the sunlight that a planet reflects, too, if Python's `radiation` is a PlanetRadiation.
 *  Assumptions: the cosine law; the efficiency does not depend on temperature, voltage or age; no panel shades another.
 *  Source: the definition of efficiency. */
typedef struct SolarArray {
    struct {
        CraftState truth;
        Illumination light;
        PanelAngles angles; ///< optional: without it no panel is turned
    } in;
    struct {
        ArrayPower array;
    } out;
    struct {
        uint32_t n; ///< [-] required, in [1, 8]: number of panels
        uint32_t spare;
        Vec3 normals_B[SOLAR_PANELS_MAX]; ///< [-] required, count n, non-zero: where they look, at the angle 0
        Vec3 axes_B[SOLAR_PANELS_MAX];    ///< [-] count n: about which each turns; 0: it is fixed
        double areas[SOLAR_PANELS_MAX];   ///< [m^2] required, count n, > 0, <= 1e6: of the cells
        double efficiency;                ///< [-] required, in [0, 1]: electrical power per power of the light
    } par;
} SolarArray;

#endif
