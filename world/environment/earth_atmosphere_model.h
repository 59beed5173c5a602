// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/earth_atmosphere.h.
#pragma once

#include "world/environment/air/air.h"
#include "world/environment/air/space_weather.h"
#include "world/environment/air_model.h"
#include "world/environment/earth_atmosphere.h"

namespace fledge::world {

class EarthAtmosphereModel final : public AirModel {
public:
    explicit EarthAtmosphereModel(EarthAtmosphere &interface);

    /// In place of the activity of the parameters.
    void set_weather(std::shared_ptr<const SpaceWeather> weather) { weather_ = std::move(weather); }
    const std::shared_ptr<const SpaceWeather> &weather() const { return weather_; }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void ensure_data_until(sim::Ns until) override;
    bool has_temperature() const override { return true; }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    State air(const Place &place) const override;
    Wind wind(const Place &) const override { return {interface_.par.wind_east, interface_.par.wind_north}; }
    void begin(sim::Ns start) const;
    AirLaw law() const { return static_cast<AirLaw>(interface_.par.law); } ///< which are in the same order

    EarthAtmosphere &interface_;
    std::shared_ptr<const SpaceWeather> weather_;
    SolarActivity constant_; ///< of the parameters

    // What belongs to the step that begins at start_.
    mutable sim::Ns start_ = -1;
    mutable AirPlace date_; ///< its date alone
    mutable SolarActivity activity_;
    mutable Eigen::Vector3d sun_N_{1, 0, 0};
};

} // namespace fledge::world
