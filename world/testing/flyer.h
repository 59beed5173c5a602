// SPDX-License-Identifier: Apache-2.0
// A spacecraft, with wheels if there are any, flown without the kernel; and what tests ask of it.
#pragma once

#include "flight/math/attitude.h"
#include "tests/error_of.h"
#include "world/dynamics/reaction_wheels_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace fledge::world::testing {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using sim::Ns;

inline constexpr Ns ms = 1'000'000, second = 1000 * ms;

/// What `fly` returns in narrow registers, and in those of each kind that the processor has.
template <class Fly> auto in_all_registers(const Fly &fly)
{
    const int widest = sim::wide;
    std::vector<decltype(fly())> results;
    for (sim::wide = 0; sim::wide <= widest; sim::wide++) {
        results.push_back(fly());
    }
    sim::wide = widest;
    return results;
}

/// A part that does nothing, with which a craft takes the general way of its steps.
class Idle final : public Effector {
public:
    void prepare(const sim::Setup &) override {}
    std::size_t states() const override { return 0; }
    void start(const Vec3 &, double *) override {}
    bool latch(const double *, const BodyRate &, double) override { return false; }
    void publish(Ns, const double *, const Vec3 &) override {}
};

struct Flyer {
    Spacecraft craft_interface{};
    ReactionWheels wheel_interface{};
    SpacecraftModel craft{craft_interface};
    ReactionWheelsModel wheels{wheel_interface};
    std::unique_ptr<sim::Integrator> method = sim::make_rk4();
    Ns t = 0;

    void set_inertia(const Matrix3d &I)
    {
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                craft_interface.par.I_B.m[i][j] = I(i, j);
            }
        }
    }

    /// Returns the wheel's index. Wheels must be added before prepare().
    std::size_t add_wheel(const Vector3d &axis, double J, double Omega = 0.0)
    {
        const std::size_t i = wheel_interface.par.n++;
        wheel_interface.par.axes_B[i] = vec(axis);
        wheel_interface.par.J[i] = J;
        wheel_interface.par.Omega[i] = Omega;
        return i;
    }

    /// Four wheels in a pyramid.
    void add_pyramid(double J)
    {
        for (int i = 0; i < 4; i++) {
            const double x = i == 0 || i == 3 ? -0.5 : 0.5, y = i < 2 ? 0.5 : -0.5;
            add_wheel({x, y, -std::sqrt(0.5)}, J);
        }
    }

    void prepare()
    {
        if (wheel_interface.par.n > 0) {
            craft.attach(wheels);
            wheels.prepare({"world.wheels", 1, method.get()});
        }
        craft.prepare({"world.craft", 1, method.get()});
        reset();
    }

    /// The states and rates of the craft and its parts.
    std::vector<double> states()
    {
        const auto memory = craft.memory();
        std::vector<double> all(memory.size() / sizeof(double));
        std::memcpy(all.data(), memory.data(), memory.size());
        return all;
    }

    void reset()
    {
        t = 0;
        craft.reset(0);
        craft.update({0, 0});
    }

    void command(std::size_t i, double u)
    {
        wheel_interface.in.command.head.quality = QUALITY_GOOD;
        wheel_interface.in.command.u[i] = u;
    }

    ForceTorque &push()
    {
        craft_interface.in.external.head.quality = QUALITY_GOOD;
        return craft_interface.in.external;
    }

    void step(Ns dt)
    {
        t += dt;
        craft.update({t, dt});
    }

    void fly(Ns duration, Ns dt, const std::function<void()> &after_each = {})
    {
        for (const Ns end = t + duration; t < end;) {
            step(dt);
            if (after_each) {
                after_each();
            }
        }
    }

    const CraftState &state() const { return craft_interface.out.state; }
    Vector3d r() const { return view(state().r_BN_N); }
    Vector3d v() const { return view(state().v_BN_N); }
    Vector3d omega() const { return view(state().omega_BN_B); }
    Matrix3d dcm_BN() const
    {
        const Mat3 dcm = mrp_to_dcm(state().sigma_BN);
        return view(dcm);
    }
    Matrix3d inertia() const { return view(craft_interface.par.I_B); }
    double Omega(std::size_t i) const { return wheel_interface.out.speeds.Omega[i]; }
    double applied(std::size_t i) const { return wheel_interface.out.applied.u[i]; }

    /// The inertial angular momentum of a wheel about its axis.
    double wheel_momentum(std::size_t i) const { return wheel_interface.par.J[i] * (axis(i).dot(omega()) + Omega(i)); }

    Vector3d axis(std::size_t i) const { return view(wheel_interface.par.axes_B[i]).normalized(); }

    /// The total angular momentum about the centre of mass, N components.
    Vector3d momentum_N() const
    {
        Vector3d h = inertia() * omega();
        for (std::size_t i = 0; i < wheel_interface.par.n; i++) {
            h += wheel_momentum(i) * axis(i);
        }
        return dcm_BN().transpose() * h;
    }

    /// The kinetic energy of rotation, wheels included.
    double rotational_energy() const
    {
        double energy = 0.5 * omega().dot(inertia() * omega());
        for (std::size_t i = 0; i < wheel_interface.par.n; i++) {
            energy += 0.5 * wheel_momentum(i) * wheel_momentum(i) / wheel_interface.par.J[i];
        }
        return energy;
    }
};

/// The rotation about the direction of `turn` by its length.
inline Matrix3d rotation(const Vector3d &turn)
{
    const double angle = turn.norm();
    return angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Matrix3d::Identity();
}

} // namespace fledge::world::testing
