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
#include "world/dynamics/lanes.h"
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
    bool is_free() const override { return false; }
    void add_hidden_inertia(Mat3 &inertia) const override;
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void couple(const double *x, const Motion &motion, Loads &loads, Whole &whole) override;
    void accelerate(const double *x, const Vec3 &a, const Vec3 &domega, double *dx) const override;
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

private:
    /// Four gyros at one instant.
    struct Four {
        Quad3 s, t;
        Quad h, p, omega_s, omega_t;
        Quad rate;     ///< of the gimbal
        Quad gyration; ///< [N m] on the gimbal
    };
    /// What limits need of a gyro.
    struct Seen {
        double Omega[WHEELS_MAX], rate[WHEELS_MAX]; ///< of wheel, gimbal
        double gyration[WHEELS_MAX], omega_t[WHEELS_MAX];
        double domega_s[WHEELS_MAX], domega_g[WHEELS_MAX]; ///< [rad/s^2] of the body about s and g
    };
    /// Constants by fours; beyond the last gyro they do nothing.
    struct Fours {
        double s[3][WHEELS_MAX], t[3][WHEELS_MAX], g[3][WHEELS_MAX]; ///< axes at angle 0
        double J[WHEELS_MAX], J_inverse[WHEELS_MAX], J_g[WHEELS_MAX], J_g_inverse[WHEELS_MAX], J_s[WHEELS_MAX],
            J_t[WHEELS_MAX];
        Symmetric all_ways; ///< sum J_t (s s + t t)
    };
    /// What the motors do until the next update.
    struct Motors {
        double wheel[WHEELS_MAX];   ///< [N m]
        double gimbal[WHEELS_MAX];  ///< [N m] without a servo
        double wanted[WHEELS_MAX];  ///< [rad/s] of a servo
        double per_lag[WHEELS_MAX]; ///< [kg m^2/s] of a servo: J_g / lag; without one 0
        double servo[WHEELS_MAX];   ///< 1: a rate is commanded
        double most[WHEELS_MAX];    ///< [N m] of the gimbal's motor
        double limited;             ///< 1: some motor is
    };

    enum Channels : std::size_t { of_wheels = 0, of_gimbals = 8, of_speeds = 16, of_angles = 24, channels = 32 };
    /// What is commanded, for how long [s]; what is not is 0.
    struct Commanded {
        double dt, servo;
        double wheel[WHEELS_MAX], rate[WHEELS_MAX], torque[WHEELS_MAX];
    };
    struct State {
        Fours gyros;
        Motors motors;
        Commanded commanded; ///< in the last update
        double again;        ///< 1: the motors may change although the commands do not
        Faults<channels> faults;
    };

    void fail(std::size_t channel, double &x, double most);
    Vec3 axis(std::size_t i, double angle) const;
    Four four(std::size_t i, const double *x, const Vec3 &omega) const;
    Quad gimbal_torque(std::size_t i, const Four &now) const;
    void observe(const double *x, const BodyRate &rate, Seen &seen) const;
    void couple_in_lanes(const double *x, const Motion &motion, Loads &loads, Whole &whole);
    void accelerate_in_lanes(double *dx) const;

    ControlMomentGyros &interface_;
    std::string name_;
    sim::Random seeded_; ///< the stream as each run begins it
    std::size_t n_ = 0, padded_ = 0;
    Quad acting_[WHEELS_MAX / 4][3]{}; ///< the derivatives of the states, of the last couple()
    /// Of the last couple(), for publish(): of the gimbal, of its motor, of the body about the wheel's axis.
    struct {
        double rate[WHEELS_MAX], torque[WHEELS_MAX], omega_s[WHEELS_MAX];
    } seen_{};
    State state_{};
};

} // namespace fledge::world
