/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ENVIRONMENT_GROUND_STATION_H
#define WORLD_ENVIRONMENT_GROUND_STATION_H

#include "flight/msg/ground.h"
#include "flight/msg/orbit.h"
#include "world/msg/craft.h"

/** A station on the ground of a body: its motion, and where it sees the spacecraft. Python's `body` is the body,
 *  `sky` says where it is and how it turns. Coordinates are geodetic, over the body's ellipsoid: WGS 84 for the
 *  Earth; the horizon is perpendicular to the ellipsoid's normal.
 *  Assumptions: geometric, neither light time nor refraction; the horizon has no mountains but the mask. */
typedef struct GroundStation {
    struct {
        CraftState truth;
    } in;
    struct {
        BodyState state; ///< of the station, for pointing at it; its acceleration is that of the turn alone
        GroundContact contact;
    } out;
    struct {
        double latitude;  ///< [rad] required, in [-1.5707963267948966, 1.5707963267948966]: geodetic
        double longitude; ///< [rad] required, in [-6.283185307179586, 6.283185307179586]: east
        double altitude;  ///< [m] >= -1e6, <= 1e9: over the ellipsoid
        double mask;      ///< [rad] in [-1.5707963267948966, 1.5707963267948966]: lowest elevation of a contact
        double spin;      ///< [rad/s] >= -1, <= 1: rate of the body about its pole, if there is no sky
    } par;
} GroundStation;

#endif
