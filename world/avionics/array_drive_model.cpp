// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/array_drive_model.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace fledge::world {

void ArrayDriveModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const ArrayDriveCommand &command = interface_.in.command;
    auto &mem = interface_.mem;
    auto &[panels, angles, state] = interface_.out;
    const double dt = tick_seconds(tick.dt);
    const bool on = powered();
    std::uint32_t moving = 0;
    begin_faults(tick.t);
    for (std::size_t i = 0; i < par.n; i++) {
        const std::int64_t end = par.range > 0 ? par.range : std::numeric_limits<std::int32_t>::max();
        const std::int64_t target =
            head_written(command.head) ? std::clamp<std::int64_t>(command.target[i], -end, end) : mem.steps[i];
        const std::int64_t left = target - mem.steps[i];
        if (!works(i) || !on || left == 0) {
            mem.due[i] = 0.0;
        } else {
            mem.due[i] += par.rate * dt;
            const double whole = std::floor(mem.due[i] * (1.0 + 1e-12));
            const auto steps = std::min(static_cast<std::int64_t>(std::min(whole, 4e9)), std::abs(left));
            mem.steps[i] += static_cast<std::int32_t>(left > 0 ? steps : -steps);
            mem.due[i] = steps == std::abs(left) ? 0.0 : std::max(mem.due[i] - whole, 0.0);
            moving |= mem.steps[i] != target ? 1u << i : 0u;
        }
        const double before = angles.theta[i];
        angles.theta[i] = panels.theta[i] = par.step * mem.steps[i];
        angles.dtheta[i] = dt > 0.0 ? (angles.theta[i] - before) / dt : 0.0;
        if (on) {
            state.position[i] = static_cast<std::int32_t>(
                std::clamp(std::round(angles.theta[i] / par.count), -2147483647.0, 2147483647.0));
        }
    }
    if (on) {
        state.counter++;
        state.moving = moving;
    }
    for (Head *head : {&panels.head, &angles.head, &state.head}) {
        *head = head_next(*head, tick.t, QUALITY_GOOD);
    }
}

} // namespace fledge::world
