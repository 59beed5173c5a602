// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/sun_sensor_converter.h.
#pragma once

#include "sim/model.h"
#include "sim/random.h"
#include "world/avionics/sun_sensor_converter.h"

namespace fledge::world {

class SunSensorConverterModel final : public sim::Model {
public:
    explicit SunSensorConverterModel(SunSensorConverter &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override { seeded_ = sim::Random(setup.seed, setup.name); }
    void reset(sim::Ns t) override;
    void update(Tick tick) override;
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&random_, 1)); }

private:
    SunSensorConverter &interface_;
    sim::Random seeded_; ///< the stream as each run begins it
    sim::Random random_;
};

} // namespace fledge::world
