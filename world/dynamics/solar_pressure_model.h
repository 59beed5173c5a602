// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/solar_pressure.h. With the irradiance E, the speed of light c and the unit vector
// s towards the Sun, a sphere feels F = -E / c Cr A s, and a lit facet, n . s > 0,
//
//   F = -E / c A (n . s) [ (1 - specular) s + 2 (specular (n . s) + diffuse / 3) n ]
#pragma once

#include "world/dynamics/effector.h"
#include "world/dynamics/solar_pressure.h"
#include "world/environment/sunlight_model.h"

namespace fledge::world {

class SolarPressureModel final : public Effector, public Asks {
public:
    explicit SolarPressureModel(SolarPressure &interface) : interface_(interface) {}

    const char *asks() const override { return SunlightModel::kind; }
    bool ask(sim::Model &source) override { return light_.set(source); }
    const sim::Model *asked() const override { return light_.model(); }

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    std::size_t states() const override { return 0; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    bool pushes() const override { return true; }
    unsigned needs() const override { return needs_place | needs_attitude; }
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;

private:
    SolarPressure &interface_;
    std::string name_;
    Asked<SunlightModel> light_;
    bool changed_ = true;
    Vec3 normals_B_[SOLAR_FACETS_MAX] = {}; ///< unit vectors
    mutable Loads load_{};                  ///< of the last derive(), for the output
};

} // namespace fledge::world
