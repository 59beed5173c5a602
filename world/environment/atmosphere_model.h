// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/atmosphere.h.
#pragma once

#include "world/environment/air_model.h"
#include "world/environment/atmosphere.h"
#include "world/environment/standard_atmosphere.h"

namespace fledge::world {

class AtmosphereModel final : public AirModel {
public:
    explicit AtmosphereModel(Atmosphere &interface)
        : AirModel(interface.in.truth, interface.out.air), interface_(interface)
    {
    }

    void refresh() override;
    bool has_temperature() const override { return standard_; }

private:
    State air(const Place &place) const override;
    Wind wind(const Place &) const override { return {interface_.par.wind_east, interface_.par.wind_north}; }
    double spin() const override { return interface_.par.spin; }

    Atmosphere &interface_;
    const StandardAtmosphere *standard_ = nullptr;
};

} // namespace fledge::world
