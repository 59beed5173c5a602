/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_ARRAY_POINTING_H
#define FLIGHT_GUIDANCE_ARRAY_POINTING_H

#include "flight/math/vec.h"
#include "flight/msg/avionics.h"
#include "flight/msg/sun.h"

/** Turn solar arrays about their axes towards the Sun, by drives that make steps: to the angle at which the normal is
 *  nearest to the Sun, which is where both have the same direction across the axis,
 *      theta = atan2(a . (n x s), n . s - (a . n) (a . s)).
 *  Of a drive without stops, the target is the nearest of that angle's turns. A drive with stops takes the turn within
 *  its range, else the end that is nearer. A target moves only if it is off by more than the dead band. Without a good
 *  direction of the Sun, and where it is nearly along the axis, the targets stay.
 *  A drive is stuck that for `persistence` has come no nearer to its target. */
typedef struct ArrayPointing {
    struct {
        SunHeading sun;
        ArrayDriveState drive;
    } in;
    struct {
        ArrayDriveCommand command;
        ArrayPointingState state;
    } out;
    struct {
        uint32_t n;                 ///< [-] required, in [1, 4]: number of arrays
        int32_t range;              ///< [-] >= 0: steps to the stop at either side; 0: they turn without end
        Vec3 axes_B[ARRAYS_MAX];    ///< [-] required, count n, non-zero: about which each array turns
        Vec3 normals_B[ARRAYS_MAX]; ///< [-] required, count n, non-zero: of each array, at its angle 0
        double step;                ///< [rad] required, in [1e-6, 1]: of one step
        double count;               ///< [rad] required, in [1e-9, 1]: of one count of the position
        double dead_band;           ///< [rad] in [0, 1]: by which an array may be off
        int64_t persistence;        ///< [ns] >= 0: how long a drive may stand away from its target; 0: for ever
    } par;
    struct {
        int64_t nearer[ARRAYS_MAX]; ///< [ns] when each drive came nearer to its target, or had none
        double left[ARRAYS_MAX];    ///< [rad] to its target then
    } mem;
} ArrayPointing;

void array_pointing_reset(ArrayPointing *m);
void array_pointing_update(ArrayPointing *m, Tick t);

#endif
