/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_TACHOMETER_SPEEDS_H
#define FLIGHT_SENSING_TACHOMETER_SPEEDS_H

#include "flight/msg/avionics.h"

/** The speeds of the wheels from the counts of their tachometers: the mean over the last window. */
typedef struct TachometerSpeeds {
    struct {
        WheelTachometers tachometers;
    } in;
    struct {
        WheelSpeeds speeds;
    } out;
    struct {
        uint32_t marks; ///< [-] required, in [1, 1000000]: of a tachometer, in one turn
        uint32_t spare;
        int64_t window; ///< [ns] required, > 0: in which it counts
    } par;
} TachometerSpeeds;

void tachometer_speeds_reset(TachometerSpeeds *m);
void tachometer_speeds_update(TachometerSpeeds *m, Tick t);

#endif
