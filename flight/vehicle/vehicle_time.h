/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_VEHICLE_VEHICLE_TIME_H
#define FLIGHT_VEHICLE_VEHICLE_TIME_H

#include "flight/msg/avionics.h"
#include "flight/msg/event.h"

/** Its events. */
typedef enum VehicleTimeEventId {
    VEHICLE_TIME_JUMPS = 1, ///< medium, error [ns], jams [-]: the clock is aligned at the next pulse; error: of the
                            ///< slave's time; jams: how many alignments there were
    VEHICLE_TIME_LOST = 2,  ///< low, error [ns]: the clock is no longer synchronized
    VEHICLE_TIME_FOUND = 3  ///< info, error [ns]: the clock is synchronized
} VehicleTimeEventId;

/** Keep the computer's slave clock at the vehicle's master. At each new pulse the slave's time is compared with the
 *  master's. A large error is removed at the next pulse, by aligning the slave with the master's time then; a small one
 *  is slewed, so that the time does not jump. The next command waits until the clock has finished the last one. */
typedef struct VehicleTime {
    struct {
        ClockReading clock;
    } in;
    struct {
        VehicleTimeState time;
        ClockCommand command;
        FlightEvent event;
    } out;
    struct {
        int64_t pulse;      ///< [ns] required, > 0: of the master, from pulse to pulse
        int64_t jam_beyond; ///< [ns] required, > 0: an error above this is removed at once
        int64_t allowed;    ///< [ns] >= 0: an error up to this stays as it is
    } par;
    struct {
        uint32_t pulses; ///< [-] seen until now
        uint32_t spare;
    } mem;
} VehicleTime;

void vehicle_time_reset(VehicleTime *m);
void vehicle_time_update(VehicleTime *m, Tick t);

#endif
