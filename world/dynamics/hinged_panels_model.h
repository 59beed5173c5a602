// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/hinged_panels.h. The states are the angles, then their rates. All that a panel
// adds to the matrix of the whole consists of the first two harmonics of its angle:
//
//   constant + c cos + s sin + c2 cos^2 + s2 sin cos
#pragma once

#include "world/consumer.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/hinged_panels.h"
#include "world/dynamics/lanes.h"

#include <span>
#include <string>

namespace fledge::world {

class HingedPanelsModel final : public Effector {
public:
    explicit HingedPanelsModel(HingedPanels &interface) : interface_(interface) {}

    /// A hinge at the x of the last couple(), for parts that are mounted on its panel. B components.
    struct Hinge {
        Vec3 at;   ///< [m]
        Vec3 axis; ///< of length 1
        double sine, cosine;
        double rate; ///< [rad/s]

        /// A direction of the panel at theta = 0, as it is now.
        Vec3 turned(const Vec3 &a) const
        {
            const Vec3 along = vec_scale((1.0 - cosine) * vec_dot(axis, a), axis);
            return vec_add(along, vec_add(vec_scale(cosine, a), vec_scale(sine, vec_cross(axis, a))));
        }
    };
    Hinge hinge(std::size_t i) const;
    std::size_t size() const { return interface_.par.n; }

    /// A further torque [N m] on a panel, about its hinge. After couple(), for this stage.
    void drive(std::size_t i, double torque, Whole &whole);

    /// Throws SetupError unless `panel` is 0 or the number of one of these panels, which may be missing. `name`: of the
    /// part, with a row `i` that is mounted there.
    static void check_mount(const HingedPanelsModel *panels, const std::string &name, std::size_t i, std::size_t panel);

    void prepare(const sim::Setup &setup) override;

    /// Springs and dampers change at once.
    void refresh() override { changed_ = true; }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(panels_)); }

    std::size_t states() const override { return 2 * sim::padded(interface_.par.n); }
    std::vector<StateName> names() const override;
    bool couples() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void tide(const Mat3 &gradient, const Vec3 &c, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    /// The coefficients of the harmonics, and what drives the panel.
    struct Panel {
        double moment[3][4];  ///< [kg, kg m] mass and moment: constant, of cos, sin
        Symmetric inertia[5]; ///< [kg m^2] constant, of cos, sin, cos^2, sin cos
        double push[2][4];    ///< [kg m]   of cos, sin
        double turn[3][4];    ///< [kg m^2] constant, of cos, sin
        double J, per_J;      ///< [kg m^2] about the hinge, and its inverse
        double rest;          ///< [rad]
        double u;             ///< [N m]
    };
    Panel panel(std::size_t i) const;

    void couple_in_lanes(const double *x, const Vec3 &rate, Loads &loads, Whole &whole);
    void accelerate_in_lanes(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const;

    HingedPanels &interface_;
    bool changed_ = true;           ///< parameters, since the last latch()
    std::size_t n_ = 0, rates_ = 0; ///< where the rates begin
    Panel panels_[PANELS_MAX]{};
    const double *x_ = nullptr; ///< of the last couple()
    /// From couple() to accelerate(), as a Freedom; 0 beyond the last panel.
    struct alignas(32) Acting {
        double push[4], turn[4];
    };
    Acting now_[PANELS_MAX]{};
    double forces_[PANELS_MAX]{};
};

/// The panels on which rows of a part are mounted, the source `panels` of that part.
class PanelMount final : public Consumer {
public:
    const char *source_kind() const override { return "HingedPanels"; }
    bool set_source(sim::Model &source) override { return (panels_ = dynamic_cast<HingedPanelsModel *>(&source)); }
    const sim::Model *source() const override { return panels_; }
    HingedPanelsModel *panels() const { return panels_; }

private:
    HingedPanelsModel *panels_ = nullptr;
};

} // namespace fledge::world
