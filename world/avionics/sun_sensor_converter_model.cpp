// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/sun_sensor_converter_model.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

void SunSensorConverterModel::check() const
{
    Sensor::check();
    const std::uint32_t n = interface_.par.n, first = interface_.par.first;
    if (first + n > SUN_SENSORS_MAX) {
        throw sim::SetupError(name_ + " has " + std::to_string(n) + " channels from sensor " + std::to_string(first) +
                              " on, but there are " + std::to_string(SUN_SENSORS_MAX) + " sensors");
    }
}

void SunSensorConverterModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const SunCurrents &currents = interface_.in.currents;
    SunSensorCounts &out = interface_.out.counts;
    const double most = (1u << par.bits) - 1u;
    begin_faults(tick.t);
    bool speaks = false;
    for (std::uint32_t i = 0; i < par.n; i++) {
        // Each channel draws, so that a fault of one leaves the others as they were.
        const double noise = par.noise > 0.0 ? par.noise * normal() : 0.0;
        double count = std::clamp((currents.current[par.first + i] + noise - par.offset) / par.scale, 0.0, most);
        speaks |= state_.faults.apply(i, {&count, 1}, 0.0, most);
        out.counts[i] = static_cast<std::uint16_t>(std::clamp(std::round(count), 0.0, most));
    }
    out.head = head_of_reading(out.head, tick.t, quality_through(currents.head), speaks && powered());
}

} // namespace fledge::world
