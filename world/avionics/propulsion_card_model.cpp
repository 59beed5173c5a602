// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/propulsion_card_model.h"

#include "flight/exec/task.h"

#include <algorithm>

namespace fledge::world {

void PropulsionCardModel::prepare(const sim::Setup &) {}

void PropulsionCardModel::reset(sim::Ns)
{
    interface_.out = {};
    interface_.mem = {};
}

void PropulsionCardModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const auto &[burn, power] = interface_.in;
    auto &mem = interface_.mem;
    auto &[thrusters, state] = interface_.out;

    const bool powered = !head_written(power.head) || (power.on >> par.load & 1u);
    state.armed = powered && burn.armed;
    if (burn.number != 0 && burn.number != state.number) {
        state.number = burn.number;
        if (state.armed && burn.thruster < par.n && burn.duration > 0 && burn.duration >= par.min_on &&
            state.queued < BURNS_QUEUED) {
            mem.start[state.queued] = std::max(burn.start, tick.t);
            mem.duration[state.queued] = burn.duration;
            mem.thruster[state.queued++] = burn.thruster;
        } else {
            state.refused++;
        }
    }
    if (!state.armed) {
        state.queued = 0;
        for (std::uint32_t i = 0; i < par.n; i++) {
            thrusters.off[i] = std::min(thrusters.off[i], std::max(tick.t, thrusters.on[i]));
        }
    }
    // The burns that begin in the step until now; the others move up.
    std::uint32_t kept = 0;
    std::uint32_t waits = 0; // thrusters whose next burn has to wait
    for (std::uint32_t k = 0; k < state.queued; k++) {
        const std::uint32_t i = mem.thruster[k];
        const std::int64_t start = std::max({mem.start[k], thrusters.off[i], tick.t - tick.dt});
        if (start <= tick.t && !(waits >> i & 1u)) {
            thrusters.on[i] = start;
            thrusters.off[i] = exec_later(start, mem.duration[k]);
            thrusters.burns[i]++;
            state.begun++;
            waits |= 1u << i; // an update shows one burn of a thruster
        } else {
            waits |= 1u << i;
            mem.start[kept] = mem.start[k];
            mem.duration[kept] = mem.duration[k];
            mem.thruster[kept++] = i;
        }
    }
    state.queued = kept;
    thrusters.head = head_next(thrusters.head, tick.t, QUALITY_GOOD);
    state.head = head_next(state.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
