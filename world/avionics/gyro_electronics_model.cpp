// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/gyro_electronics_model.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

void GyroElectronicsModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const GyroRate &rate = interface_.in.rate;
    GyroRegisters &out = interface_.out.registers;
    auto &mem = interface_.mem;
    begin_faults(tick.t);
    const bool fresh = head_written(rate.head) && rate.head.sequence != mem.sequence;
    mem.sequence = rate.head.sequence;
    if (!powered()) {
        mem.turned = {};
        mem.begun = 0;
        out.head = head_next(out.head, tick.t, QUALITY_GOOD);
        return;
    }
    if (fresh) {
        const double since = mem.begun ? tick_seconds(tick_since(rate.head.t, mem.sampled)) : 0.0;
        const double range = std::ldexp(1.0, static_cast<int>(par.bits));
        mem.turned = vec_add(mem.turned, vec_scale(since, rate.omega_BN_B));
        for (std::size_t i = 0; i < 3; i++) {
            const double counts = std::round(mem.turned.v[i] / par.scale);
            double count = counts - range * std::floor(counts / range);
            state_.faults.apply(i, {&count, 1}, 0.0, range - 1.0);
            out.angle[i] = static_cast<std::uint32_t>(std::clamp(std::round(count), 0.0, range - 1.0));
        }
        out.time = time_tag(rate.head.t, par.tick);
        out.counter = mem.begun ? out.counter + 1 : 1;
        mem.sampled = rate.head.t;
        mem.begun = 1;
    }
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
