// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/drag.h:
//
//   F = -1/2 density Cd A v |v|,   v = v_B - v_air(r_B),   A: the cross section, or of a facet A (n . v) / |v| if > 0
#pragma once

#include "world/dynamics/drag.h"
#include "world/dynamics/effector.h"
#include "world/environment/atmosphere_model.h"

namespace fledge::world {

class DragModel final : public Effector, public Asks {
public:
    explicit DragModel(Drag &interface) : interface_(interface) {}

    const char *asks() const override { return AtmosphereModel::kind; }
    bool ask(sim::Model &source) override { return air_.set(source); }
    const sim::Model *asked() const override { return air_.model(); }

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
    Drag &interface_;
    std::string name_;
    Asked<AtmosphereModel> air_;
    bool changed_ = true;
    Vec3 normals_B_[DRAG_FACETS_MAX] = {}; ///< unit vectors
    mutable Loads load_{};                 ///< of the last derive(), for the output
};

} // namespace fledge::world
