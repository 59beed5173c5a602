// SPDX-License-Identifier: Apache-2.0
// Against rays from the Sun's disc past an ellipsoid, Kepler's motion, and orbits whose eclipses are known.
#include "flight/testing/conics.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/navigation/eclipse_on_board.h"
}

namespace flight::testing {
namespace eclipse_on_board_test {

constexpr double AU = 149597870700.0, Rs = 695700e3, R = 6378137.0, mu = 3.986004418e14, f = 1 / 298.257223563;

EclipseOnBoard behind(const Vector3d &sun, const Vector3d &r, double flattening = 0)
{
    EclipseOnBoard m{};
    m.par.radius = R;
    m.par.flattening = flattening;
    m.in.sun.head = good();
    m.in.sun.r_PN_N = vec(sun);
    m.in.orbit.head = good();
    m.in.orbit.r_BN_N = vec(r);
    return m;
}

const ShadowState &at(EclipseOnBoard &m)
{
    eclipse_on_board_update(&m, {0, 1});
    return m.out.shadow;
}

/// The part of the Sun's disc that is seen from r, by rays to points all over it, past an ellipsoid.
double by_rays(const Vector3d &r, const Vector3d &sun, double flattening, int n = 4000)
{
    const Vector3d line = (sun - r).normalized(), side = line.unitOrthogonal(), other = line.cross(side);
    const auto sphere = [&](const Vector3d &a) { return Vector3d(a.x(), a.y(), a.z() / (1 - flattening)); };
    int seen = 0;
    for (int i = 0; i < n; i++) { // as the seeds of a sunflower
        const double rho = Rs * std::sqrt((i + 0.5) / n), angle = i * pi * (3 - std::sqrt(5.0));
        const Vector3d point = sun + rho * (std::cos(angle) * side + std::sin(angle) * other);
        const Vector3d from = sphere(r), ray = sphere(point - r).normalized();
        const double along = -from.dot(ray);
        seen += !(along > 0 && (from + along * ray).norm() < R);
    }
    return static_cast<double>(seen) / n;
}

TEST(EclipseOnBoard, the_lit_part_is_that_of_rays_past_the_body)
{
    Random random{1};
    int parts = 0;
    for (int i = 0; i < runs(600); i++) {
        const double flattening = i % 3 == 0 ? 0 : i % 3 == 1 ? f : 0.1;
        const double height = R * std::pow(10.0, random.real(0.02, i % 2 ? 0.2 : 2.5));
        const Vector3d sun = AU * random.direction(), axis = -sun.normalized();
        // Near the edge of the shadow, where the distance from the axis is that of the limb.
        const Vector3d side = axis.unitOrthogonal(), across = std::cos(i) * side + std::sin(i) * axis.cross(side);
        const double limb =
            std::sqrt(std::pow(1 - flattening, 2) + (1 - std::pow(1 - flattening, 2)) * random.real(0, 1));
        const double off = R * limb + random.real(-1.5, 1.5) * height * Rs / AU;
        const Vector3d r = height * axis + off * across;
        EclipseOnBoard m = behind(sun, r, flattening);
        const double lit = by_rays(r, sun, flattening);
        EXPECT_NEAR(at(m).lit, lit, 3e-3 + 0.6 * flattening) << flattening << " " << height << " " << off;
        EXPECT_EQ(m.out.shadow.head.quality, QUALITY_GOOD);
        const ShadowPhase phase = m.out.shadow.phase;
        EXPECT_TRUE(phase == SHADOW_PENUMBRA || m.out.shadow.lit == (phase == SHADOW_SUNLIT));
        if (lit > 2e-3 && lit < 1 - 2e-3) {
            EXPECT_EQ(phase, SHADOW_PENUMBRA) << lit;
            parts++;
        }
    }
    EXPECT_GT(parts, runs(100));
}

TEST(EclipseOnBoard, behind_the_tip_of_the_umbra_a_ring_is_seen)
{
    const double D = AU, tip = R * D / (Rs - R);
    for (const double share : {0.9, 0.999, 1.001, 1.5, 10.0}) {
        EclipseOnBoard m = behind({D, 0, 0}, {-share * tip, 0, 0});
        const double ratio = std::asin(R / (share * tip)) / std::asin(Rs / (D + share * tip));
        EXPECT_NEAR(at(m).lit, share < 1 ? 0 : 1 - ratio * ratio, 1e-9) << share;
        EXPECT_EQ(m.out.shadow.phase, share < 1 ? SHADOW_UMBRA : SHADOW_PENUMBRA);
    }
}

TEST(EclipseOnBoard, another_body_is_seen_as_the_one_in_the_origin)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        const Vector3d sun = AU * random.direction(), moved = 4e8 * random.direction();
        const Vector3d r = -1.1 * R * sun.normalized() + 1.1 * R * random.direction();
        EclipseOnBoard m = behind(sun, r), other = behind(sun + moved, r + moved);
        other.in.body = {good(), vec(moved), {}, {}};
        EXPECT_NEAR(at(m).lit, at(other).lit, 1e-9);
        other.in.body.head.quality = QUALITY_STALE;
        EXPECT_EQ(at(other).head.quality, r.norm() > R ? QUALITY_DEGRADED : QUALITY_NONE);
    }
}

/// A module on an orbit, with the Sun and another body that move.
struct Case {
    EclipseOnBoard m;
    Motion craft, sun, body;

    Case(Random &random, double e, bool moon)
    {
        craft = on_conic(random, mu, random.real(6.7e6, 4.3e7), e, 30);
        const Vector3d s = random.direction(), to = random.direction();
        sun = {AU * s, 3e4 * s.unitOrthogonal()};
        body = {4e8 * to, 1e3 * to.unitOrthogonal()};
        m = behind(sun.r, craft.r, f);
        m.par.mu = mu;
        m.in.orbit.v_BN_N = vec(craft.v);
        m.in.sun.v_PN_N = vec(sun.v);
        if (moon) { // which comes between
            body.r = craft.r + 4e8 * (s + 0.02 * random.direction());
            m.in.body = {good(), vec(body.r), vec(body.v), {}};
        }
    }
    ShadowPhase phase(double t) const
    {
        EclipseOnBoard then = m;
        then.par.mu = 0;
        then.in.orbit.r_BN_N = vec(kepler(craft, mu, t).r);
        then.in.sun.r_PN_N = vec(sun.r + t * sun.v);
        then.in.body.r_PN_N = vec(body.r + t * body.v);
        return at(then).phase;
    }
    double period() const { return 2 * pi * mu / std::pow(2 * mu / craft.r.norm() - craft.v.squaredNorm(), 1.5); }
};

TEST(EclipseOnBoard, the_next_change_is_that_of_keplers_motion)
{
    Random random{3};
    int changes[3] = {0, 0, 0}, missed = 0;
    for (int i = 0; i < runs(400); i++) {
        Case c(random, i % 3 == 0 ? 1e-3 : random.real(0, 0.8), i % 4 == 3);
        const ShadowState now = at(c.m);
        const double end = now.change > 0 ? now.change - 1e-3 : c.period();
        if (now.change > 0) {
            changes[now.phase]++;
            EXPECT_EQ(c.phase(now.change - 1e-3), now.phase) << i;
            EXPECT_NE(c.phase(now.change + 1e-3), now.phase) << i;
        }
        for (int k = 1; k < 60; k++) { // nothing before, unless it is short
            if (c.phase(end * k / 60) != now.phase) {
                missed++;
                break;
            }
        }
    }
    EXPECT_GT(changes[SHADOW_SUNLIT], 0);
    EXPECT_GT(changes[SHADOW_UMBRA], 0);
    EXPECT_LE(missed, runs(400) / 100);
}

TEST(EclipseOnBoard, a_low_orbit_is_dark_for_as_long_as_it_must)
{
    // 500 km, the Sun in the plane: in the shadow of a cylinder for asin(R / r) / pi of a revolution.
    const double r = R + 500e3, v = std::sqrt(mu / r), T = 2 * pi * r / v, cylinder = std::asin(R / r) / pi * T;
    EclipseOnBoard m = behind({AU, 0, 0}, {r, 0, 0});
    m.in.orbit.v_BN_N = {{0, v, 0}};
    m.par.mu = mu;
    double t = 0, lengths[4];
    for (double &length : lengths) {
        length = at(m).change;
        t += length + 1e-3;
        m.in.orbit.r_BN_N = vec3(r * std::cos(v / r * t), r * std::sin(v / r * t), 0);
        m.in.orbit.v_BN_N = vec3(-v * std::sin(v / r * t), v * std::cos(v / r * t), 0);
    }
    EXPECT_NEAR(lengths[0], T / 2 - cylinder / 2, 6.0); // until the penumbra
    EXPECT_NEAR(lengths[1], 2 * Rs / AU / std::sqrt(1 - std::pow(R / r, 2)) * std::sqrt(r * r - R * R) / v, 1.0);
    EXPECT_NEAR(lengths[1] + lengths[2] + lengths[3], cylinder, 12.0);
    EXPECT_NEAR(lengths[1], lengths[3], 0.01);
    EXPECT_NEAR(lengths[2] / 60, 35.4, 0.3);
    // The Sun high above the plane: there is no night; on a hyperbola none is looked for.
    m.in.sun.r_PN_N = vec3(0.1 * AU, 0, AU);
    EXPECT_EQ(at(m).change, 0.0);
    m.in.sun.r_PN_N = vec3(AU, 0, 0);
    m.in.orbit.v_BN_N = vec_scale(1.5, m.in.orbit.v_BN_N);
    EXPECT_EQ(at(m).change, 0.0);
    EXPECT_EQ(m.out.shadow.head.quality, QUALITY_GOOD);
}

TEST(EclipseOnBoard, says_what_it_does_not_know)
{
    const auto update = [](EclipseOnBoard &m) { eclipse_on_board_update(&m, {9, 1}); };
    EclipseOnBoard m = behind({AU, 0, 0}, {-7e6, 6.4e6, 0}, f);
    m.par.mu = mu;
    m.in.orbit.v_BN_N = {{0, 0, 7e3}};
    m.in.body.head = good();
    for (const auto missing : {&m.in.orbit.head, &m.in.sun.head}) {
        missing->quality = QUALITY_NONE;
        update(m);
        EXPECT_TRUE(all_zero(m.out));
        missing->quality = QUALITY_GOOD;
    }
    update(m);
    EXPECT_GT(m.out.shadow.change, 0.0);
    expect_held(m, doubles(m.in.orbit.r_BN_N, m.in.sun.r_PN_N, m.in.body.r_PN_N), update,
                [](EclipseOnBoard &module) { return std::vector{&module.out.shadow.head}; });
    const double lit = m.out.shadow.lit;
    for (double *bad : doubles(m.in.orbit.v_BN_N, m.in.sun.v_PN_N, m.par.mu)) {
        const double was = std::exchange(*bad, std::nan(""));
        update(m);
        EXPECT_EQ(m.out.shadow.lit, lit);
        EXPECT_EQ(m.out.shadow.change, 0.0);
        *bad = was;
    }
    const std::uint32_t written = m.out.shadow.head.sequence;
    m.in.orbit.r_BN_N = {{0.9 * R, 0, 0}}; // in the ground
    update(m);
    m.in.orbit.r_BN_N = {{AU, 1e8, 0}}; // in the Sun
    update(m);
    EXPECT_EQ(m.out.shadow.head.sequence, written);
}

TEST(EclipseOnBoard, no_numbers_break_it)
{
    Random random{4};
    for (int round = 0; round < runs(2000); round++) {
        EclipseOnBoard m = behind({AU, 0, 0}, {-7e6, 6.4e6, 0});
        const Doubles inputs = doubles(m.in.orbit.r_BN_N, m.in.orbit.v_BN_N, m.in.sun.r_PN_N, m.in.sun.v_PN_N,
                                       m.in.body.r_PN_N, m.in.body.v_PN_N, m.par);
        m.in.body.head.quality = any_quality(random);
        throw_numbers(inputs, random, round);
        at(m);
        expect_finite(doubles(m.out.shadow.lit, m.out.shadow.change), round);
        ASSERT_TRUE(m.out.shadow.lit >= 0 && m.out.shadow.lit <= 1 && m.out.shadow.change >= 0);
        ASSERT_TRUE(m.out.shadow.phase <= SHADOW_UMBRA);
    }
}

} // namespace eclipse_on_board_test
} // namespace flight::testing
