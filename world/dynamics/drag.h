/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_DRAG_H
#define WORLD_DYNAMICS_DRAG_H

#include "world/msg/craft.h"

#define DRAG_FACETS_MAX 16

/** The drag of the air, a part of a spacecraft: of a sphere of an area, or of flat facets. Python's `air` is the
 *  model of the atmosphere. It acts at each stage of the integrator, where the craft is then, in the wind of the
 *  turning air. A facet that is mounted on a panel of the attribute `panels`, counted from 1, turns with it, and its
 *  force turns the hinge; normals_B and centres_B are for theta = 0.
 *  With `Cd`, each area feels 1/2 density Cd v^2 times its projection, along the wind, without lift. With `T_wall` and
 *  `accommodation` in its place, it feels the free flow of molecules, which come with the wind and their heat, and
 *  leave in all directions: drag and lift of each facet, also on the lee side. `air` must know its temperature then.
 *  Assumptions: facets do not shade one another, and feel the wind on the side of their normal; molecules leave all
 *  facets with the same heat; turning and moving panels add no wind.
 *  Source: Montenbruck and Gill, section 3.5; Schaaf and Chambre 1961; Moe and Moe 2005. */
typedef struct Drag {
    struct {
        ForceTorque load; ///< what the air does to the spacecraft
    } out;
    struct {
        double Cd;            ///< [-] >= 0, <= 1e3: drag coefficient; 0: that of free molecular flow
        double T_wall;        ///< [K] >= 0, <= 1e4: temperature of the surface, in free molecular flow
        double accommodation; ///< [-] in [0, 1]: share of the energy that molecules exchange with the surface
        double area;          ///< [m^2] >= 0, <= 1e9: cross section, without facets
        Vec3 centre_B;        ///< [m] centre of pressure, in B, without facets
        uint32_t n;           ///< [-] in [0, 16]: number of facets
        uint32_t spare;
        Vec3 normals_B[DRAG_FACETS_MAX]; ///< [-] count n, non-zero: outward normals of the facets
        double areas[DRAG_FACETS_MAX];   ///< [m^2] count n, >= 0, <= 1e9: areas of the facets
        Vec3 centres_B[DRAG_FACETS_MAX]; ///< [m] count n: middles of the facets, in B
        uint32_t panel[DRAG_FACETS_MAX]; ///< [-] count n, in [0, 8], initial: of `panels`, that it is on; 0: none
    } par;
} Drag;

#endif
