// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/avionics/solar_array.h. All of its state is in the interface.
#pragma once

#include "world/avionics/solar_array.h"
#include "world/environment/planet_radiation_model.h"

namespace fledge::world {

class SolarArrayModel final : public PlanetViewer<sim::Model> {
public:
    explicit SolarArrayModel(SolarArray &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override { name_ = setup.name; }
    void reset(sim::Ns) override
    {
        check_source(name_);
        interface_.out = {};
    }
    void update(Tick tick) override;

private:
    SolarArray &interface_;
    std::string name_;
};

} // namespace fledge::world
