/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_MAGNETISM_H
#define WORLD_ENVIRONMENT_MAGNETISM_H

#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** The magnetic field of a body, which turns with it: a dipole in the body's centre, or a model in spherical harmonics.
 *  Python's `body` is the body, `sky` says where it is and how it turns, `coefficients` is "WMM2025" or "IGRF-14", or
 *  the path of a file of coefficients (.COF); it needs a sky, for its epoch and the attitude of the Earth.
 *  Assumptions: no currents in the ionosphere and beyond, no storms.
 *  Source: the technical report of the World Magnetic Model (NOAA NCEI, BGS). */
typedef struct Magnetism {
    struct {
        CraftState truth;
    } in;
    struct {
        MagneticField field;
    } out;
    struct {
        Vec3 dipole_P;    ///< [T m^3] moment times mu0 / 4 pi, in axes fixed in the body; of the Earth, about
                          ///< [-3.6e14, 1.2e15, -7.6e15]; not with coefficients
        double tolerance; ///< [T] 0, or >= 1e-14: the largest error of a polynomial in cubes that replaces the sums
                          ///< of a file, because it takes less time; 0: the sums
        double spin;      ///< [rad/s] >= -1, <= 1: rate of the body about its pole, if there is no sky
        uint32_t degree;  ///< [-] in [0, 20]: highest degree of the coefficients; 0: all; 1: its tilted dipole
        uint32_t spare;
    } par;
} Magnetism;

#endif
