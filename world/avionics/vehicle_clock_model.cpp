// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/vehicle_clock_model.h"

#include "flight/exec/drift.h"

namespace fledge::world {

void VehicleClockModel::prepare(const sim::Setup &) {}

void VehicleClockModel::reset(sim::Ns t)
{
    interface_.out = {};
    interface_.mem = {};
    interface_.mem.since = t;
    interface_.mem.base = interface_.par.start;
}

void VehicleClockModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const auto &[command, computer] = interface_.in;
    auto &mem = interface_.mem;
    ClockReading &out = interface_.out.reading;
    const std::int64_t before = tick.t - tick.dt;

    ExecClock slave = {mem.since, mem.base, mem.offset, par.drift, par.slew};
    const std::int64_t first = before / par.pulse + (out.head.sequence != 0), last = tick.t / par.pulse;
    if (computer.count != mem.resets) { // a pulse at that time is lost
        mem.resets = computer.count;
        mem.aligning = out.done = out.pulses = 0;
        exec_clock_set(&slave, tick.t, par.start, 0);
        out.tone = clock_time(par.start);
    } else {
        if (command.code != CLOCK_GOES_ON && command.number != out.done) {
            out.done = command.number;
            mem.aligning = command.code == CLOCK_ALIGN;
            mem.aligned = clock_ns(command.value);
            if (command.code == CLOCK_JAM) {
                exec_clock_set(&slave, before, clock_ns(command.value), 0);
            } else if (command.code == CLOCK_SLEW) {
                exec_clock_set(&slave, before, exec_clock_time(&slave, before), clock_ns(command.value));
            }
        }
        if (first <= last) {
            if (mem.aligning) {
                exec_clock_set(&slave, first * par.pulse, mem.aligned, 0);
                mem.aligning = 0;
            }
            out.tone = clock_time(exec_clock_time(&slave, last * par.pulse));
            out.master = clock_time(par.epoch + last * par.pulse);
            out.pulses += static_cast<std::uint32_t>(last - first + 1);
        }
    }
    mem.since = slave.since;
    mem.base = slave.base;
    mem.offset = slave.offset;
    out.time = clock_time(exec_clock_time(&slave, tick.t));
    out.busy = mem.aligning || exec_clock_gained(&slave, tick.t) != slave.offset;
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
