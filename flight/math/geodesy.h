/* SPDX-License-Identifier: Apache-2.0 */
/* Places on an ellipsoid of revolution. */
#ifndef FLIGHT_MATH_GEODESY_H
#define FLIGHT_MATH_GEODESY_H

#include "flight/math/vec.h"

/** A place on a planet P, and the directions of its horizon: components in P, whose third axis is the pole. */
typedef struct GroundPlace {
    Vec3 r; /* [m] from the planet's centre */
    Vec3 east, north, up;
} GroundPlace;

/** The place at a longitude, a geodetic latitude [rad] and an altitude over the ellipsoid [m].
 *  Source: Vallado, section 3.2. */
static inline GroundPlace ground_place(double longitude, double latitude, double altitude, double radius,
                                       double flattening)
{
    double sl, cl, sp, cp;
    fm_sincos(longitude, &sl, &cl);
    fm_sincos(latitude, &sp, &cp);
    const double e2 = flattening * (2.0 - flattening);
    const double across = radius / fm_sqrt(1.0 - e2 * sp * sp); /* radius of curvature towards the pole's axis */
    const double around = (across + altitude) * cp;
    return (GroundPlace){vec3(around * cl, around * sl, (across * (1.0 - e2) + altitude) * sp), vec3(-sl, cl, 0.0),
                         vec3(-sp * cl, -sp * sl, cp), vec3(cp * cl, cp * sl, sp)};
}

#endif
