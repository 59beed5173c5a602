/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_CHEBYSHEV_EPHEMERIS_H
#define FLIGHT_NAVIGATION_CHEBYSHEV_EPHEMERIS_H

#include "flight/msg/ephemeris.h"
#include "flight/msg/orbit.h"

#define EPHEMERIS_BLOCKS 4

/** The motion of a body by Chebyshev polynomials: by the last four blocks that arrived, the newest first, else by the
 *  segments among the parameters. `world.fit_ephemeris` makes both from a Sky. Velocity and acceleration are the
 *  derivatives of the position. At a time that nothing covers, the output is held, degraded.
 *  Source: NAIF, SPK Required Reading, type 2. */
typedef struct ChebyshevEphemeris {
    struct {
        EphemerisTime time;   ///< optional: without it, flight's time is that of the ephemeris
        EphemerisBlock block; ///< optional: what the ground sends
    } in;
    struct {
        BodyState body;
        EphemerisState state;
    } out;
    struct {
        int64_t start;                               ///< [ns] of the ephemeris' time: of the first segment
        int64_t duration;                            ///< [ns] >= 0: of each segment
        uint32_t segments;                           ///< [-] in [0, 8]: number of segments; 0: blocks alone
        uint32_t n;                                  ///< [-] in [0, 16]: number of coefficients of each
        Vec3 c[EPHEMERIS_SEGMENTS][EPHEMERIS_TERMS]; ///< [m] coefficients, N components
    } par;
    struct {
        EphemerisBlock blocks[EPHEMERIS_BLOCKS]; ///< taken, in a ring
        uint32_t next;                           ///< [-] the block to be replaced next
        uint32_t number;                         ///< [-] number of the last block that was looked at
        uint32_t any;                            ///< [-] 1 once a block was looked at
        uint32_t taken;                          ///< [-] blocks
        uint32_t refused;                        ///< [-] blocks
        uint32_t spare;
    } mem;
} ChebyshevEphemeris;

void chebyshev_ephemeris_reset(ChebyshevEphemeris *m);
void chebyshev_ephemeris_update(ChebyshevEphemeris *m, Tick t);

#endif
