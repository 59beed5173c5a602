// SPDX-License-Identifier: Apache-2.0
// What a craft and its coupled parts are made of, as rigid bodies in N: momentum and energy from their definitions,
// from the published positions and rates alone.
#pragma once

#include "world/dynamics/fuel_slosh_model.h"
#include "world/dynamics/hinged_panels_model.h"
#include "world/dynamics/slosh_pendulum_model.h"
#include "world/testing/flyer.h"

#include <memory>
#include <vector>

namespace fledge::world::testing {

struct Sums {
    double mass = 0.0, kinetic = 0.0, stored = 0.0; ///< [J] stored: in springs
    Vector3d center = Vector3d::Zero(), linear = Vector3d::Zero(), angular = Vector3d::Zero(); ///< about N's origin
    Matrix3d inertia = Matrix3d::Zero();                                                       ///< the same

    /// A rigid body: its centre, its velocity, its rate, its inertia about the centre; N components.
    void add(double m, const Vector3d &r, const Vector3d &v, const Vector3d &w = Vector3d::Zero(),
             const Matrix3d &I = Matrix3d::Zero())
    {
        mass += m;
        center += m * r;
        linear += m * v;
        angular += m * r.cross(v) + I * w;
        inertia += m * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose()) + I;
        kinetic += 0.5 * m * v.squaredNorm() + 0.5 * w.dot(I * w);
    }
    /// [N m s] about the centre of mass.
    Vector3d spin() const { return angular - center.cross(linear) / mass; }
    double energy() const { return kinetic + stored; }
};

/// A craft with any of the coupled parts.
struct Assembly : Flyer {
    HingedPanels panel_interface{};
    FuelSlosh slosh_interface{};
    SloshPendulum pendulum_interface{};
    HingedPanelsModel panels{panel_interface};
    FuelSloshModel slosh{slosh_interface};
    SloshPendulumModel pendulums{pendulum_interface};

    Assembly()
    {
        craft_interface.par.mass = 80.0;
        set_inertia(Vector3d(30.0, 40.0, 50.0).asDiagonal());
    }

    std::size_t add_panel(double m, const Matrix3d &I, const Vector3d &hinge, const Vector3d &axis,
                          const Vector3d &center)
    {
        auto &par = panel_interface.par;
        const std::size_t i = par.n++;
        par.mass[i] = m;
        par.I_B[i] = mat(I);
        par.hinge_B[i] = vec(hinge);
        par.axes_B[i] = vec(axis);
        par.center_B[i] = vec(center);
        return i;
    }

    std::size_t add_particle(double m, const Vector3d &r, const Vector3d &axis, double k)
    {
        auto &par = slosh_interface.par;
        const std::size_t i = par.n++;
        par.mass[i] = m;
        par.r_B[i] = vec(r);
        par.axes_B[i] = vec(axis);
        par.stiffness[i] = k;
        return i;
    }

    std::size_t add_pendulum(double m, double l, const Vector3d &pivot, const Vector3d &rod)
    {
        auto &par = pendulum_interface.par;
        const std::size_t i = par.n++;
        par.mass[i] = m;
        par.length[i] = l;
        par.r_B[i] = vec(pivot);
        par.rod_B[i] = vec(rod);
        return i;
    }

    void prepare_all()
    {
        const auto use = [&](Effector &part, bool used, const char *name) {
            if (used) {
                part.prepare({name, 1, method.get()});
                craft.attach(part);
            }
        };
        use(wheels, wheel_interface.par.n > 0, "world.wheels"); // first, so that angle() finds it
        use(panels, panel_interface.par.n > 0, "world.panels");
        use(slosh, slosh_interface.par.n > 0, "world.slosh");
        use(pendulums, pendulum_interface.par.n > 0, "world.pendulums");
        craft.prepare({"world.craft", 1, method.get()});
        reset();
    }

    /// An imbalanced wheel in place of the balanced one, which the hub and the wheel's momentum have. Its mass and its
    /// inertia across the axis count for nothing, because the hub has them: any will do.
    void add_imbalance(std::size_t i, const auto &add) const
    {
        const auto &par = wheel_interface.par;
        const double m = 2.0, across = 0.3, J = par.J[i];
        const Vector3d g = axis(i), r = view(par.r_WB_B[i]), zero = Vector3d::Zero();
        const Vector3d start = g.cross(std::abs(g[0]) < 0.6 ? Vector3d::UnitX() : Vector3d::UnitY()).normalized();
        const Vector3d u = rotation(angle(i) * g) * start, w = g.cross(u), off = par.unbalance[i] / m * u;
        const Matrix3d balanced = across * (Matrix3d::Identity() - g * g.transpose());
        const Matrix3d about_axis =
            balanced + J * g * g.transpose() + par.couple[i] * (g * w.transpose() + w * g.transpose());
        const Matrix3d I = about_axis - m * (off.squaredNorm() * Matrix3d::Identity() - off * off.transpose());
        const Vector3d spin = omega() + Omega(i) * g;
        add(m, r + off, Omega(i) * g.cross(off), spin, I);
        add(-m, r, zero, omega(), balanced * -1.0);
        // the balanced wheel's own part, h g and h^2 / (2 J), which sums() has added
        add(0.0, zero, zero, spin, -J * g * g.transpose());
    }

    /// The angle of a wheel, which no output has.
    double angle(std::size_t i) const
    {
        const auto bytes = const_cast<SpacecraftModel &>(craft).memory();
        return reinterpret_cast<const double *>(bytes.data())[16 + sim::padded(wheel_interface.par.n) + i];
    }

    Sums sums() const
    {
        Sums s;
        const Matrix3d C = dcm_BN(), NB = C.transpose();
        const Vector3d w = omega(), rB = r(), vB = v();
        const auto add = [&](double m, const Vector3d &at, const Vector3d &rate, const Vector3d &spin,
                             const Matrix3d &I) {
            s.add(m, rB + NB * at, vB + NB * (w.cross(at) + rate), NB * spin, NB * I * C);
        };
        const Vector3d zero = Vector3d::Zero();
        add(craft_interface.par.mass, view(craft_interface.par.center_B), zero, w, inertia());
        for (std::size_t i = 0; i < panel_interface.par.n; i++) {
            const auto &par = panel_interface.par;
            const double theta = panel_interface.out.angles.theta[i], rate = panel_interface.out.angles.dtheta[i];
            const Vector3d g = view(par.axes_B[i]).normalized();
            const Matrix3d R = rotation(theta * g);
            const Vector3d arm = R * view(par.center_B[i]);
            add(par.mass[i], view(par.hinge_B[i]) + arm, rate * g.cross(arm), w + rate * g,
                R * view(par.I_B[i]) * R.transpose());
            s.stored += 0.5 * par.stiffness[i] * theta * theta;
        }
        for (std::size_t i = 0; i < slosh_interface.par.n; i++) {
            const auto &fuel = slosh_interface.out.fuel;
            const auto &par = slosh_interface.par;
            add(par.mass[i], view(fuel.r_B[i]), view(fuel.v_B[i]), zero, Matrix3d::Zero());
            s.stored += 0.5 * par.stiffness[i] * (view(fuel.r_B[i]) - view(par.r_B[i])).squaredNorm();
        }
        for (std::size_t i = 0; i < pendulum_interface.par.n; i++) {
            const auto &fuel = pendulum_interface.out.fuel;
            add(pendulum_interface.par.mass[i], view(fuel.r_B[i]), view(fuel.v_B[i]), zero, Matrix3d::Zero());
        }
        for (std::size_t i = 0; i < wheel_interface.par.n; i++) {
            const double h = wheel_momentum(i);
            s.angular += NB * (h * axis(i));
            s.kinetic += 0.5 * h * h / wheel_interface.par.J[i];
            add_imbalance(i, add);
        }
        return s;
    }
};

} // namespace fledge::world::testing
