// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/celestial_body.h.
#pragma once

#include "sim/model.h"
#include "world/environment/celestial_body.h"
#include "world/environment/sky.h"
#include "world/environment/sky_user.h"

namespace fledge::world {

class CelestialBodyModel final : public sim::Model, public SkyUser {
public:
    explicit CelestialBodyModel(CelestialBody &interface) : interface_(interface) {}

    void set_sky(std::shared_ptr<const Sky> sky) override { sky_ = std::move(sky); }
    const std::shared_ptr<const Sky> &sky() const override { return sky_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void ensure_data_until(sim::Ns until) override;
    void reset(sim::Ns t) override;
    void update(Tick tick) override { publish(tick.t); }
    std::vector<std::string> assumptions() const override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    void publish(sim::Ns t);

    CelestialBody &interface_;
    std::shared_ptr<const Sky> sky_;
    std::string name_;
    int target_ = 0; ///< the body that is read from the ephemeris
    sim::Ns covered_ = 0;
    Ephemeris::Cursor cursor_;
};

} // namespace fledge::world
