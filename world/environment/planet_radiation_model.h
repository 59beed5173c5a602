// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/environment/planet_radiation.h. An element of the solid angle w, in which the craft sees
// ground under the Sun at the angle theta from the zenith, has at a right angle to its light the irradiances
//
//   reflected = w / pi albedo E cos theta if > 0,   infrared = w / pi emissivity E / 4
//
// with the irradiance E of the Sun at the body. The cosine of the cap, about the direction down, is its mean, so that
// of a body that is equally bright all over the sum of irradiances times directions is exact, for any number of rings.
#pragma once

#include "world/eigen.h"
#include "world/environment/planet_radiation.h"
#include "world/environment/sunlight_model.h"

#include <array>
#include <span>

namespace fledge::world {

class PlanetRadiationModel final : public EnvironmentModel, public Consumer {
public:
    static constexpr const char *kind = "PlanetRadiation";

    explicit PlanetRadiationModel(PlanetRadiation &interface) : EnvironmentModel("body", true), interface_(interface) {}

    const char *source_kind() const override { return SunlightModel::kind; }
    bool set_source(sim::Model &source) override { return light_.set(source); }
    const sim::Model *source() const override { return light_.model(); }

    struct Element {
        Eigen::Vector3d towards_N;  ///< [-] unit vector from the craft
        double reflected, infrared; ///< [W/m^2] at a right angle
    };

    /// At r_BN_N [m] and start + tau [s]; valid until the next call. Inside the body there are none.
    std::span<const Element> at(sim::Ns start, double tau, const Eigen::Vector3d &r_BN_N) const;

    /// [W/m^2] irradiance of the Sun at the body.
    double sunlight(sim::Ns start, double tau) const
    {
        return light_->unhidden(start, tau, r_PN_N(0, start, tau)).irradiance;
    }

    /// Changes whenever a parameter of it or of the Sunlight changes.
    std::uint64_t version() const { return EnvironmentModel::version() + light_->version(); }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reset(sim::Ns t) override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    /// Of the ground.
    struct Brightness {
        double albedo, emissivity;
    };

    Brightness brightness(double season, double sine_of_latitude) const;
    void publish(sim::Ns t) override;

    PlanetRadiation &interface_;
    SourceOf<SunlightModel> light_;
    mutable std::array<Element, 1 + 3 * 5 * (5 + 1)> elements_; // of 5 rings
};

/// A sensor or an array that sees the light of a planet, if it has a source.
template <class Base> class PlanetViewer : public Base, public Consumer {
public:
    using Base::Base;
    const char *source_kind() const override { return PlanetRadiationModel::kind; }
    bool set_source(sim::Model &source) override { return planet_.set(source); }
    const sim::Model *source() const override { return planet_.model(); }
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override
    {
        planet_.copy(dynamic_cast<const PlanetViewer &>(original).planet_, counterpart);
    }

protected:
    /// When all models are prepared.
    void check_source(const std::string &name) const
    {
        if (planet_.model()) {
            planet_.check(name, "radiation");
        }
    }

    /// What is seen of the planet; nothing without a source.
    std::span<const PlanetRadiationModel::Element> elements(sim::Ns t, const Vec3 &r_BN_N) const
    {
        return planet_.model() ? planet_->at(t, 0.0, view(r_BN_N)) : std::span<const PlanetRadiationModel::Element>{};
    }

    SourceOf<PlanetRadiationModel> planet_;
};

} // namespace fledge::world
