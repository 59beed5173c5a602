/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_SUN_ON_BOARD_H
#define FLIGHT_NAVIGATION_SUN_ON_BOARD_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"

/** Where the Sun is relative to the Earth's centre, by theory, from UTC: the Earth's ellipse, whose elements change,
 *  with the largest perturbations by Venus, Jupiter and the Moon, turned from the ecliptic of date to N.
 *      longitude = L + (equation of the centre),   r = 1 AU a (1 - e^2) / (1 + e cos(anomaly))
 *  Velocity and acceleration are differences of the position over 10 minutes.
 *  From 2000 to 2050 within 9 arcsec and 3,000 km of JPL's DE405. The position is the geometric one: the Sun is
 *  seen 20 arcsec behind it, as its light is late. Without the time nothing is written; outside these years the output
 *  is degraded.
 *  Sources: Meeus, chapter 25; VSOP87 (Bretagnon and Francou 1988) for the perturbations. */
typedef struct SunOnBoard {
    struct {
        UtcTime time;
    } in;
    struct {
        BodyState sun; ///< relative to the Earth's centre
    } out;
} SunOnBoard;

void sun_on_board_reset(SunOnBoard *m);
void sun_on_board_update(SunOnBoard *m, Tick t);

#endif
