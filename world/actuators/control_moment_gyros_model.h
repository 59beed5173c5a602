// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/actuators/control_moment_gyros.h.
//
// A gimbal turns by gamma about g; the wheel's axis is s, and t = g x s. The states are the momentum of the wheel about
// s, that of gimbal and wheel about g, and the angle:
//
//   h = J (omega_s + Omega)        dh = u
//   p = J_g (omega_g + dgamma)     dp = v + gyration,   gyration = h omega_t + (J_s - J_t) omega_s omega_t
//   dgamma = p / J_g - omega_g
//
// with the torques u and v of the motors and omega_s = s . omega. The rest of the gyro's inertia turns with the gimbal,
// I(gamma) = J_s s s + J_t t t, and belongs to the craft; its momentum is h s + p g + I omega. So the body feels
//
//   -(u s + h dgamma t + dp g) - dgamma (J_s - J_t) (omega_t s + omega_s t).
#pragma once

#include "world/actuators/control_moment_gyros.h"
#include "world/dynamics/effector.h"
#include "world/faults.h"

#include <string>

namespace fledge::world {

class ControlMomentGyrosModel final : public Effector {
public:
    explicit ControlMomentGyrosModel(ControlMomentGyros &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override;
    void refresh() override;
    void reseed() override { state_.faults.reseed(seeded_); }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&state_, 1)); }

    std::size_t states() const override { return 3 * sim::padded(interface_.par.n); }
    std::vector<StateName> names() const override;
    bool couples() const override { return true; }
    void add_hidden_inertia(Mat3 &inertia) const override;
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    struct Axes {
        Vec3 s, t, g;
    };
    /// A gyro at one instant.
    struct Gyro {
        double h, p, angle, omega_s, omega_t, omega_g;
        double rate;     ///< of the gimbal
        double gyration; ///< [N m] on the gimbal
    };
    struct Motors {
        double asked;  ///< [N m] of the wheel's motor, by the command
        double wheel;  ///< [N m] what it gives
        double gimbal; ///< [N m] or [rad/s] what the gimbal's motor gives or its rate shall be
        double servo;  ///< 1: a rate
        double lag;    ///< [s] of the rate
        double limited;
    };

    enum Channels : std::size_t { of_wheels = 0, of_gimbals = 8, of_speeds = 16, of_angles = 24, channels = 32 };
    struct State {
        Motors motors[WHEELS_MAX];
        Faults<channels> faults;
    };

    void fail(std::size_t channel, double &x, double most);
    Axes axes(std::size_t i, double angle) const;
    Gyro gyro(std::size_t i, const double *x, const Axes &axes, const Vec3 &omega) const;
    double gimbal_torque(std::size_t i, const Gyro &gyro) const;

    ControlMomentGyros &interface_;
    std::string name_;
    sim::Random seeded_; ///< the stream as each run begins it
    std::size_t n_ = 0, padded_ = 0;
    Axes zero_[WHEELS_MAX]{}; ///< at angle 0
    Axes now_[WHEELS_MAX]{};  ///< of the last couple()
    State state_{};
};

} // namespace fledge::world
