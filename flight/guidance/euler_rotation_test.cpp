// SPDX-License-Identifier: Apache-2.0
// Euler rotations: motion against numerical derivatives, chains against the twelve Euler sequences.
#include "flight/testing/base.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/euler_rotation.h"
}

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {
namespace euler_rotation_test {

EulerRotation rotation(const Vector3d &angles, const Vector3d &rates)
{
    EulerRotation m{};
    m.par.angles = vec(angles);
    m.par.rates = vec(rates);
    return m;
}

TEST(EulerRotation, rate_and_acceleration_are_derivatives)
{
    expect_derivatives<EulerRotation>(
        [](Random &random, double rate) { return rotation(random.vector(pi), random.vector(rate)); },
        euler_rotation_update);
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
                        chain.push_back(rotation(angle * Vector3d::Unit(2 - axis), rate * Vector3d::Unit(2 - axis)));
                        omega += c.transpose() * Vector3d::Unit(axis) * rate;
                        c = turn(axis, angle + rate * t) * c;
                    }
                    AttReference reference = run(chain, base, t, euler_rotation_update);
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
        auto at = [&](double t) { return run(chain, base, start + t, euler_rotation_update); };
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
    EulerRotation m = rotation({0.1, 0.2, 0.3}, {1, 1, 1});
    m.in.base.head = good();
    euler_rotation_update(&m, {0, 0});
    euler_rotation_update(&m, {500, 500});
    euler_rotation_reset(&m);
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

EulerCommand command(double start, const Vector3d &angles, const Vector3d &rates)
{
    return {good(), ns(start), vec(angles), vec(rates)};
}

TEST(EulerRotation, a_command_replaces_the_parameters_exactly_when_it_starts)
{
    Vector3d angles{0.1, -0.2, 0.3}, rates{0.01, 0.005236, -0.02};
    for (std::int64_t period : {100'000'000, 700'000'000, 2'000'000'000}) {
        EulerRotation m = rotation({1, 2, 3}, {0.5, 0.25, 0.125});
        m.in.base.head = good();
        m.in.command = command(4.05, angles, rates); // known long before
        for (std::int64_t t = 0; t < 20'000'000'000; t += period) {
            euler_rotation_update(&m, {t, period});
            bool started = t >= 4'050'000'000;
            double since = tick_seconds(started ? t - 4'050'000'000 : t);
            const Vec3 &from = started ? m.in.command.angles : m.par.angles;
            const Vec3 &rate = started ? m.in.command.rates : m.par.rates;
            for (int i = 0; i < 3; i++) {
                ASSERT_EQ(m.out.euler.angles.v[i], from.v[i] + since * rate.v[i]) << t;
                ASSERT_EQ(m.out.euler.rates.v[i], rate.v[i]) << t;
            }
        }
    }
}

TEST(EulerRotation, a_command_stays_until_the_next_one_starts)
{
    EulerRotation m = rotation({0, 0, 0}, {0, 0, 0});
    m.in.base.head = good();
    auto yaw_at = [&](double t) {
        euler_rotation_update(&m, {ns(t), 500'000'000});
        return m.out.euler.angles.v[0];
    };
    m.in.command = command(1, {1, 0, 0}, {0.5, 0, 0});
    EXPECT_EQ(yaw_at(0.5), 0);
    EXPECT_EQ(yaw_at(2), 1.5);
    m.in.command = command(4, {5, 0, 0}, {0.25, 0, 0});
    EXPECT_EQ(yaw_at(3), 2);
    m.in.command = command(5, {6, 0, 0}, {0, 0, 0}); // given instead of the one that was to come
    EXPECT_EQ(yaw_at(4.5), 2.75);
    EXPECT_EQ(yaw_at(5), 6);
    m.in.command.head = Head{}; // its sender was reset
    EXPECT_EQ(yaw_at(6), 6);
    m.in.command = command(3, {1, 0, 0}, {0.5, 0, 0}); // as if it had been in effect since
    EXPECT_EQ(yaw_at(7), 3);
    euler_rotation_reset(&m);
    m.in.command.head = Head{};
    EXPECT_EQ(yaw_at(8), 0) << "the parameters again";
}

TEST(EulerRotation, rate_and_acceleration_are_derivatives_under_a_command)
{
    Random random{6};
    for (int i = 0; i < 300; i++) {
        double h = std::ldexp(1e-9, 26 + i % 12), rate = 0.05 / h;
        Base base = any_base(random, rate);
        EulerRotation m = rotation(random.vector(), random.vector(rate));
        m.in.command = command(0, random.vector(pi), random.vector(rate));
        double now = h * (2 + random.below(20));
        auto at = [&](double t) { return run<EulerRotation>({m}, base, now + t, euler_rotation_update); };
        KinematicErrors errors = kinematic_errors(at, rate);
        EXPECT_LT(errors.rate, 1e-8);
        EXPECT_LT(errors.acceleration, 1e-8);
    }
}

TEST(EulerRotation, a_command_from_before_the_run_is_ignored)
{
    EulerRotation m = rotation({0.1, 0.2, 0.3}, {0, 0, 0});
    m.in.base.head = good();
    m.in.command = command(0, {1, 1, 1}, {1, 1, 1});
    for (std::int64_t start : {std::int64_t{-1}, std::numeric_limits<std::int64_t>::min()}) {
        m.in.command.start = start;
        euler_rotation_update(&m, {0, 0});
        EXPECT_EQ(eigen(m.out.euler.angles), Vector3d(0.1, 0.2, 0.3));
    }
}

TEST(EulerRotation, quality_follows_the_command)
{
    EulerRotation m = rotation({0, 0, 0}, {0.5, 0, 0});
    m.in.base.head = good();
    for (auto [in, out] :
         {std::pair{QUALITY_NONE, QUALITY_GOOD}, {QUALITY_STALE, QUALITY_DEGRADED}, {QUALITY_GOOD, QUALITY_GOOD}}) {
        m.in.command.head = with(in);
        euler_rotation_update(&m, {0, 0});
        EXPECT_EQ(m.out.reference.head.quality, out);
    }
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
    expect_held(
        m, doubles(base.sigma_RN, base.omega_RN_N, base.domega_RN_N, m.par.angles, m.par.rates),
        [](EulerRotation &x) {
            euler_rotation_update(&x, {500, 500});
        },
        [](EulerRotation &x) {
            return std::vector{&x.out.reference.head, &x.out.euler.head};
        });
}

TEST(EulerRotation, holds_the_last_reference_against_a_command_that_is_not_finite)
{
    EulerRotation m = rotation({0, 0, 0}, {0, 0, 0});
    m.in.base.head = good();
    m.in.command = command(0, {1, 2, 3}, {4, 5, 6});
    euler_rotation_update(&m, {0, 0});
    const EulerCommand commanded = m.mem.commanded;
    expect_held(
        m, doubles(m.in.command.angles, m.in.command.rates),
        [&](EulerRotation &x) {
            euler_rotation_update(&x, {500, 500});
            EXPECT_TRUE(same_content(x.mem.commanded, commanded));
        },
        [](EulerRotation &x) {
            return std::vector{&x.out.reference.head, &x.out.euler.head};
        });
}

} // namespace euler_rotation_test
} // namespace flight::testing
