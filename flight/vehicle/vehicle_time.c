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

static void publish(VehicleTime *m, int64_t t, VehicleTimeEventId id, EventSeverity severity)
{
    event_publish(
        &m->out.event, t,
        (FlightEvent){.id = id, .severity = severity, .arguments = {(double)m->out.time.error, m->out.time.jams}});
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
        const uint32_t synchronized = size <= m->par.jam_beyond ? 1u : 0u;
        if (synchronized != time->synchronized) {
            time->synchronized = synchronized;
            publish(m, t.t, synchronized != 0u ? VEHICLE_TIME_FOUND : VEHICLE_TIME_LOST,
                    synchronized != 0u ? EVENT_INFO : EVENT_LOW);
        }
        if (!waits && clock->busy == 0u && size > m->par.jam_beyond) {
            give(command, clock, CLOCK_ALIGN, tick_since(clock_ns(clock->master), -m->par.pulse));
            time->jams++;
            publish(m, t.t, VEHICLE_TIME_JUMPS, EVENT_MEDIUM);
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
