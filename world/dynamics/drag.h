/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_DRAG_H
#define WORLD_DYNAMICS_DRAG_H

#include "world/msg/craft.h"

#define DRAG_FACETS_MAX 16

/** The drag of the air, a part of a spacecraft: of a sphere of an area, or of flat facets. Python's `air` is the
 *  model of the atmosphere. It acts at each stage of the integrator, where the craft is then, in the wind of the
 *  turning air. A facet that is mounted on a panel of the attribute `panels`, counted from 1, turns with it, and its
 *  force turns the hinge; normals_B and centres_B are for theta = 0.
 *  Assumptions: each area feels 1/2 density Cd v^2 times its projection, along the wind, without lift; facets do
 *  not shade one another, and feel the wind on the side of their normal; turning and moving panels add no wind.
 *  Source: Montenbruck and Gill, section 3.5. */
typedef struct Drag {
    struct {
        ForceTorque load; ///< what the air does to the spacecraft
    } out;
    struct {
        double Cd;     ///< [-] required, > 0, <= 1e3: drag coefficient
        double area;   ///< [m^2] >= 0, <= 1e9: cross section, without facets
        Vec3 centre_B; ///< [m] centre of pressure, in B, without facets
        uint32_t n;    ///< [-] in [0, 16]: number of facets
        uint32_t spare;
        Vec3 normals_B[DRAG_FACETS_MAX]; ///< [-] count n, non-zero: outward normals of the facets
        double areas[DRAG_FACETS_MAX];   ///< [m^2] count n, >= 0, <= 1e9: areas of the facets
        Vec3 centres_B[DRAG_FACETS_MAX]; ///< [m] count n: middles of the facets, in B
        uint32_t panel[DRAG_FACETS_MAX]; ///< [-] count n, in [0, 8], initial: of `panels`, that it is on; 0: none
    } par;
} Drag;

#endif
