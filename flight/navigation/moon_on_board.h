/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_MOON_ON_BOARD_H
#define FLIGHT_NAVIGATION_MOON_ON_BOARD_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"

/** Where the Moon is relative to the Earth's centre, by theory, from UTC: the largest terms of ELP-2000/82, 25 of them
 *  in longitude and distance, 13 in latitude, turned from the ecliptic of date to N. Their arguments are sums of the
 *  Moon's elongation D, the anomalies M and M' of Sun and Moon, and the Moon's argument of latitude F:
 *      longitude = L' + sum l_k sin x_k,   distance = 385,000.56 km + sum r_k cos x_k,   latitude = sum b_k sin y_k
 *  Velocity and acceleration are differences of the position over 10 minutes.
 *  From 2000 to 2050 within 0.035 deg and 85 km of JPL's DE405: the Moon's disc has a diameter of half a degree.
 *  Without the time nothing is written; outside these years the output is degraded.
 *  Source: Meeus, chapter 47. */
typedef struct MoonOnBoard {
    struct {
        UtcTime time;
    } in;
    struct {
        BodyState moon; ///< relative to the Earth's centre
    } out;
} MoonOnBoard;

void moon_on_board_reset(MoonOnBoard *m);
void moon_on_board_update(MoonOnBoard *m, Tick t);

#endif
