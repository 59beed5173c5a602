// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/sun_sensor_converter_model.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

void SunSensorConverterModel::reset(sim::Ns)
{
    random_ = seeded_;
    interface_.out = {};
}

void SunSensorConverterModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const SunCurrents &currents = interface_.in.currents;
    SunSensorCounts &out = interface_.out.counts;
    const double most = (1u << par.bits) - 1u;
    const bool faulty = tick.t >= par.fault_from && (par.fault_until == 0 || tick.t < par.fault_until);
    for (std::uint32_t i = 0; i < par.n; i++) {
        // Each channel draws, so that a fault of one leaves the others as they were.
        const double noise = par.noise > 0.0 ? par.noise * random_.normal() : 0.0;
        double count = std::clamp(std::round((currents.current[i] + noise - par.offset) / par.scale), 0.0, most);
        switch (faulty ? par.fault[i] : CHANNEL_SOUND) {
        case CHANNEL_SOUND: break;
        case CHANNEL_HIGH: count = most; break;
        case CHANNEL_LOW: count = 0.0; break;
        case CHANNEL_BABBLES: count = std::floor(random_.uniform() * (most + 1.0)); break;
        }
        out.counts[i] = static_cast<std::uint16_t>(count);
    }
    out.head = head_next(out.head, tick.t, quality_through(currents.head));
}

} // namespace fledge::world
