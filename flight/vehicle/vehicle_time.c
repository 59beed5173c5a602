/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/vehicle/vehicle_time.h"

#include <string.h>

void vehicle_time_reset(VehicleTime *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static void give(ClockCommand *command, const ClockReading *clock, ClockCode code, int64_t value)
{
    command->code = code;
    command->number = clock->done + 1u;
    command->value = clock_time(value);
}

void vehicle_time_update(VehicleTime *m, Tick t)
{
    const ClockReading *clock = &m->in.clock;
    VehicleTimeState *time = &m->out.time;
    ClockCommand *command = &m->out.command;
    if (!head_written(clock->head)) {
        time->head = head_held(time->head);
        command->head = head_held(command->head);
        return;
    }
    const int waits = command->code != CLOCK_GOES_ON && command->number != clock->done;
    if (clock->pulses != m->mem.pulses && clock->pulses != 0u) {
        m->mem.pulses = clock->pulses;
        time->error = tick_since(clock_ns(clock->tone), clock_ns(clock->master));
        const int64_t size = time->error < 0 ? -time->error : time->error;
        time->synchronized = size <= m->par.jam_beyond ? 1u : 0u;
        if (!waits && clock->busy == 0u && size > m->par.jam_beyond) {
            give(command, clock, CLOCK_ALIGN, clock_ns(clock->master) + m->par.pulse);
            time->jams++;
        } else if (!waits && clock->busy == 0u && size > m->par.allowed) {
            give(command, clock, CLOCK_SLEW, -time->error);
        }
    }
    const Quality quality = quality_through(clock->head);
    time->time = clock_ns(clock->time);
    time->head =
        head_next(time->head, t.t, quality_min(quality, time->synchronized != 0u ? QUALITY_GOOD : QUALITY_DEGRADED));
    command->head = head_next(command->head, t.t, quality);
}
