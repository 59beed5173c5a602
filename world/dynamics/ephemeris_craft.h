/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_EPHEMERIS_CRAFT_H
#define WORLD_DYNAMICS_EPHEMERIS_CRAFT_H

#include "world/msg/craft.h"

/** A spacecraft that follows the orbit and the attitude of files, as an OEM and an AEM, in the place of a Spacecraft.
 *  Python's `orbit` and `attitude` are the files, and `sky` says what their dates and frames are. Without an attitude B
 *  stays along N; without an orbit it stays in N's origin.
 *  Between the lines of an orbit with velocities goes a polynomial through both, else through the positions alone, of
 *  the file's degree. Between attitudes with rates goes a cubic through both; else B turns about a fixed axis.
 *  Assumptions: nothing acts on it; its centre of mass is its origin, and all its acceleration is gravity's. */
typedef struct EphemerisCraft {
    struct {
        CraftState state;
    } out;
} EphemerisCraft;

#endif
