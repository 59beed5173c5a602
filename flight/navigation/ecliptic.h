/* SPDX-License-Identifier: Apache-2.0 */
/* Private to SunOnBoard and MoonOnBoard: from the ecliptic and equinox of date to N, and a motion from three places. */
#ifndef FLIGHT_NAVIGATION_ECLIPTIC_H
#define FLIGHT_NAVIGATION_ECLIPTIC_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"
#include "flight/navigation/earth_orientation.h"

#define ECLIPTIC_STEP 600.0 /* [s] between the places */
#define ECLIPTIC_DEG 0.017453292519943295

/** [m] A place of longitude, latitude [rad] and distance [m], T centuries after J2000; N components. */
static inline Vec3 ecliptic_to_N(double T, double longitude, double latitude, double distance)
{
    double sl, cl, sb, cb;
    fm_sincos(longitude, &sl, &cl);
    fm_sincos(latitude, &sb, &cb);
    const Vec3 r = vec_scale(distance, vec3(cb * cl, cb * sl, sb));
    const Mat3 of_date = mat_mul(earth_R1(earth_obliquity(T)), earth_precession(T));
    return mat_transpose_vec(of_date, r);
}

/** [-] The centuries of the k-th of the three places about `days`, k = -1, 0, 1. */
static inline double ecliptic_centuries(double days, int k)
{
    return earth_centuries(days + k * (ECLIPTIC_STEP / 86400.0));
}

/** The body at places[1], with the central differences of the three as velocity and acceleration. */
static inline void ecliptic_put(BodyState *body, UtcTime time, Tick t, const Vec3 *places)
{
    const double h = ECLIPTIC_STEP;
    const Vec3 ahead = vec_sub(places[2], places[1]), behind = vec_sub(places[1], places[0]);
    const Vec3 v = vec_scale(0.5 / h, vec_add(ahead, behind)), a = vec_scale(1.0 / (h * h), vec_sub(ahead, behind));
    /* undecided: a guard; at each time that int64_t has, the places are finite */
    if (head_written(time.head) && vec_finite(places[1]) && vec_finite(v) && vec_finite(a)) {
        const Quality known = earth_known(earth_days(time.time)) ? QUALITY_GOOD : QUALITY_DEGRADED;
        const Quality quality = quality_min(quality_through(time.head), known);
        *body = (BodyState){head_next(body->head, t.t, quality), places[1], v, a};
    } else {
        body->head = head_held(body->head);
    }
}

#endif
