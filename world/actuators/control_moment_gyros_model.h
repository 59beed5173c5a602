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
#include "world/dynamics/coupled_step.h"
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
    Drive drive_at(std::size_t i, const double *x, const Vec3 &omega) const override;
    double drive_rate(std::size_t i, const double *x, const double *dx, const BodyRate &rate) const override;
    void give(std::size_t i, double share) override;
    std::size_t most_drives() const override { return 2 * n_; }
    void publish(sim::Ns t, const double *x, const Vec3 &omega) override;

    /// Gyros in four lanes, `i` and the next three, as a part of a CoupledCraft.
    struct Lanes {
        static constexpr bool is_free = false;
        struct State {
            Quad h, p, angle;

            LANES_INLINE State operator+(const State &b) const { return {h + b.h, p + b.p, angle + b.angle}; }
            LANES_INLINE friend State operator*(double s, const State &a) { return {s * a.h, s * a.p, s * a.angle}; }
            LANES_INLINE friend Quad coordinate(const State &x) { return x.angle; }
            LANES_INLINE friend void set_coordinate(State &x, Quad angle) { x.angle = angle; }
        };
        struct Place {
            Quad3 s, t;
        };
        /// At the body's rate.
        struct Now {
            Quad omega_s, omega_t;
            Quad rate;     ///< of the gimbal
            Quad gyration; ///< [N m] on the gimbal
        };
        struct Acting {
            Quad rate, dp;
            Quad torque; ///< [N m] of the gimbal's motor
            Quad omega_s;
        };
        const ControlMomentGyrosModel &of;
        std::size_t i;

        LANES_INLINE void turned(Quad angle, Place &to) const;
        LANES_INLINE Now now(const Place &at, const State &x, const Quad3 &omega) const;
        LANES_INLINE void place(Quad angle, Placed &all, Place &to) const;
        LANES_INLINE Acting act(const Place &at, const State &x, Quad omega, Moved &all) const;
        LANES_INLINE State accelerate(const Place &, const Acting &now, Quad, Quad) const;
        LANES_INLINE void show(const Acting &now) const;
        LANES_INLINE State load(const double *x) const;
        LANES_INLINE void store(double *x, const State &k) const;
        LANES_INLINE static Quad sum(const State &x) { return (x.h + x.p) + x.angle; }
    };
    std::size_t size() const { return interface_.par.n; }
    Lanes lanes(std::size_t i = 0) const { return {*this, i}; }

private:
    /// Constants of the gyros, arrays for the lanes; beyond the last gyro they do nothing.
    struct Constants {
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
        double limited;             ///< 1: some motor is, by its largest torque
        // The drives: the wheels' motors, then the gimbals' without a servo.
        double whole[2 * WHEELS_MAX], share[2 * WHEELS_MAX];
    };

    enum Channels : std::size_t { of_wheels = 0, of_gimbals = 8, of_speeds = 16, of_angles = 24, channels = 32 };
    /// What is commanded, for how long [s]; what is not is 0.
    struct Commanded {
        double dt, servo;
        double wheel[WHEELS_MAX], rate[WHEELS_MAX], torque[WHEELS_MAX];
    };
    struct State {
        Constants gyros;
        Motors motors;
        Commanded commanded; ///< in the last update
        double again;        ///< 1: the motors may change although the commands do not
        Faults<channels> faults;
    };

    void fail(std::size_t channel, double &x, double most);
    Vec3 axis(std::size_t i, double angle) const;
    void couple_in_lanes(const double *x, const Motion &motion, Loads &loads, Whole &whole);
    void accelerate_in_lanes(double *dx) const;

    ControlMomentGyros &interface_;
    std::string name_;
    sim::Random seeded_; ///< the stream as each run begins it
    std::size_t n_ = 0, padded_ = 0;
    Lanes::Acting acting_[WHEELS_MAX / 4]{}; ///< of the last couple()
    /// Of the last stage, for publish(): of the gimbal, of its motor, of the body about the wheel's axis.
    mutable struct {
        double rate[WHEELS_MAX], torque[WHEELS_MAX], omega_s[WHEELS_MAX];
    } seen_{};
    State state_{};
};

LANES_INLINE ControlMomentGyrosModel::Lanes::State ControlMomentGyrosModel::Lanes::load(const double *x) const
{
    return {quad_at(x + i), quad_at(x + of.padded_ + i), quad_at(x + 2 * of.padded_ + i)};
}

LANES_INLINE void ControlMomentGyrosModel::Lanes::store(double *x, const State &k) const
{
    put_quad(x + i, k.h);
    put_quad(x + of.padded_ + i, k.p);
    put_quad(x + 2 * of.padded_ + i, k.angle);
}

LANES_INLINE void ControlMomentGyrosModel::Lanes::turned(Quad angle, Place &to) const
{
    const Quad3 s = quads(of.state_.gyros.s, i), t = quads(of.state_.gyros.t, i);
    Quad sine, cosine;
    sincos(angle, sine, cosine);
    to.s = cosine * s + sine * t;
    to.t = cosine * t - sine * s;
}

LANES_INLINE void ControlMomentGyrosModel::Lanes::place(Quad angle, Placed &all, Place &to) const
{
    const Constants &gyros = of.state_.gyros;
    turned(angle, to);
    if (i == 0) {
        all.inertia = all.inertia + symmetric(gyros.all_ways);
    }
    all.inertia = all.inertia + product((quad_at(gyros.J_s + i) - quad_at(gyros.J_t + i)) * to.s, to.s).sum();
}

LANES_INLINE ControlMomentGyrosModel::Lanes::Now ControlMomentGyrosModel::Lanes::now(const Place &at, const State &x,
                                                                                     const Quad3 &omega) const
{
    const Constants &gyros = of.state_.gyros;
    const Quad omega_s = dot(at.s, omega), omega_t = dot(at.t, omega);
    return {omega_s, omega_t, x.p * quad_at(gyros.J_g_inverse + i) - dot(quads(gyros.g, i), omega),
            (x.h + (quad_at(gyros.J_s + i) - quad_at(gyros.J_t + i)) * omega_s) * omega_t};
}

LANES_INLINE ControlMomentGyrosModel::Lanes::Acting ControlMomentGyrosModel::Lanes::act(const Place &at, const State &x,
                                                                                        Quad omega, Moved &all) const
{
    const Constants &gyros = of.state_.gyros;
    const Motors &motors = of.state_.motors;
    const Now now = this->now(at, x, {quad(omega[0]), quad(omega[1]), quad(omega[2])});
    // Of the gimbals' motors. For a rate, they also carry the gyration.
    const Quad most = quad_at(motors.most + i), servo = quad_at(motors.servo + i);
    const Quad wanted = quad_at(motors.gimbal + i) +
                        quad_at(motors.per_lag + i) * (quad_at(motors.wanted + i) - now.rate) - servo * now.gyration;
    const Quad below = wanted < most ? wanted : most;
    const Quad v = below > -most ? below : -most, dp = v + now.gyration;
    const Quad turning = now.rate * (quad_at(gyros.J_s + i) - quad_at(gyros.J_t + i));
    const Quad3 g = quads(gyros.g, i);
    all.momentum += sums(x.h * at.s + x.p * g);
    all.acting -= sums((quad_at(motors.wheel + i) + turning * now.omega_t) * at.s +
                       (x.h * now.rate + turning * now.omega_s) * at.t + dp * g);
    return {now.rate, dp, v, now.omega_s};
}

LANES_INLINE ControlMomentGyrosModel::Lanes::State
ControlMomentGyrosModel::Lanes::accelerate(const Place &, const Acting &now, Quad, Quad) const
{
    return {quad_at(of.state_.motors.wheel + i), now.dp, now.rate};
}

LANES_INLINE void ControlMomentGyrosModel::Lanes::show(const Acting &now) const
{
    put_quad(of.seen_.rate + i, now.rate);
    put_quad(of.seen_.torque + i, now.torque);
    put_quad(of.seen_.omega_s + i, now.omega_s);
}

} // namespace fledge::world
