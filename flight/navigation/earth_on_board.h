/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_EARTH_ON_BOARD_H
#define FLIGHT_NAVIGATION_EARTH_ON_BOARD_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"

/** How the Earth is turned, by theory, from UTC:
 *     [PN] = R3(GMST(UTC + dut1)) [TEME N],   omega_PN = 7.292115146706979e-5 rad/s about the pole
 *  with precession, nutation and sidereal time as earth_orientation.h has them. With dut1 = UT1 - UTC the axes are
 *  within an arcsecond of the Earth's, which is 31 m on the ground; what is left is polar motion. Each second of dut1
 *  that is left out is 15 arcsec, 460 m; UTC keeps it below 0.9 s.
 *  Without the time nothing is written. Before 2000 and from 2050 on the output is degraded.
 *  Source: Vallado, section 3.7. */
typedef struct EarthOnBoard {
    struct {
        UtcTime time;
    } in;
    struct {
        PlanetAttitude earth;
        BodyState centre; ///< of the Earth, where N has its origin: for TwoBodyPointing
    } out;
    struct {
        double dut1; ///< [s] in [-1, 1]: UT1 - UTC, as the IERS announces it
    } par;
} EarthOnBoard;

void earth_on_board_reset(EarthOnBoard *m);
void earth_on_board_update(EarthOnBoard *m, Tick t);

#endif
