// SPDX-License-Identifier: Apache-2.0
// Against motion by universal variables, derivatives, and orbits that are known for their rates.
#include "flight/testing/conics.h"
#include "flight/testing/derivative.h"

extern "C" {
#include "flight/navigation/element_ephemeris.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace element_ephemeris_test {

ElementEphemeris any(Random &random, double e)
{
    ElementEphemeris m{};
    m.par.epoch = 5'000'000'000;
    m.par.mu = mu_mars;
    m.par.e = e;
    m.par.a = random.real(4e6, 3e7) / (1 - e);
    m.par.i = random.real(0, pi);
    m.par.node = random.real(-pi, pi);
    m.par.periapsis = random.real(-pi, pi);
    m.par.M = random.real(-pi, pi);
    return m;
}

/// [s] since the epoch.
BodyState at(ElementEphemeris &m, double t)
{
    element_ephemeris_update(&m, {m.par.epoch + std::llround(t * 1e9), 0});
    EXPECT_EQ(std::memcmp(&m.out.orbit, &m.out.body, sizeof m.out.body), 0);
    return m.out.body;
}

TEST(ElementEphemeris, without_J2_it_is_keplers_motion_for_any_time)
{
    Random random{1};
    for (int i = 0; i < 500; i++) {
        ElementEphemeris m = any(random, i % 5 == 0 ? 0 : random.real(0, 0.99));
        const BodyState begin = at(m, 0);
        const double period = 2 * pi * std::sqrt(std::pow(m.par.a, 3) / m.par.mu);
        const double t = std::floor(random.real(-3, 3) * period);
        const Motion motion = kepler({eigen(begin.r_PN_N), eigen(begin.v_PN_N)}, m.par.mu, t);
        const BodyState then = at(m, t);
        const double scale = 1e-11 / (1 - m.par.e);
        EXPECT_LT((eigen(then.r_PN_N) - motion.r).norm(), scale * m.par.a) << m.par.e;
        EXPECT_LT((eigen(then.a_PN_N) - gravity(eigen(then.r_PN_N), m.par.mu)).norm(), 1e-12 * vec_norm(then.a_PN_N));
        // The elements that the state has.
        const Vector3d r = eigen(begin.r_PN_N), v = eigen(begin.v_PN_N), h = r.cross(v);
        EXPECT_NEAR(1 / (2 / r.norm() - v.squaredNorm() / m.par.mu), m.par.a, 1e-9 * m.par.a);
        EXPECT_NEAR((v.cross(h) / m.par.mu - r.normalized()).norm(), m.par.e, 1e-9);
        EXPECT_NEAR(h.z() / h.norm(), std::cos(m.par.i), 1e-12);
        const Vector3d node = Vector3d(std::cos(m.par.node), std::sin(m.par.node), 0);
        EXPECT_NEAR(node.dot(h) / h.norm(), 0, 1e-12);
    }
}

TEST(ElementEphemeris, velocity_and_acceleration_are_the_derivatives_also_with_J2)
{
    Random random{2};
    for (int i = 0; i < 400; i++) {
        ElementEphemeris m = any(random, i % 4 == 0 ? random.real(1.1, 3) : random.real(0, 0.6));
        if (i % 4 == 1) {
            m = any(random, 1 - std::pow(10.0, random.real(-9, -2)));
            m.par.M = 0;
        }
        m.par.J2 = 0.3; // a hundred times any planet's, so that an error shows
        m.par.radius = 3.4e6;
        const double middle = random.real(0, 1e4);
        const auto r = [&](double t) -> Vector3d { return eigen(at(m, middle + t).r_PN_N); };
        const auto v = [&](double t) -> Vector3d { return eigen(at(m, middle + t).v_PN_N); };
        const BodyState now = at(m, middle);
        EXPECT_LT((derivative<Vector3d>(r, 8) - eigen(now.v_PN_N)).norm(), 1e-6 * vec_norm(now.v_PN_N));
        EXPECT_LT((derivative<Vector3d>(v, 8) - eigen(now.a_PN_N)).norm(), 1e-5 * vec_norm(now.a_PN_N));
    }
}

/// A hyperbola whose periapsis is 4e6 m to 3e7 m from the centre.
ElementEphemeris passing(Random &random, double e)
{
    ElementEphemeris m = any(random, e);
    m.par.M = random.real(-1, 1) * std::pow(10.0, random.real(-6, 3));
    return m;
}

TEST(ElementEphemeris, a_hyperbola_is_keplers_motion_for_any_time_whatever_J2)
{
    Random random{4};
    for (int i = 0; i < 1000; i++) {
        const double e = 1 + std::pow(10.0, random.real(-4, 1.9));
        ElementEphemeris m = passing(random, e);
        m.par.J2 = i % 2 ? 0.1 : 0.0;
        m.par.radius = 3.4e6;
        // The state at the epoch by Kepler's equation in long double, halved to its end.
        long double low = 0, high = 200;
        for (int k = 0; k < 200; k++) {
            const long double middle = (low + high) / 2;
            (e * std::sinh(middle) - middle < std::fabs(m.par.M) ? low : high) = middle;
        }
        const long double H = std::copysign(low, static_cast<long double>(m.par.M));
        const BodyState begin = at(m, 0);
        const auto r = static_cast<double>(-m.par.a * (e * std::cosh(H) - 1));
        const double scale = 1e-12 / (e - 1) + 1e-13;
        EXPECT_NEAR(vec_norm(begin.r_PN_N), r, scale * r) << e << " " << m.par.M;
        // The elements that the state has.
        const Vector3d v = eigen(begin.v_PN_N), h = eigen(begin.r_PN_N).cross(v);
        EXPECT_NEAR(v.squaredNorm() - 2 * m.par.mu / r, -m.par.mu / m.par.a, 1e-10 * v.squaredNorm());
        EXPECT_NEAR((v.cross(h) / m.par.mu - eigen(begin.r_PN_N).normalized()).norm(), e, 1e-9 * e);
        EXPECT_NEAR(h.z() / h.norm(), std::cos(m.par.i), 1e-9);
        EXPECT_NEAR(h.dot(Vector3d(std::cos(m.par.node), std::sin(m.par.node), 0)) / h.norm(), 0, 1e-9);
        EXPECT_EQ(eigen(begin.r_PN_N).dot(v) < 0, m.par.M < 0);
        // Through the periapsis and out again, and back to before, for up to a century.
        const double t = std::floor(random.real(-3, 3) * std::min(std::pow(r, 1.5) / std::sqrt(m.par.mu), 1e9));
        const Motion motion = kepler({eigen(begin.r_PN_N), v}, m.par.mu, t);
        const BodyState then = at(m, t);
        EXPECT_LT((eigen(then.r_PN_N) - motion.r).norm(), 10 * scale * (r + motion.r.norm())) << e << " " << m.par.M;
        EXPECT_LT((eigen(then.v_PN_N) - motion.v).norm(), 10 * scale * (v.norm() + motion.v.norm()));
        EXPECT_LT((eigen(then.a_PN_N) - gravity(eigen(then.r_PN_N), m.par.mu)).norm(), 1e-11 * vec_norm(then.a_PN_N));
    }
}

TEST(ElementEphemeris, a_hyperbola_is_what_numerical_integration_of_gravity_gives)
{
    Random random{5};
    for (int i = 0; i < 20; i++) {
        const double e = random.real(1.05, 4);
        ElementEphemeris m = any(random, e);
        m.par.M = -random.real(1, 5);
        const BodyState begin = at(m, 0);
        Vector3d r = eigen(begin.r_PN_N), v = eigen(begin.v_PN_N);
        // Four stages of Runge and Kutta, to as far after the periapsis.
        const double rate = std::sqrt(m.par.mu / std::pow(-m.par.a, 3)), end = std::floor(-2 * m.par.M / rate);
        const int steps = 40000;
        const double dt = end / steps;
        for (int k = 0; k < steps; k++) {
            const Vector3d a1 = gravity(r, m.par.mu), v2 = v + dt / 2 * a1, a2 = gravity(r + dt / 2 * v, m.par.mu);
            const Vector3d v3 = v + dt / 2 * a2, a3 = gravity(r + dt / 2 * v2, m.par.mu);
            const Vector3d v4 = v + dt * a3, a4 = gravity(r + dt * v3, m.par.mu);
            r += dt / 6 * (v + 2 * v2 + 2 * v3 + v4);
            v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        }
        const BodyState then = at(m, end);
        EXPECT_LT((eigen(then.r_PN_N) - r).norm(), 1e-8 * r.norm()) << e;
        EXPECT_LT((eigen(then.v_PN_N) - v).norm(), 1e-8 * v.norm()) << e;
    }
}

/// e near 1: x / |a| and y / |a| at M by Kepler's equation, halved in long double, from series without differences.
std::array<long double, 2> near_parabola(long double e, long double M)
{
    const long double w = std::fabs(1 - e), sign = e < 1 ? -1 : 1, size = std::fabs(M);
    // sine - x and cosine - 1, hyperbolic if e > 1.
    const auto beyond = [&](long double x) {
        long double s = 0, c = 0, term = x;
        for (int k = 2; k < 60; k++) {
            term *= x / k;
            (k % 2 ? s : c) += k % 4 > 1 ? sign * term : term;
        }
        return std::pair{s, c};
    };
    long double low = 0, high = 4;
    for (int k = 0; k < 300; k++) {
        const long double middle = (low + high) / 2;
        // |x - e sine| = |1 - e| x + e |sine - x|
        (w * middle + e * std::fabs(beyond(middle).first) < size ? low : high) = middle;
    }
    const auto [s, c] = beyond(low);
    return {w - std::fabs(c), std::copysign(std::sqrt(w * (1 + e)) * (low + s), M)};
}

TEST(ElementEphemeris, near_a_parabola_no_digit_is_lost_and_the_seams_do_not_show)
{
    Random random{7};
    const auto check = [](double e, double M) {
        ElementEphemeris m{};
        m.par.mu = 4e14;
        m.par.e = e;
        m.par.a = 7e6 / (1 - e);
        m.par.M = M;
        const BodyState now = at(m, 0);
        const std::array<long double, 2> found = near_parabola(e, M);
        const Vector3d expected =
            std::fabs(m.par.a) * Vector3d(static_cast<double>(found[0]), static_cast<double>(found[1]), 0);
        const double digits = std::fabs(1 - e) < 0.01 ? 2e-15 : 5e-13; // beyond the seam the anomalies serve
        EXPECT_LT((eigen(now.r_PN_N) - expected).norm(), digits * expected.norm()) << e << " " << M;
        EXPECT_LT((eigen(now.a_PN_N) - gravity(eigen(now.r_PN_N), 4e14)).norm(), 5 * digits * vec_norm(now.a_PN_N));
    };
    for (int i = 0; i < 2000; i++) {
        const double w = std::pow(10.0, random.real(-15.5, -2));
        check(i % 2 ? 1 + w : 1 - w, (i % 3 ? 1 : -1) * std::pow(10.0, random.real(-25, 0.4)));
    }
    for (const double e : {0.99, 1.01}) {
        for (int k = -2; k <= 2; k++) {
            for (const double M : {1e-9, 1e-3, 0.1, 0.15, -0.15}) {
                check(e * (1 + k * 1e-15), M * (1 - k * 1e-15));
            }
        }
    }
}

TEST(ElementEphemeris, what_is_no_conic_writes_nothing)
{
    Random random{6};
    for (const auto &[sign, e] : {std::pair{-1.0, 0.5}, {1.0, 1.5}, {1.0, 1.0}, {-1.0, 1.0}}) {
        ElementEphemeris m = any(random, 0.5);
        m.par.a *= sign;
        m.par.e = e;
        EXPECT_EQ(at(m, 0).head.sequence, 0U) << sign << " " << e;
    }
}

TEST(ElementEphemeris, known_orbits_have_their_rates)
{
    ElementEphemeris m{};
    m.par.mu = 3.986004415e14;
    m.par.J2 = 1.0826353865e-3;
    m.par.radius = 6378136.3;
    m.par.a = 7178136.3; // 800 km
    m.par.e = 0;
    m.par.i = 98.603 * pi / 180;
    const auto normal = [&](double t) -> Vector3d {
        const BodyState body = at(m, t);
        return (eigen(body.r_PN_N).cross(eigen(body.v_PN_N))).normalized();
    };
    // Sun-synchronous: the node goes round in a year. The velocity contains the turn of the plane, so the normal is
    // not quite that of the plane; a whole number of days apart this matters little.
    const Vector3d begin = normal(0), end = normal(30 * 86400.0);
    const double turned =
        std::atan2(begin.x() * end.y() - begin.y() * end.x(), begin.x() * end.x() + begin.y() * end.y());
    EXPECT_NEAR(turned, 30 * 2 * pi / 365.2422, 0.002);

    // At the critical inclination the periapsis stays: after any time the lowest point is where it was.
    m.par.i = std::acos(std::sqrt(0.2));
    m.par.a = 26.56e6;
    m.par.e = 0.74;
    m.par.periapsis = 1.5 * pi;
    const double n = std::sqrt(m.par.mu / std::pow(m.par.a, 3)), p = m.par.a * (1 - 0.74 * 0.74);
    const double k = 0.75 * m.par.J2 * std::pow(m.par.radius / p, 2) * n;
    const double dM = n + k * std::sqrt(1 - 0.74 * 0.74) * (3 * 0.2 - 1);
    for (int turns = 0; turns < 200; turns += 40) {
        const BodyState low = at(m, turns * 2 * pi / dM);
        EXPECT_NEAR(vec_norm(low.r_PN_N), m.par.a * 0.26, 1e-2);
        EXPECT_NEAR(low.r_PN_N.v[2], -m.par.a * 0.26 * std::sin(m.par.i), 1.0);
    }
}

TEST(ElementEphemeris, follows_the_ephemerides_time_where_it_is_wired)
{
    Random random{3};
    ElementEphemeris m = any(random, 0.1);
    const BodyState then = at(m, 100);
    m.in.time = {with(QUALITY_STALE), m.par.epoch + 100'000'000'000};
    EXPECT_EQ(at(m, 0).r_PN_N.v[0], then.r_PN_N.v[0]);
    EXPECT_EQ(m.out.body.head.quality, QUALITY_DEGRADED);
}

} // namespace element_ephemeris_test
} // namespace flight::testing
