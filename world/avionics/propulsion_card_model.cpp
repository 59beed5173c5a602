// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/propulsion_card_model.h"

#include "flight/exec/task.h"

#include <algorithm>

namespace fledge::world {

void PropulsionCardModel::reset(sim::Ns t)
{
    Sensor::reset(t);
    std::fill(std::begin(interface_.mem.taken), std::end(interface_.mem.taken), -1);
}

/// From the beginning of this step on.
void PropulsionCardModel::shut(std::size_t i, Tick tick)
{
    ThrusterTimes &times = interface_.out.thrusters;
    times.off[i] = std::min(times.off[i], std::max(tick.t - tick.dt, times.on[i]));
}

/// The command of a thruster, of a card that is armed.
void PropulsionCardModel::command(std::size_t i, Tick tick)
{
    const auto &par = interface_.par;
    const PropulsionCommand &wanted = interface_.in.command;
    auto &[times, state] = interface_.out;
    auto &mem = interface_.mem;
    const sim::Ns start = wanted.start[i], duration = wanted.duration[i], end = exec_later(start, duration);
    const bool begins = duration > 0 && start <= tick.t && start != mem.taken[i];
    if (begins) {
        mem.taken[i] = start;
        mem.open &= ~(1u << i);
        if (i >= par.n || duration < par.min_on || end <= tick.t - tick.dt) {
            state.refused++;
        } else {
            mem.open |= 1u << i;
            times.on[i] = std::max(start, tick.t - tick.dt);
            times.burns[i]++;
            state.begun++;
        }
    }
    if (!(mem.open >> i & 1u) || duration <= 0 || start != mem.taken[i]) {
        shut(i, tick);
        mem.open &= ~(1u << i);
    } else {
        times.off[i] = std::max(end, times.on[i]);
    }
}

void PropulsionCardModel::update(Tick tick)
{
    const PropulsionCommand &wanted = interface_.in.command;
    auto &mem = interface_.mem;
    ThrusterTimes &times = interface_.out.thrusters;
    begin_faults(tick.t);
    const bool on = works(THRUSTERS_MAX) && powered();
    const bool armed = on && head_written(wanted.head) && wanted.armed != 0;
    if (on) {
        report();
    }
    interface_.out.state.head = head_next(interface_.out.state.head, tick.t, QUALITY_GOOD);
    mem.driven = 0;
    for (std::size_t i = 0; i < THRUSTERS_MAX; i++) {
        if (armed) {
            command(i, tick);
        } else {
            shut(i, tick);
            mem.open &= ~(1u << i);
            mem.taken[i] = -1;
        }
        const bool opened = std::max(times.on[i], tick.t - tick.dt) < std::min(times.off[i], tick.t);
        mem.driven |= opened ? 1u << i : 0u;
        mem.impulse[i] = interface_.in.thrust.impulse[i];
        if (!works(i)) {
            shut(i, tick);
        }
    }
    times.head = head_next(times.head, tick.t, QUALITY_GOOD);
}

/// The pressure sensors show the step before this one, which is not yet flown.
void PropulsionCardModel::report()
{
    const auto &[wanted, thrust, injected, power] = interface_.in;
    const auto &mem = interface_.mem;
    PropulsionState &state = interface_.out.state;
    state.counter++;
    state.number = wanted.number;
    state.armed = head_written(wanted.head) && wanted.armed != 0;
    for (std::size_t i = 0; i < interface_.par.n; i++) {
        const bool driven = mem.driven >> i & 1u;
        state.driven[i] += driven;
        state.flowing[i] += head_written(thrust.head) ? thrust.impulse[i] > mem.impulse[i] : driven;
    }
}

} // namespace fledge::world
