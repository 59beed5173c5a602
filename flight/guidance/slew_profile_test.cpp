// SPDX-License-Identifier: Apache-2.0
// A slew begins with the body, ends with the target, keeps its limits, and its rates are derivatives.
#include "flight/testing/base.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/slew_profile.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace slew_profile_test {

constexpr double degree = pi / 180;

/// A target, a body, and the module at any time after the slew from one to the other began, at 0.
struct Slew {
    Base target;
    SlewProfile begun{};

    Slew(const Base &base, const Matrix3d &dcm_BN, const Vector3d &omega_BN_B) : target(base)
    {
        begun.par = {1 * degree, 0.02 * degree, 1 * degree, 0};
        begun.in.attitude = {good(), dcm_to_mrp(mat(dcm_BN)), vec(omega_BN_B)};
        begun = at(0);
    }

    SlewProfile at(double t) const
    {
        SlewProfile m = begun;
        m.in.target = target.at(t);
        slew_profile_update(&m, {ns(t), t > 0 ? ns(0.1) : 0});
        return m;
    }

    double length() const { return begun.out.status.remaining; }
};

Slew any(Random &random, double target_rate, double body_rate)
{
    return {any_base(random, target_rate), random.attitude(), random.direction() * random.real(0, body_rate)};
}

/// Attitude and rate of R relative to T, R components.
Matrix3d dcm_RT(const SlewProfile &m)
{
    return dcm(m.out.reference.sigma_RN) * dcm(m.in.target.sigma_RN).transpose();
}

Vector3d omega_RT(const SlewProfile &m)
{
    return dcm(m.out.reference.sigma_RN) * (eigen(m.out.reference.omega_RN_N) - eigen(m.in.target.omega_RN_N));
}

double angle(const Matrix3d &c)
{
    return std::acos(std::clamp((c.trace() - 1) / 2, -1.0, 1.0));
}

TEST(SlewProfile, begins_with_the_body_and_ends_with_the_target)
{
    Random random{1};
    for (int i = 0; i < 500; i++) {
        const Slew slew = any(random, 0.01, 1.5 * degree);
        const SlewProfile &m = slew.begun;
        EXPECT_LT(difference(dcm(m.out.reference.sigma_RN), dcm(m.in.attitude.sigma_BN)), 1e-13);
        const Vector3d omega = dcm(m.in.attitude.sigma_BN) * eigen(m.out.reference.omega_RN_N);
        EXPECT_LT((omega - eigen(m.in.attitude.omega_BN_B)).norm(), 1e-14);
        EXPECT_EQ(m.out.status.phase, SLEW_SLEWING);
        EXPECT_LT(difference(dcm_RT(slew.at(slew.length() - 1e-3)), Matrix3d::Identity()), 1e-9);
        EXPECT_LT(omega_RT(slew.at(slew.length() - 1e-3)).norm(), 1e-8);
        const SlewProfile last = slew.at(slew.length() + random.real(1e-6, 100));
        EXPECT_TRUE(same_content(last.out.reference, last.in.target)) << "to the bit";
        EXPECT_EQ(last.out.status.phase, SLEW_TRACKING);
        EXPECT_EQ(last.out.status.remaining, 0);
    }
}

TEST(SlewProfile, rate_and_acceleration_are_derivatives)
{
    Random random{2};
    double worst = 0, worse = 0;
    for (int i = 0; i < 600; i++) {
        const Slew slew = any(random, 0.01, 1.5 * degree);
        const auto &mem = slew.begun.mem;
        const double h = 0.25, now = random.real(h, slew.length() + 20);
        double edge = 0;
        for (const double part : {mem.stop, mem.ramp, mem.coast, mem.ramp}) {
            edge += part;
            if (std::abs(now - edge) < 2 * h) { // a third derivative jumps there
                edge = -1;
                break;
            }
        }
        if (edge < 0) {
            continue;
        }
        const auto at = [&](double t) { return slew.at(now + t).out.reference; };
        const KinematicErrors errors = kinematic_errors(at, 0.05 / h);
        worst = std::max(worst, errors.rate);
        worse = std::max(worse, errors.acceleration);
    }
    EXPECT_LT(worst, 1e-10);
    EXPECT_LT(worse, 1e-10);
}

TEST(SlewProfile, limits_hold_and_the_acceleration_is_continuous)
{
    Random random{3};
    double fastest = 0, hardest = 0;
    for (int i = 0; i < runs(60); i++) {
        const Slew slew = any(random, 0.0, i % 2 ? 0.9 * degree : 0);
        const double step = 0.05, jerk = 6 * std::pow(slew.begun.par.accel_max, 2);
        Vector3d before = Vector3d::Zero();
        for (double t = 0; t < slew.length() + 2; t += step) {
            const SlewProfile m = slew.at(t);
            const double rate = omega_RT(m).norm();
            const Vector3d acceleration = eigen(m.out.reference.domega_RN_N) - eigen(m.in.target.domega_RN_N);
            fastest = std::max(fastest, rate);
            hardest = std::max(hardest, acceleration.norm());
            if (i % 2 == 0) { // the stiffest ramp is the shortest; its first derivative is 6 rate / ramp^2
                const double most = std::max(jerk / slew.begun.out.status.peak, 6 * std::pow(0.02 * degree, 2));
                ASSERT_LT((acceleration - before).norm(), most * step) << t;
            }
            before = acceleration;
        }
    }
    EXPECT_LT(fastest, 1 * degree * (1 + 1e-9));
    EXPECT_LT(hardest, 0.02 * degree * (1 + 1e-9));
    EXPECT_GT(fastest, 0.99 * degree);
    EXPECT_GT(hardest, 0.0199 * degree);
}

TEST(SlewProfile, takes_the_shortest_way_in_the_time_that_it_says)
{
    for (const double turned : {0.0, 1e-9, 0.5 * degree, 30 * degree, 74.9 * degree, 75.1 * degree, 179 * degree}) {
        const Vector3d axis = Vector3d(1, 2, -2) / 3;
        const Slew slew({}, turn(axis, turned), Vector3d::Zero());
        const double a = 0.02 * degree, v = 1 * degree;
        const double expected = turned < 1.5 * v * v / a ? std::sqrt(6 * turned / a) : turned / v + 1.5 * v / a;
        EXPECT_NEAR(slew.length(), expected, 1e-4) << turned;
        if (turned > 1 * degree) {
            EXPECT_NEAR(slew.begun.out.status.peak, std::min(v, std::sqrt(turned * a / 1.5)), 1e-12);
            for (const double part : {0.1, 0.5, 0.8}) {
                const SlewProfile m = slew.at(part * slew.length());
                EXPECT_NEAR(angle(dcm_RT(m)), m.out.status.angle, 1e-12);
                EXPECT_LT((dcm_RT(m) * axis - axis).norm(), 1e-13) << "about the eigenaxis";
                EXPECT_LT(m.out.status.angle, turned);
            }
        }
    }
}

TEST(SlewProfile, begins_anew_where_the_target_jumps)
{
    Random random{4};
    Slew slew({random.attitude(), random.direction(), 0.01, 0}, random.attitude(), Vector3d::Zero());
    SlewProfile m = slew.at(400);
    EXPECT_EQ(m.out.status.phase, SLEW_TRACKING);
    EXPECT_EQ(m.out.status.slews, 1u) << "a target that moves far does not jump";
    for (const double jump : {0.9, 1.1}) {
        SlewProfile next = m;
        next.in.target = slew.target.at(401);
        next.in.attitude = {good(), m.in.target.sigma_RN, vec3(0.001, 0, 0)};
        next.in.target.sigma_RN =
            mrp_compose(mrp_turn(vec(random.direction() * jump * degree)), next.in.target.sigma_RN);
        slew_profile_update(&next, {ns(401), ns(1)});
        EXPECT_EQ(next.out.status.slews, jump < 1 ? 1u : 2u);
        EXPECT_EQ(next.out.status.phase, jump < 1 ? SLEW_TRACKING : SLEW_SLEWING);
        EXPECT_EQ(same_content(next.out.reference, next.in.target), jump < 1);
    }
    m.in.target = slew.target.at(401);
    m.in.target.omega_RN_N = vec3(0, 0, 0);
    SlewProfile next = m;
    slew_profile_update(&next, {ns(401), ns(1)});
    EXPECT_EQ(next.out.status.slews, 1u);
    m.par.rate_jump = 1e-3;
    slew_profile_update(&m, {ns(401), ns(1)});
    EXPECT_EQ(m.out.status.slews, 2u);
    m.in.target.head = with(QUALITY_STALE); // one that stands still is held, not left
    slew_profile_update(&m, {ns(402), ns(1)});
    EXPECT_EQ(m.out.status.slews, 2u);
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
    slew_profile_reset(&m);
    m.in.target = slew.target.at(403);
    slew_profile_update(&m, {ns(403), 0});
    EXPECT_EQ(m.out.status.slews, 1u);
    EXPECT_EQ(m.out.status.phase, SLEW_SLEWING);
}

/// A rigid body under feedback and what the reference's motion asks for: the largest error and motor torque.
std::pair<double, double> fly(bool profiled)
{
    const Vector3d inertia(0.10, 0.12, 0.05); // kg m^2, of a 12U
    const Base nadir{Matrix3d::Identity(), Vector3d(0.3, -0.9, 0.3).normalized(), 0.0011, 0};
    Matrix3d C = turn(Vector3d(1, -1, 2), 2.0);
    Vector3d omega(0.001, -0.002, 0.0005);
    SlewProfile m{};
    m.par = {1 * degree, 0.02 * degree, 1 * degree, 0};
    double error = 0, torque = 0;
    const double h = 0.1;
    for (int k = 0; k < 4000; k++) {
        m.in.attitude = {good(), dcm_to_mrp(mat(C)), vec(omega)};
        m.in.target = nadir.at(k * h);
        slew_profile_update(&m, {ns(k * h), k ? ns(h) : 0});
        const AttReference &r = profiled ? m.out.reference : m.in.target;
        const Vector3d sigma = eigen(mrp_relative(dcm_to_mrp(mat(C)), r.sigma_RN));
        const Vector3d wanted = C * eigen(r.omega_RN_N), rest = omega - wanted;
        const Vector3d forward = inertia.cwiseProduct(C * eigen(r.domega_RN_N) - omega.cross(wanted));
        const Vector3d u = -0.02 * sigma - 0.07 * rest + forward + omega.cross(inertia.cwiseProduct(omega).eval());
        error = std::max(error, 4 * std::atan(sigma.norm()));
        torque = std::max(torque, u.cwiseAbs().maxCoeff());
        for (int j = 0; j < 10; j++) {
            const Vector3d gyroscopic = omega.cross(inertia.cwiseProduct(omega).eval());
            omega += h / 10 * (u - gyroscopic).cwiseQuotient(inertia);
            C = turn(omega, omega.norm() * h / 10) * C;
        }
    }
    return {error, torque};
}

TEST(SlewProfile, at_the_last_instant_it_is_at_the_target)
{
    Random random{9};
    for (int i = 0; i < 300; i++) { // so slow that an instant is no longer than the rounding of the slew's length
        Slew slew = any(random, 0, 1e-8);
        slew.begun.mem.running = 0;
        slew.begun.par.accel_max = 1e-16;
        slew_profile_update(&slew.begun, {0, 0});
        const double last = std::nextafter(slew.length(), 0);
        const SlewProfile m = slew.at(last);
        EXPECT_LT(difference(dcm(m.out.reference.sigma_RN), dcm(m.in.target.sigma_RN)), 1e-13);
        EXPECT_GE(m.out.status.angle, 0.0);
        EXPECT_LT(m.out.status.angle, 1e-13);
    }
}

TEST(SlewProfile, a_body_follows_with_little_torque)
{
    const auto [error, torque] = fly(true);
    const auto [step_error, step_torque] = fly(false);
    EXPECT_LT(error, 0.05 * degree);
    EXPECT_LT(torque, 1.3 * 0.12 * 0.02 * degree);
    EXPECT_GT(step_torque, 50 * torque);
}

TEST(SlewProfile, without_an_attitude_or_numbers_the_reference_is_held)
{
    Random random{5};
    Slew slew = any(random, 0.01, 0.01);
    SlewProfile m = slew.at(10), fresh{};
    AttReference &target = m.in.target;
    expect_held(
        m, doubles(target.sigma_RN, target.omega_RN_N, target.domega_RN_N),
        [](SlewProfile &x) {
            slew_profile_update(&x, {ns(11), ns(1)});
        },
        [](SlewProfile &x) {
            return std::vector{&x.out.reference.head, &x.out.status.head};
        });
    fresh.par = m.par;
    fresh.in.target = target;
    slew_profile_update(&fresh, {0, 0});
    EXPECT_TRUE(all_zero(fresh.out)) << "no attitude to begin with";
    EXPECT_TRUE(all_zero(fresh.mem));
    fresh.in.attitude = m.in.attitude;
    fresh.in.attitude.head = with(QUALITY_STALE);
    slew_profile_update(&fresh, {ns(1), ns(1)});
    EXPECT_EQ(fresh.out.reference.head.quality, QUALITY_DEGRADED);
    fresh.in.attitude.sigma_BN.v[1] = std::nan("");
    slew_profile_update(&fresh, {ns(2), ns(1)});
    EXPECT_EQ(fresh.out.reference.head.sequence, 2u) << "the attitude is not used on the way";
}

} // namespace slew_profile_test
} // namespace flight::testing
