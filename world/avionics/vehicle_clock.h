/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_VEHICLE_CLOCK_H
#define WORLD_AVIONICS_VEHICLE_CLOCK_H

#include "flight/msg/avionics.h"
#include "flight/msg/computer.h"

/** The vehicle's time: a master clock, whose pulses and time at each pulse reach the computer, and the computer's slave
 *  clock, which drifts and which flight jams, slews, or aligns with a pulse. A reset of the computer starts the slave
 *  anew. A command acts from the update before, at which flight gave it.
 *  Assumptions: the master is exact; pulses are at the multiples of `pulse` of simulated time.
 *  Source: thesis sections 5.3.2 and 5.4.2; the law of flight/exec/drift.h. */
typedef struct VehicleClock {
    struct {
        ClockCommand command;   ///< optional: without it the slave goes on
        ComputerReset computer; ///< optional: resets of the computer
    } in;
    struct {
        ClockReading reading;
    } out;
    struct {
        int64_t epoch; ///< [ns] >= 0, <= 2e18: the master's time at the beginning of the run
        int64_t start; ///< [ns] >= 0, <= 2e18: the slave's time at its start
        int64_t pulse; ///< [ns] required, > 0: from pulse to pulse
        int32_t drift; ///< [-] in [-1000000000, 1000000000]: ns per second by which the slave gains
        int32_t slew;  ///< [-] required, in [1, 1000000000]: ns per second at which it gains or loses an offset
    } par;
    struct {
        int64_t since;     ///< [ns] when the slave was set
        int64_t base;      ///< [ns] its time then
        int64_t offset;    ///< [ns] what it shall gain from then on
        int64_t aligned;   ///< [ns] its time at the next pulse, if it aligns
        uint32_t aligning; ///< [-] 1: it waits for the pulse
        uint32_t resets;   ///< [-] of the computer, as seen last
    } mem;
} VehicleClock;

#endif
