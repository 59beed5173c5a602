/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_FIELD_DIRECTION_H
#define FLIGHT_SENSING_FIELD_DIRECTION_H

#include "flight/msg/magnetics.h"
#include "flight/msg/navigation.h"

/** Pairs the direction of the measured magnetic field with that of the known one. With errors of both fields of
 *  `noise` about each axis, the direction's error is
 *      std' = sqrt(std^2 + (noise / |B_N|)^2).
 *  A pair whose magnitudes differ by more than `differ`, relative to the known one, is refused and counted: so is what
 *  a torque rod disturbs strongly, and a magnetometer out of its range. Each measurement is looked at once, and given
 *  with its time: until the next, the output stays as it is. One of a time to come waits. Without both fields, or
 *  where a pair is refused, the output is held, degraded.
 *  Assumption: the known field is that at the time of the measurement; in a low orbit, its direction turns by up to
 *  0.2 degrees a second. */
typedef struct FieldDirection {
    struct {
        MeasuredField field;
        KnownField known;
    } in;
    struct {
        SeenDirection seen;
        FieldAgreement agreement;
    } out;
    struct {
        double std;   ///< [rad] required, > 0: standard deviation of the direction about each axis across, in any field
        double noise; ///< [T] >= 0: and of the fields' error about each axis, with a bias that is not known
        double differ; ///< [-] required, > 0: largest difference of the magnitudes, relative to the known field
    } par;
} FieldDirection;

void field_direction_reset(FieldDirection *m);
void field_direction_update(FieldDirection *m, Tick t);

#endif
