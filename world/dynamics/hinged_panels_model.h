// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/hinged_panels.h. The states are the angles, then their rates. All that a panel
// adds to the matrix of the whole consists of the first two harmonics of its angle:
//
//   constant + c cos + s sin + c2 cos^2 + s2 sin cos
#pragma once

#include "world/consumer.h"
#include "world/dynamics/coupled_step.h"
#include "world/dynamics/effector.h"
#include "world/dynamics/hinged_panels.h"

#include <span>
#include <string>

namespace fledge::world {

using sim::state_block;

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
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&panels_, 1)); }

    std::size_t states() const override { return 2 * sim::padded(interface_.par.n); }
    std::vector<StateName> names() const override;
    bool couples() const override { return true; }
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void tide(const Mat3 &gradient, const Vec3 &c, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

    /// The coefficients of the harmonics.
    struct Panel {
        double moment[3][4];  ///< [kg, kg m] mass and moment: constant, of cos, sin
        Symmetric inertia[5]; ///< [kg m^2] constant, of cos, sin, cos^2, sin cos
        double push[2][4];    ///< [kg m]   of cos, sin
        double turn[3][4];    ///< [kg m^2] constant, of cos, sin
        double J;             ///< [kg m^2] about the hinge
    };
    struct Panels {
        Panel of[PANELS_MAX];
        double per_J[PANELS_MAX];               ///< [1/(kg m^2)] the inverses of their J
        double rest[PANELS_MAX], u[PANELS_MAX]; ///< [rad], [N m] what drives them
    };

    /// The panels `i` and the next, up to `most`, as a part of a CoupledCraft. Without a panel, all numbers are 0.
    template <std::size_t most> struct UpTo {
        using State = Swing;
        struct Place {
            Quad theta;
            SymmetricQuads bent[most]; ///< the derivative of what it adds to the inertia
            Quad push[most], turn[most], push_per[most], turn_per[most];
            Quad push_slope[most], turn_slope[most];
        };
        struct Acting {
            Quad force, rate;
        };
        const HingedPanelsModel &of;
        std::size_t i;

        LANES_INLINE void place(Quad theta, Placed &all, Place &to) const;
        LANES_INLINE Acting act(const Place &at, const Swing &x, Quad omega, Moved &all) const;
        LANES_INLINE Swing accelerate(const Place &at, const Acting &now, Quad a, Quad domega) const;
        LANES_INLINE Swing load(const double *x) const { return {quad_at(x + i), quad_at(x + of.rates_ + i)}; }
        LANES_INLINE void store(double *x, const Swing &k) const
        {
            put_quad(x + i, k.at);
            put_quad(x + of.rates_ + i, k.rate);
        }
        LANES_INLINE static Quad sum(const Swing &x) { return x.at + x.rate; }
        /// For each panel; for both of two, without a loop.
        template <class Do> LANES_INLINE void each(const Do &act) const
        {
            if constexpr (most == 2) {
                act(0), act(1);
            } else {
                for (std::size_t k = 0; k < most && i + k < of.n_; k++) {
                    act(k);
                }
            }
        }
    };

    template <std::size_t most> UpTo<most> up_to(std::size_t i = 0) const { return {*this, i}; }

private:
    Panel panel(std::size_t i) const;

    void couple_in_lanes(const double *x, const Vec3 &rate, Loads &loads, Whole &whole);
    void accelerate_in_lanes(const Vec3 &a, const Vec3 &domega, double *dx) const;

    HingedPanels &interface_;
    bool changed_ = true;           ///< parameters, since the last latch()
    std::size_t n_ = 0, rates_ = 0; ///< where the rates begin
    Panels panels_{};
    const double *x_ = nullptr; ///< of the last couple()
    // From couple() to accelerate().
    UpTo<4>::Place places_[PANELS_MAX / sim::state_block]{};
    UpTo<4>::Acting acting_[PANELS_MAX / sim::state_block]{};
};

template <std::size_t most>
LANES_INLINE void HingedPanelsModel::UpTo<most>::place(Quad theta, Placed &all, Place &to) const
{
    Quad sines, cosines;
    sincos(theta, sines, cosines);
    to.theta = theta;
    each([&](std::size_t k) LANES_LAMBDA {
        const Panel &p = of.panels_.of[i + k];
        const double s = sines[k], c = cosines[k], c2 = c * c, s2 = s * c;
        const SymmetricQuads first[2] = {symmetric(p.inertia[1]), symmetric(p.inertia[2])};
        const SymmetricQuads second[2] = {symmetric(p.inertia[3]), symmetric(p.inertia[4])};
        to.bent[k] = (c * first[1] - s * first[0]) + ((2.0 * c2 - 1.0) * second[1] - 2.0 * s2 * second[0]);
        const Quad by_c = quad_at(p.push[0]), by_s = quad_at(p.push[1]), push = c * by_c + s * by_s;
        const Quad turn_c = quad_at(p.turn[1]), turn_s = quad_at(p.turn[2]);
        const Quad turn = quad_at(p.turn[0]) + (c * turn_c + s * turn_s);
        const Quad push_per = of.panels_.per_J[i + k] * push, turn_per = of.panels_.per_J[i + k] * turn;
        all.mass += quad_at(p.moment[0]) + (c * quad_at(p.moment[1]) + s * quad_at(p.moment[2]));
        all.inertia =
            all.inertia + (symmetric(p.inertia[0]) + (c * first[0] + s * first[1]) + (c2 * second[0] + s2 * second[1]));
        all.linear = all.linear + product(push, push_per);
        all.angular = all.angular + product(turn, turn_per);
        for (int j = 0; j < 3; j++) {
            all.cross[j] += push_per[j] * turn;
        }
        to.push[k] = push;
        to.turn[k] = turn;
        to.push_per[k] = push_per;
        to.turn_per[k] = turn_per;
        to.push_slope[k] = c * by_s - s * by_c;
        to.turn_slope[k] = c * turn_s - s * turn_c;
    });
}

template <std::size_t most>
LANES_INLINE typename HingedPanelsModel::UpTo<most>::Acting
HingedPanelsModel::UpTo<most>::act(const Place &at, const Swing &x, Quad omega, Moved &all) const
{
    const auto &par = of.interface_.par;
    Quad bends[4]{};
    each([&](std::size_t k) LANES_LAMBDA { bends[k] = at.bent[k].times(omega); });
    const Quad dots = sums(omega * bends[0], omega * bends[1], omega * bends[2], omega * bends[3]);
    const Quad acting = quad_at(of.panels_.u + i) -
                        quad_at(par.stiffness + i) * (at.theta - quad_at(of.panels_.rest + i)) -
                        quad_at(par.damping + i) * x.rate + 0.5 * dots;
    each([&](std::size_t k) LANES_LAMBDA {
        const double force = acting[k], rate = x.rate[k];
        all.force -= force * at.push_per[k] + (rate * rate) * at.push_slope[k];
        all.torque -= force * at.turn_per[k] + rate * (bends[k] + rate * at.turn_slope[k]);
        all.drift += rate * at.push[k];
        all.momentum += rate * at.turn[k];
    });
    return {acting, x.rate};
}

template <std::size_t most>
LANES_INLINE Swing HingedPanelsModel::UpTo<most>::accelerate(const Place &at, const Acting &now, Quad a,
                                                             Quad domega) const
{
    Quad taken[4]{};
    each([&](std::size_t k) LANES_LAMBDA { taken[k] = at.push[k] * a + at.turn[k] * domega; });
    return {now.rate, (now.force - sums(taken[0], taken[1], taken[2], taken[3])) * quad_at(of.panels_.per_J + i)};
}

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
