// SPDX-License-Identifier: Apache-2.0
// Euler rotations: motion against numerical derivatives, chains against the twelve Euler sequences.
#include "flight/testing/kinematics.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/euler_rotation.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {
namespace {

std::int64_t ns(double t) { return std::llround(t * 1e9); }

/// A base that turns about an axis fixed in N, faster and faster: [R0N] = turn(axis, angle) C.
struct Base {
    Matrix3d c = Matrix3d::Identity();
    Vector3d axis_N = Vector3d::UnitX();
    double rate = 0, acceleration = 0;

    AttReference at(double t) const
    {
        double angle = rate * t + acceleration * t * t / 2;
        Vector3d omega = axis_N * (rate + acceleration * t), domega = axis_N * acceleration;
        return {good(ns(t)), dcm_to_mrp(mat(c * turn(axis_N, angle))), vec(omega), vec(domega)};
    }
};

Base any_base(Random &random, double rate)
{
    return {random.attitude(), random.direction(), random.real(-rate, rate),
            random.real(-rate, rate) * rate};
}

EulerRotation rotation(const Vector3d &angles, const Vector3d &rates)
{
    EulerRotation m{};
    m.par.angles = vec(angles);
    m.par.rates = vec(rates);
    return m;
}

/// The reference of a chain of rotations at time t, all of which began to turn at time 0.
AttReference run(std::vector<EulerRotation> chain, const Base &base, double t)
{
    AttReference reference = base.at(t);
    for (EulerRotation &m : chain) {
        m.in.base = base.at(0);
        euler_rotation_update(&m, {0, 0});
        m.in.base = reference;
        euler_rotation_update(&m, {ns(t), ns(t)});
        reference = m.out.reference;
    }
    return reference;
}

TEST(EulerRotation, rate_and_acceleration_are_derivatives)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        // The widest difference is a power of two in ns, so that all differences are exact times.
        double h = std::ldexp(1e-9, 26 + i % 12), rate = 0.05 / h;
        Base base = any_base(random, rate);
        std::vector<EulerRotation> chain;
        for (int k = 0; k <= i % 3; k++) {
            chain.push_back(rotation(random.vector(pi), random.vector(rate)));
        }
        double now = h * (1 + random.below(20));
        auto at = [&](double t) { return run(chain, base, now + t); };
        KinematicErrors errors = kinematic_errors(at, rate);
        EXPECT_LT(errors.rate, 1e-8);
        EXPECT_LT(errors.acceleration, 1e-8);
    }
}

TEST(EulerRotation, three_in_a_chain_make_the_twelve_sequences)
{
    Random random{2};
    int sequences = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++) {
                if (i == j || j == k) {
                    continue;
                }
                sequences++;
                for (int trial = 0; trial < 100; trial++) {
                    Base base = any_base(random, 0.1);
                    double t = 0.5 * random.below(200);
                    AttReference at = base.at(t);
                    Matrix3d c = dcm(at.sigma_RN);
                    Vector3d omega = eigen(at.omega_RN_N);
                    std::vector<EulerRotation> chain;
                    for (int axis : {i, j, k}) {
                        double angle = random.real(-pi, pi), rate = random.real(-0.1, 0.1);
                        // Angles are given as psi, theta, phi: about the third axis first.
                        chain.push_back(rotation(angle * Vector3d::Unit(2 - axis),
                                                 rate * Vector3d::Unit(2 - axis)));
                        omega += c.transpose() * Vector3d::Unit(axis) * rate;
                        c = turn(axis, angle + rate * t) * c;
                    }
                    AttReference reference = run(chain, base, t);
                    EXPECT_LT(difference(dcm(reference.sigma_RN), c), 1e-14);
                    EXPECT_LT((eigen(reference.omega_RN_N) - omega).norm(), 1e-15);
                }
            }
        }
    }
    EXPECT_EQ(sequences, 12);
}

TEST(EulerRotation, is_free_of_singularities)
{
    Random random{3};
    for (int i = 0; i < 300; i++) {
        double h = std::ldexp(1e-9, 30), rate = 0.05 / h;
        double pitch = i % 2 ? pi / 2 : -pi / 2; // where 3-2-1 angles are not unique
        Vector3d angles{random.real(-pi, pi), pitch, random.real(-pi, pi)};
        std::vector<EulerRotation> chain{rotation(angles, random.vector(rate))};
        Base base = any_base(random, rate);
        double start = 2 * h; // the chain stands at the singular angles there
        chain[0].par.angles = vec(angles - start * eigen(chain[0].par.rates));
        auto at = [&](double t) { return run(chain, base, start + t); };
        KinematicErrors errors = kinematic_errors(at, rate);
        EXPECT_LT(errors.rate, 1e-8);
        EXPECT_LT(errors.acceleration, 1e-8);
    }
}

TEST(EulerRotation, first_reference_is_exact_and_time_never_accumulates)
{
    Vector3d angles{0.1, -0.2, 0.3}, rates{0.01, 0.005236, -0.02};
    EulerRotation m = rotation(angles, rates);
    std::int64_t start = 123'456'789'012'345, period = 100'000'000; // 0.1 s is no double
    Base base;
    for (int k = 0; k <= 10000; k++) {
        m.in.base = base.at(0);
        euler_rotation_update(&m, {start + k * period, k ? period : 0});
        double t = static_cast<double>(k) / 10;
        for (int i = 0; i < 3; i++) {
            ASSERT_EQ(m.out.euler.angles.v[i], angles[i] + t * rates[i]) << "step " << k;
        }
    }
    EXPECT_EQ(eigen(m.out.euler.rates), rates);
    EXPECT_GT(m.out.euler.angles.v[0], 2 * pi) << "the angles are not wrapped";
    Matrix3d c = turn(0, 0.3 - 20) * turn(1, -0.2 + 5.236) * turn(2, 0.1 + 10);
    EXPECT_LT(difference(dcm(m.out.reference.sigma_RN), c), 1e-14);
}

TEST(EulerRotation, after_a_reset_the_angles_begin_anew)
{
    EulerRotation m = rotation({0.1, 0.2, 0.3}, {1, 1, 1}), fresh = m;
    m.in.base.head = good();
    euler_rotation_update(&m, {0, 0});
    euler_rotation_update(&m, {500, 500});
    euler_rotation_reset(&m);
    m.in.base.head = Head{};
    EXPECT_EQ(std::memcmp(&m, &fresh, sizeof m), 0) << "parameters stay, the rest is zero";
    m.in.base.head = good();
    euler_rotation_update(&m, {1000, 0});
    EXPECT_EQ(eigen(m.out.euler.angles), Vector3d(0.1, 0.2, 0.3));
}

TEST(EulerRotation, angles_count_from_the_first_update_even_without_a_base)
{
    EulerRotation m = rotation({0, 0, 0}, {0.5, 0, 0});
    euler_rotation_update(&m, {0, 0});
    EXPECT_TRUE(all_zero(m.out));
    m.in.base.head = good();
    euler_rotation_update(&m, {2'000'000'000, 2'000'000'000});
    EXPECT_EQ(m.out.euler.angles.v[0], 1);
    EXPECT_EQ(m.out.reference.head.sequence, 1u);
}

TEST(EulerRotation, quality_follows_the_base)
{
    EulerRotation m = rotation({0, 0, 0}, {0.5, 0, 0});
    for (auto [in, out] : {std::pair{QUALITY_STALE, QUALITY_DEGRADED},
                           {QUALITY_DEGRADED, QUALITY_DEGRADED},
                           {QUALITY_GOOD, QUALITY_GOOD}}) {
        m.in.base.head = with(in);
        euler_rotation_update(&m, {0, 0});
        EXPECT_EQ(m.out.reference.head.quality, out);
        EXPECT_EQ(m.out.euler.head.quality, out);
    }
}

TEST(EulerRotation, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    Random random{4};
    EulerRotation m = rotation(random.vector(), random.vector());
    m.in.base = any_base(random, 0.1).at(1);
    euler_rotation_update(&m, {0, 0});
    AttReference &base = m.in.base;
    expect_held(m, doubles(base.sigma_RN, base.omega_RN_N, base.domega_RN_N, m.par.angles,
                           m.par.rates),
                [](EulerRotation &x) { euler_rotation_update(&x, {500, 500}); },
                [](EulerRotation &x) {
                    return std::vector{&x.out.reference.head, &x.out.euler.head};
                });
}

TEST(EulerRotation, gives_finite_numbers_whatever_it_is_given)
{
    Random random{5};
    EulerRotation m{};
    AttReference &base = m.in.base, &out = m.out.reference;
    EulerAngles &euler = m.out.euler;
    Doubles in = doubles(base.sigma_RN, base.omega_RN_N, base.domega_RN_N, m.par);
    for (int round = 0; round < 20000; round++) {
        throw_numbers(in, random, round);
        base.head.quality = any_quality(random);
        euler_rotation_update(&m, {round * 1'000'000'000'000, 1});
        expect_finite(doubles(out.sigma_RN, out.omega_RN_N, out.domega_RN_N, euler.angles,
                              euler.rates), round);
    }
}

} // namespace
} // namespace flight::testing
