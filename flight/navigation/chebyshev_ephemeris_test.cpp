// SPDX-License-Identifier: Apache-2.0
// Against cos(k acos x), its derivatives, and the rules of spans.
#include "flight/testing/derivative.h"
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/navigation/chebyshev_ephemeris.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace chebyshev_ephemeris_test {

constexpr std::int64_t hour = 3'600'000'000'000;

ChebyshevEphemeris any(Random &random, std::uint32_t n, std::uint32_t segments)
{
    ChebyshevEphemeris m{};
    m.par.start = 17;
    m.par.duration = hour;
    m.par.segments = segments;
    m.par.n = n;
    for (auto &segment : m.par.c) {
        for (Vec3 &c : segment) {
            c = vec(random.vector(1e6));
        }
    }
    return m;
}

const BodyState &at(ChebyshevEphemeris &m, std::int64_t t)
{
    chebyshev_ephemeris_update(&m, {t, 0});
    return m.out.body;
}

TEST(ChebyshevEphemeris, is_the_sum_of_cosines)
{
    Random random{1};
    for (std::uint32_t n = 1; n <= EPHEMERIS_TERMS; n++) {
        ChebyshevEphemeris m = any(random, n, 8);
        for (int i = 0; i < 50; i++) {
            const int segment = random.below(8);
            const std::int64_t in = std::llround(random.real(0, 3.6e12 - 1));
            const double x = 2e-9 * static_cast<double>(in) / 3600 - 1;
            Vector3d sum = Vector3d::Zero();
            for (std::uint32_t k = 0; k < n; k++) {
                sum += std::cos(k * std::acos(x)) * eigen(m.par.c[segment][k]);
            }
            EXPECT_LT((eigen(at(m, 17 + segment * hour + in).r_PN_N) - sum).norm(), 1e-6);
            EXPECT_NEAR(m.out.state.left, (8 - segment) * 3600 - 1e-9 * static_cast<double>(in), 1e-6);
        }
    }
}

TEST(ChebyshevEphemeris, velocity_and_acceleration_are_the_derivatives)
{
    Random random{2};
    for (int i = 0; i < 200; i++) {
        ChebyshevEphemeris m = any(random, 1 + static_cast<std::uint32_t>(i) % EPHEMERIS_TERMS, 1);
        const double middle = random.real(200, 3400);
        const auto then = [&](double t) { return at(m, 17 + std::llround((middle + t) * 1e9)); };
        const auto r = [&](double t) -> Vector3d { return eigen(then(t).r_PN_N); };
        const auto v = [&](double t) -> Vector3d { return eigen(then(t).v_PN_N); };
        const double h = std::ldexp(1.0, 2);
        const BodyState now = then(0);
        EXPECT_LT((derivative<Vector3d>(r, h) - eigen(now.v_PN_N)).norm(), 1e-5 * 1e6 / 3600);
        EXPECT_LT((derivative<Vector3d>(v, h) - eigen(now.a_PN_N)).norm(), 1e-5 * 1e6 / 3600 / 100);
    }
}

TEST(ChebyshevEphemeris, covers_its_span_with_both_ends_and_nothing_else)
{
    Random random{3};
    ChebyshevEphemeris m = any(random, 5, 3);
    const std::int64_t end = 17 + 3 * hour;
    const auto sum = [&](int segment, double sign) {
        Vector3d all = Vector3d::Zero();
        for (int k = 0; k < 5; k++) {
            all += (k % 2 ? sign : 1) * eigen(m.par.c[segment][k]);
        }
        return all;
    };
    EXPECT_LT((eigen(at(m, 17).r_PN_N) - sum(0, -1)).norm(), 1e-8);
    EXPECT_LT((eigen(at(m, 17 + hour).r_PN_N) - sum(1, -1)).norm(), 1e-8);
    EXPECT_LT((eigen(at(m, end).r_PN_N) - sum(2, 1)).norm(), 1e-8);
    EXPECT_EQ(m.out.body.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.state.left, 0.0);
    for (const std::int64_t outside : {end + 1, std::int64_t{16}, INT64_MAX, INT64_MIN}) {
        const Head before = m.out.body.head;
        EXPECT_EQ(at(m, outside).head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.body.head.sequence, before.sequence);
        EXPECT_EQ(m.out.state.head.quality, QUALITY_DEGRADED);
    }
    EXPECT_EQ(at(m, end - 1).head.quality, QUALITY_GOOD);
}

TEST(ChebyshevEphemeris, without_segments_or_coefficients_nothing_is_known)
{
    Random random{6};
    for (const auto &[n, segments] : {std::pair{0u, 3u}, {5u, 0u}, {0u, 0u}}) {
        ChebyshevEphemeris m = any(random, n, segments);
        EXPECT_EQ(at(m, 17).head.quality, QUALITY_NONE);
        EXPECT_EQ(m.out.state.head.quality, QUALITY_DEGRADED);
    }
}

/// By polynomials of 1 ns, whose derivatives are large: each of the three alone is not finite.
TEST(ChebyshevEphemeris, what_is_not_finite_is_held)
{
    const double huge[3] = {INFINITY, 1e300, 1e295};
    for (int degree = 0; degree < 3; degree++) {
        ChebyshevEphemeris m{};
        m.par.duration = 1;
        m.par.segments = 1;
        m.par.n = 3;
        m.par.c[0][degree] = vec3(0, 1e270, 0);
        EXPECT_EQ(at(m, 1).head.quality, QUALITY_GOOD) << degree;
        m.par.c[0][degree] = vec3(0, huge[degree], 0);
        EXPECT_EQ(at(m, 1).head.quality, QUALITY_DEGRADED) << degree;
        EXPECT_EQ(m.out.body.head.sequence, 1u);
        EXPECT_LT(m.out.body.r_PN_N.v[1], 1e280);
    }
}

TEST(ChebyshevEphemeris, takes_blocks_in_preference_to_parameters_and_refuses_bad_ones)
{
    Random random{4};
    ChebyshevEphemeris m = any(random, 5, 3);
    const Vector3d before = eigen(at(m, 2 * hour).r_PN_N);
    for (std::uint32_t k = 0; k < 6; k++) { // the first two give way to the last two
        EphemerisBlock &block = m.in.block;
        block.head = good();
        block.start = k * hour;
        block.duration = hour - 1;
        block.n = 1;
        block.number = 10 + k;
        block.c[0] = vec3(k, 0, 0);
        at(m, 0);
        at(m, 0);
    }
    EXPECT_EQ(m.out.state.taken, 6u);
    for (int k = 2; k < 6; k++) {
        EXPECT_EQ(at(m, k * hour + 1000).r_PN_N.v[0], k);
    }
    EXPECT_LT((eigen(at(m, 2 * hour - 1000).r_PN_N) - before).norm(), 10.0) << "by the parameters";

    for (int bad = 0; bad < 5; bad++) {
        EphemerisBlock &block = m.in.block;
        block.number++;
        block.n = bad == 0 ? 17 : bad == 1 ? 0 : bad == 4 ? 2 : 1;
        block.duration = bad == 2 ? 0 : hour;
        block.c[0] = vec3(bad >= 3 ? NAN : 99, 0, 0);
        block.c[1] = vec3(0, 0, 0);
        at(m, 5 * hour + 1000);
        EXPECT_EQ(m.out.state.refused, static_cast<std::uint32_t>(bad + 1));
        EXPECT_EQ(m.out.body.r_PN_N.v[0], 5);
    }
}

TEST(ChebyshevEphemeris, follows_the_ephemerides_time_where_it_is_wired)
{
    Random random{5};
    ChebyshevEphemeris m = any(random, 5, 3);
    const BodyState then = at(m, hour / 3);
    m.in.time = {good(), hour / 3};
    EXPECT_EQ(at(m, INT64_MAX).r_PN_N.v[1], then.r_PN_N.v[1]);
    m.in.time.head.quality = QUALITY_STALE;
    EXPECT_EQ(at(m, 0).head.quality, QUALITY_DEGRADED);
}

} // namespace chebyshev_ephemeris_test
} // namespace flight::testing
