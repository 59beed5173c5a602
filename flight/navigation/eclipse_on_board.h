/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ECLIPSE_ON_BOARD_H
#define FLIGHT_NAVIGATION_ECLIPSE_ON_BOARD_H

#include "flight/msg/orbit.h"

/** How much of the Sun a body hides, and until when. Sun and body are spheres; along, across: the spacecraft from the
 *  body's centre along and across the line from the Sun, at the distance D. The cones of the shadows touch both:
 *      umbra:     across cos x + along sin x < R,   sin x = (R_sun - R) / D
 *      penumbra:  across cos y - along sin y < R,   sin y = (R_sun + R) / D
 *  In the penumbra the lit part is that of two circles on the sky, to 3e-4. A flat body, whose pole is the third axis
 *  of N, is made a sphere by stretching space along the pole: that adds an error of up to 0.6 of the flattening.
 *  With mu, the next change of the phase is looked for over one revolution of the ellipse about N's origin on which the
 *  spacecraft is now, at 128 places and then between two of them, while Sun and body move on straight lines; a phase
 *  that begins and ends between two places is not seen. On no ellipse, no change is known.
 *  Without orbit or Sun, or at a place inside one of the two bodies, nothing is written.
 *  Source: Montenbruck and Gill, section 3.4.2; Battin, chapter 4. */
typedef struct EclipseOnBoard {
    struct {
        NavOrbit orbit;
        BodyState sun;  ///< relative to the origin of N
        BodyState body; ///< optional: what may hide the Sun; without it, the body in the origin of N
    } in;
    struct {
        ShadowState shadow;
    } out;
    struct {
        double radius;     ///< [m] required, > 0: of the body, at its equator
        double flattening; ///< [-] in [0, 0.5]: of the body; 0: a sphere
        double mu;         ///< [m^3/s^2] >= 0: of the body in the origin of N; 0: no change is looked for
    } par;
} EclipseOnBoard;

void eclipse_on_board_reset(EclipseOnBoard *m);
void eclipse_on_board_update(EclipseOnBoard *m, Tick t);

#endif
