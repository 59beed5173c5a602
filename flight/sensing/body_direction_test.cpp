// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/poison.h"

extern "C" {
#include "flight/sensing/body_direction.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace body_direction_test {

constexpr std::int64_t second = 1'000'000'000;
constexpr double au = 1.495978707e11;

/// A spacecraft on a circle about the origin of N, which sees a body at rest.
struct Seen {
    BodyDirection m{};
    Vector3d r_PN, x, y;
    Matrix3d dcm_BN;
    double radius = 7e6, rate = 1e-3;

    explicit Seen(std::uint64_t seed)
    {
        Random random{seed};
        m.par.std = 0.01;
        r_PN = au * random.direction();
        dcm_BN = random.attitude();
        x = random.direction();
        y = x.cross(random.direction()).normalized();
    }

    Vector3d r_BN(double t) const { return radius * (std::cos(rate * t) * x + std::sin(rate * t) * y); }

    void update(std::int64_t t, std::int64_t measured)
    {
        const double now = 1e-9 * static_cast<double>(t);
        const Vector3d v = radius * rate * (std::cos(rate * now) * y - std::sin(rate * now) * x);
        const Vector3d r_PB = (m.par.central ? Vector3d::Zero() : r_PN) - r_BN(1e-9 * static_cast<double>(measured));
        m.in.heading = {good(measured), vec(Vector3d(dcm_BN * r_PB.normalized()))};
        m.in.body = {good(t), vec(r_PN), vec3(0, 0, 0), vec3(0, 0, 0)};
        m.in.orbit = {good(t), vec(r_BN(now)), vec(v), vec3(0, 0, 0)};
        body_direction_update(&m, {t, second});
    }

    double error() const { return (eigen(m.out.seen.d_B) - dcm_BN * eigen(m.out.seen.d_N)).norm(); }
    Quality quality() const { return m.out.seen.head.quality; }
};

TEST(BodyDirection, is_that_at_the_time_of_the_measurement)
{
    for (std::uint64_t seed = 1; seed < 200; seed++) {
        for (const std::uint32_t central : {0u, 1u}) {
            Seen s(seed);
            s.m.par.central = central;
            s.update(60 * second, 57 * second);
            EXPECT_EQ(s.quality(), QUALITY_GOOD);
            EXPECT_EQ(s.m.out.seen.head.t, 57 * second);
            EXPECT_EQ(s.m.out.seen.std, 0.01);
            EXPECT_LT(s.error(), central ? 5e-6 : 1e-9) << "half the square of 3 mrad, on a planet's horizon";
            EXPECT_NEAR(vec_norm(s.m.out.seen.d_N), 1, 1e-15);
            s.m.in.orbit.head = {};
            s.m.in.heading.head.t = 58 * second;
            body_direction_update(&s.m, {61 * second, second});
            EXPECT_EQ(s.quality(), central ? QUALITY_DEGRADED : QUALITY_GOOD);
            EXPECT_LT(s.error(), central ? 2e-3 : 5e-5) << "parallax";
        }
    }
}

TEST(BodyDirection, gives_each_measurement_once)
{
    Seen s(1);
    s.update(10 * second, 9 * second);
    const SeenDirection first = s.m.out.seen;
    s.m.in.heading.s_B = vec3(1, 0, 0); // what is not new is not read
    body_direction_update(&s.m, {11 * second, second});
    s.m.in.heading.head.t = 8 * second;
    body_direction_update(&s.m, {12 * second, second});
    s.m.in.heading.head.t = 14 * second; // to come
    body_direction_update(&s.m, {13 * second, second});
    EXPECT_EQ(std::memcmp(&s.m.out.seen, &first, sizeof first), 0);
    body_direction_update(&s.m, {14 * second, second});
    EXPECT_EQ(s.m.out.seen.head.t, 14 * second);
    EXPECT_EQ(s.m.out.seen.head.sequence, 2u);
    s.update(3 * second, 2 * second); // the clock went back
    EXPECT_EQ(s.m.out.seen.head.t, 2 * second);
    EXPECT_EQ(s.quality(), QUALITY_GOOD);
}

TEST(BodyDirection, has_the_quality_of_its_inputs)
{
    for (int lost = 0; lost < 3; lost++) {
        for (const Quality quality : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED}) {
            Seen s(2);
            s.update(10 * second, 10 * second);
            Head *const heads[] = {&s.m.in.heading.head, &s.m.in.body.head, &s.m.in.orbit.head};
            s.m.in.heading.head.t = 11 * second;
            heads[lost]->quality = quality;
            body_direction_update(&s.m, {11 * second, second});
            const bool optional = lost == 2 && quality == QUALITY_NONE, written = lost == 2 || quality != QUALITY_NONE;
            EXPECT_EQ(s.quality(), optional ? QUALITY_GOOD : QUALITY_DEGRADED) << lost << " " << quality;
            EXPECT_EQ(s.m.out.seen.head.t, (written ? 11 : 10) * second) << lost << " " << quality;
        }
    }
    BodyDirection nothing{};
    nothing.par.std = 0.01;
    body_direction_update(&nothing, {1, 1});
    EXPECT_TRUE(all_zero(nothing.out));
}

TEST(BodyDirection, is_finite_and_of_unit_length_whatever_comes)
{
    Seen s(3);
    s.update(10 * second, 10 * second);
    s.m.in.heading.head.t = 11 * second;
    expect_held(
        s.m, doubles(s.m.in.heading.s_B, s.m.in.body.r_PN_N, s.m.in.orbit.r_BN_N),
        [](BodyDirection &m) {
            body_direction_update(&m, {11 * second, second});
        },
        [](BodyDirection &m) { return std::vector<Head *>{&m.out.seen.head}; });
    Random random{4};
    for (int round = 0; round < 20000; round++) {
        BodyDirection &m = s.m;
        throw_numbers(doubles(m.in.heading.s_B, m.in.body.r_PN_N, m.in.body.v_PN_N, m.in.orbit.r_BN_N, m.par.std),
                      random, round);
        m.in.heading.head = {random.below(2) ? round : INT64_MIN, any_quality(random), 1};
        m.in.body.head = {random.below(2) ? INT64_MAX : round, any_quality(random), 1};
        m.in.orbit.head = {INT64_MIN, any_quality(random), 1};
        m.par.central = static_cast<std::uint32_t>(random.below(2));
        body_direction_update(&m, {round, 1});
        ASSERT_TRUE(!head_written(m.out.seen.head) || m.out.seen.head.quality < QUALITY_GOOD ||
                    direction_speaks(&m.out.seen));
        expect_finite(doubles(m.out.seen.d_B, m.out.seen.d_N, m.out.seen.std), round);
    }
    s.m.in.heading = {good(1'000'000), vec3(0, 0, 0)};
    body_direction_update(&s.m, {1'000'000, 1});
    EXPECT_EQ(s.quality(), QUALITY_DEGRADED) << "no direction";
}

} // namespace body_direction_test
} // namespace flight::testing
