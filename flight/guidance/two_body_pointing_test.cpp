// SPDX-License-Identifier: Apache-2.0
// Two-body pointing by its own conditions on angles, and its motion against numerical derivatives
// for a spacecraft that orbits a planet that orbits the Sun.
#include "flight/testing/conics.h"
#include "flight/testing/kinematics.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/two_body_pointing.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace two_body_pointing_test {

constexpr double mu_sun = 1.32712440018e20; // m^3/s^2

/// Where a point is, how fast, and what accelerates it.
struct Point {
    Vector3d r = Vector3d::Zero(), v = Vector3d::Zero(), a = Vector3d::Zero();
};

Point operator+(const Point &a, const Point &b)
{
    return {a.r + b.r, a.v + b.v, a.a + b.a};
}

Point on_orbit(const Motion &start, double mu, double t)
{
    Motion now = kepler(start, mu, t);
    return {now.r, now.v, gravity(now.r, mu)};
}

struct Scene {
    Point craft, primary, secondary;
};

TwoBodyPointing pointing(const Scene &scene, double separation_min = 1e-3)
{
    TwoBodyPointing m{};
    auto &[craft, primary, secondary] = scene;
    m.in.orbit = {good(), vec(craft.r), vec(craft.v), vec(craft.a)};
    m.in.primary = {good(), vec(primary.r), vec(primary.v), vec(primary.a)};
    m.in.secondary = {good(), vec(secondary.r), vec(secondary.v), vec(secondary.a)};
    m.par.separation_min = separation_min;
    return m;
}

void move(TwoBodyPointing &m, const Scene &scene)
{
    auto in = pointing(scene).in;
    m.in = in;
}

AttReference reference_of(const Scene &scene)
{
    TwoBodyPointing m = pointing(scene);
    two_body_pointing_update(&m, {0, 0});
    return m.out.reference;
}

Point any_point(Random &random)
{
    return {random.vector(1e11), random.vector(1e4), random.vector(1)};
}

Scene any_scene(Random &random)
{
    return {any_point(random), any_point(random), any_point(random)};
}

Vector3d direction(const Point &from, const Point &to)
{
    return (to.r - from.r).normalized();
}

/// The angle of two unit vectors, to rounding also where it is small.
double angle(const Vector3d &a, const Vector3d &b)
{
    return 2 * std::atan2((a - b).norm(), (a + b).norm());
}

/// Three bodies on conics: a spacecraft about Mars, Mars and the Earth about the Sun.
struct Solar {
    Motion craft, mars, earth;

    static Solar any(Random &random, double e)
    {
        return {about_mars(random, e), on_conic(random, mu_sun, 2.07e11, 0.09, 2),
                on_conic(random, mu_sun, 1.47e11, 0.017, 2)};
    }

    Point at_mars(double t) const { return on_orbit(mars, mu_sun, t); }
    Point at_earth(double t) const { return on_orbit(earth, mu_sun, t); }
    Point at_craft(double t) const { return at_mars(t) + on_orbit(craft, mu_mars, t); }

    Scene mars_and_sun(double t) const { return {at_craft(t), at_mars(t), {}}; }
    Scene earth_and_sun(double t) const { return {at_craft(t), at_earth(t), {}}; }
    Scene earth_and_mars(double t) const { return {at_craft(t), at_earth(t), at_mars(t)}; }
    double rate() const { return craft.v.norm() / craft.r.norm() + 1e-7; }
};

/// Errors are relative to the rates that there are, and to what they change by in an orbit.
template <class F> void check(F scene_at, double rate)
{
    auto at = [&](double t) { return reference_of(scene_at(t)); };
    TwoBodyPointing m = pointing(scene_at(0));
    two_body_pointing_update(&m, {0, 0});
    ASSERT_EQ(m.out.reference.head.quality, QUALITY_GOOD);
    double size = vec_norm(m.out.reference.omega_RN_N) / std::sin(m.out.status.separation);
    KinematicErrors errors = kinematic_errors(at, rate / std::sin(m.out.status.separation));
    double scale = rate / std::sin(m.out.status.separation);
    EXPECT_LT(errors.rate * scale, 1e-6 * size);
    EXPECT_LT(errors.acceleration * scale, 1e-6 * size);
}

TEST(TwoBodyPointing, primary_exactly_and_secondary_in_the_half_plane)
{
    Random random{1};
    for (int i = 0; i < 3000; i++) {
        Scene scene = any_scene(random);
        TwoBodyPointing m = pointing(scene);
        two_body_pointing_update(&m, {500, 0});
        ASSERT_EQ(m.out.status.secondary, SECONDARY_TRACKED);
        Matrix3d c = dcm(m.out.reference.sigma_RN);
        Vector3d first = c * direction(scene.craft, scene.primary); // in R
        Vector3d second = c * direction(scene.craft, scene.secondary);
        EXPECT_LT(angle(first, Vector3d::UnitX()), 4e-15);
        EXPECT_LT(std::abs(second.z()), 2e-15 / second.y()) << "out of the plane of r1 and r2";
        EXPECT_GT(second.y(), 0) << "on the side of r2";
        EXPECT_LE(vec_norm(m.out.reference.sigma_RN), 1 + 1e-15);

        double separation = angle(first, second), miss = angle(second, Vector3d::UnitY());
        EXPECT_NEAR(m.out.status.separation, separation, 1e-14);
        EXPECT_NEAR(miss, std::abs(pi / 2 - separation), 1e-14);
    }
}

TEST(TwoBodyPointing, no_turn_about_the_primary_brings_r2_nearer_to_the_secondary)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        Scene scene = any_scene(random);
        Matrix3d c = dcm(reference_of(scene).sigma_RN);
        Vector3d second = direction(scene.craft, scene.secondary);
        double least = angle(c.row(1), second);
        for (double turned : {-pi / 2, -0.3, -1e-3, 1e-3, 0.3, pi / 2, pi}) {
            EXPECT_GT(angle((turn(0, turned) * c).row(1), second), least);
        }
    }
}

TEST(TwoBodyPointing, rate_and_acceleration_are_derivatives_about_a_planet_on_every_conic)
{
    Random random{3};
    for (int i = 0; i < 400; i++) {
        double e = i % 4 == 0 ? 1 + random.real(-1e-6, 1e-6) : random.real(0, 3);
        Solar solar = Solar::any(random, e);
        check([&](double t) { return solar.mars_and_sun(t); }, solar.rate());
    }
}

TEST(TwoBodyPointing, rate_and_acceleration_are_derivatives_for_far_bodies)
{
    Random random{4};
    for (int i = 0; i < 200; i++) {
        Solar solar = Solar::any(random, random.real(0, 2));
        check([&](double t) { return solar.earth_and_sun(t); }, solar.rate());
        check([&](double t) { return solar.earth_and_mars(t); }, solar.rate());
    }
}

TEST(TwoBodyPointing, accelerations_enter_the_acceleration_alone_and_their_lack_does_what_it_says)
{
    Random random{5};
    for (int i = 0; i < 1000; i++) {
        Scene scene = any_scene(random), unknown = scene;
        unknown.craft.a = unknown.primary.a = unknown.secondary.a = Vector3d::Zero();
        AttReference full = reference_of(scene), lacking = reference_of(unknown);
        EXPECT_EQ(eigen(full.sigma_RN), eigen(lacking.sigma_RN));
        EXPECT_EQ(eigen(full.omega_RN_N), eigen(lacking.omega_RN_N));

        auto &[craft, primary, secondary] = scene;
        double of_primary = (primary.a - craft.a).norm() / (primary.r - craft.r).norm();
        double of_secondary = (secondary.a - craft.a).norm() / (secondary.r - craft.r).norm();
        double sine = direction(craft, primary).cross(direction(craft, secondary)).norm();
        EXPECT_LT((eigen(full.domega_RN_N) - eigen(lacking.domega_RN_N)).norm(),
                  of_primary + (of_primary + of_secondary) / sine);
    }
}

TEST(TwoBodyPointing, bodies_that_are_collinear_are_reported_and_the_primary_is_kept)
{
    Random random{6};
    for (int i = 0; i < 1000; i++) {
        Scene scene = any_scene(random);
        Vector3d to_primary = scene.primary.r - scene.craft.r;
        Vector3d across = to_primary.cross(random.direction()).normalized();
        double threshold = random.real(0.01, 0.5), offset = random.real(-1, 1);
        double way = i % 2 ? 1 : -1;
        Vector3d along = way * to_primary.normalized();
        Vector3d toward = std::cos(offset) * along + std::sin(offset) * across;
        scene.secondary.r = scene.craft.r + random.real(1e8, 1e12) * toward;
        TwoBodyPointing m = pointing(scene, threshold);
        two_body_pointing_update(&m, {0, 0});
        bool collinear = std::abs(offset) < threshold;
        EXPECT_EQ(m.out.status.secondary, collinear ? SECONDARY_COLLINEAR : SECONDARY_TRACKED);
        EXPECT_EQ(m.out.reference.head.quality, collinear ? QUALITY_DEGRADED : QUALITY_GOOD);
        EXPECT_EQ(m.out.status.head.quality, m.out.reference.head.quality);
        EXPECT_NEAR(m.out.status.separation, angle(along * way, toward), 1e-12);
        Matrix3d c = dcm(m.out.reference.sigma_RN);
        EXPECT_LT(angle(c.row(0), to_primary.normalized()), 4e-15);
        if (collinear) {
            EXPECT_NEAR(eigen(m.out.reference.omega_RN_N).dot(to_primary.normalized()), 0, 1e-20);
        }
    }
}

TEST(TwoBodyPointing, bodies_on_one_line_exactly)
{
    for (double along : {2.0, 1.0, 0.5, 0.0, -1.0}) { // 0: the secondary is at the spacecraft
        for (double threshold : {0.0, 1e-6, 0.1}) {
            Scene scene;
            scene.craft.r = {1e7, 2e7, -3e7};
            Vector3d to_primary{4e9, -8e9, 1.6e10};
            scene.primary.r = scene.craft.r + to_primary;
            scene.primary.v = {1e3, 2e3, 3e3};
            scene.secondary.r = scene.craft.r + along * to_primary;
            TwoBodyPointing m = pointing(scene, threshold);
            two_body_pointing_update(&m, {0, 0});
            EXPECT_EQ(m.out.status.secondary, SECONDARY_COLLINEAR);
            EXPECT_EQ(m.out.status.separation, along < 0 ? fm_atan2(0, -1) : 0);
            Matrix3d c = dcm(m.out.reference.sigma_RN);
            EXPECT_LT(angle(c.row(0), to_primary.normalized()), 1e-15);
            EXPECT_LT(difference(c * c.transpose(), Matrix3d::Identity()), 1e-15);
            EXPECT_GT(c(1, 0), 0.9) << "r2 is near the axis of N farthest from r1";
        }
    }
}

TEST(TwoBodyPointing, alone_from_the_start_the_primary_has_r2_nearest_to_the_axis_farthest_from_it)
{
    Random random{8};
    for (int i = 0; i < 300; i++) {
        Scene scene = any_scene(random);
        TwoBodyPointing m = pointing(scene);
        m.in.secondary.head = Head{};
        two_body_pointing_update(&m, {0, 0});
        Vector3d r1 = direction(scene.craft, scene.primary);
        int farthest;
        r1.cwiseAbs().minCoeff(&farthest);
        Vector3d axis = Vector3d::Unit(farthest);
        EXPECT_LT(angle(dcm(m.out.reference.sigma_RN).row(1), (axis - axis.dot(r1) * r1).normalized()), 4e-15);
    }
}

TEST(TwoBodyPointing, through_a_conjunction_it_stays_with_the_primary_and_goes_on_smoothly)
{
    // The secondary passes exactly behind the primary, while the spacecraft orbits.
    double h = 1, threshold = 0.02;
    auto at = [](double t) {
        Scene scene;
        double s = std::sin(1e-3 * t), c = std::cos(1e-3 * t);
        scene.craft = {Vector3d(0, 0, 7e6 * s), Vector3d(0, 0, 7e3 * c), Vector3d(0, 0, -7 * s)};
        scene.primary = {Vector3d(1e9, 2e4 * t, 0), Vector3d(0, 2e4, 0)};
        scene.secondary = {Vector3d(3e9, 3e9 * 1e-4 * t, 0), Vector3d(0, 3e5, 0)};
        return scene;
    };
    TwoBodyPointing m = pointing(at(-2000), threshold);
    int collinear = 0, entered = 0, left = 0;
    SecondaryUse before = SECONDARY_TRACKED;
    Matrix3d last = Matrix3d::Zero();
    for (double t = -2000; t <= 2000; t += h) {
        Scene scene = at(t);
        move(m, scene);
        m.par.separation_min = threshold;
        two_body_pointing_update(&m, {std::llround((t + 2000) * 1e9), 1'000'000'000});
        const AttReference &reference = m.out.reference;
        Matrix3d c = dcm(reference.sigma_RN);
        ASSERT_LT(angle(c.row(0), direction(scene.craft, scene.primary)), 1e-15) << t;
        ASSERT_LT(vec_norm(reference.omega_RN_N), 1e-4 / threshold) << t;
        SecondaryUse use = m.out.status.secondary;
        collinear += use == SECONDARY_COLLINEAR;
        if (use == SECONDARY_COLLINEAR) {
            entered += before == SECONDARY_TRACKED;
            Matrix3d step = c * last.transpose();
            EXPECT_LT(difference(step, Matrix3d::Identity()), 2e-4) << "no jump into or within it";
            EXPECT_LT(std::abs(step(1, 2)), 1e-9) << "no turn about r1";
            EXPECT_EQ(reference.head.quality, QUALITY_DEGRADED);
        } else {
            left += before == SECONDARY_COLLINEAR;
            EXPECT_EQ(reference.head.quality, QUALITY_GOOD);
        }
        before = use;
        last = c;
    }
    EXPECT_GT(collinear, 100);
    EXPECT_EQ(entered, 1);
    EXPECT_EQ(left, 1);
}

TEST(TwoBodyPointing, without_a_secondary_rates_are_those_of_the_primary_s_direction)
{
    Random random{7};
    for (int i = 0; i < 300; i++) {
        Solar solar = Solar::any(random, random.real(0, 2));
        double rate = solar.rate();
        TwoBodyPointing m = pointing(solar.mars_and_sun(0));
        two_body_pointing_update(&m, {0, 0});
        Matrix3d last = dcm(m.out.reference.sigma_RN);
        auto at = [&](double t) { // from what it remembers now
            TwoBodyPointing there = m;
            move(there, solar.mars_and_sun(t));
            there.in.secondary.head = Head{};
            two_body_pointing_update(&there, {500, 500});
            EXPECT_EQ(there.out.status.secondary, SECONDARY_ABSENT);
            EXPECT_EQ(there.out.status.separation, 0);
            EXPECT_EQ(there.out.reference.head.quality, QUALITY_DEGRADED);
            return there.out.reference;
        };
        EXPECT_LT(difference(dcm(at(0).sigma_RN), last), 1e-14) << "it goes on from where it was";
        KinematicErrors errors = kinematic_errors(at, rate);
        EXPECT_LT(errors.rate, 1e-7);
        EXPECT_LT(errors.acceleration, 1e-7);
    }
}

TEST(TwoBodyPointing, without_a_secondary_the_rate_is_the_derivative_of_the_attitude_from_update_to_update)
{
    Random random{14};
    for (int i = 0; i < 60; i++) {
        Solar solar = Solar::any(random, random.real(0, 2));
        for (double turned : {1e-2, 3e-3, 1e-3}) { // between updates [rad]
            double dt = turned / solar.rate();
            constexpr int middle = 40, samples = 2 * middle + 1;
            TwoBodyPointing m = pointing(solar.mars_and_sun(0));
            two_body_pointing_update(&m, {0, 0}); // so r2 begins somewhere
            std::vector<Matrix3d> at;
            Vector3d omega;
            for (int k = 0; k < samples; k++) {
                move(m, solar.mars_and_sun(k * dt));
                m.in.secondary.head = Head{};
                for (int again = 0; again < 1 + k % 3; again++) { // as where the inputs come less often
                    two_body_pointing_update(&m, {k, 1});
                }
                at.push_back(dcm(m.out.reference.sigma_RN));
                if (k == middle) {
                    omega = eigen(m.out.reference.omega_RN_N);
                }
            }
            auto dcm_at = [&](double t) -> Matrix3d {
                return at[static_cast<std::size_t>(middle + std::lround(t / dt))];
            };
            double error = (numerical_rate(dcm_at, 16 * dt) - omega).norm() / solar.rate();
            EXPECT_LT(error, std::pow(turned, 4) + 1e-8) << turned;
        }
    }
}

TEST(TwoBodyPointing, quality_is_the_worst_of_what_it_used)
{
    Random random{8};
    TwoBodyPointing m = pointing(any_scene(random));
    two_body_pointing_update(&m, {500, 0});
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_GOOD);
    EXPECT_EQ(m.out.reference.head.t, 500);
    EXPECT_EQ(m.out.status.head.sequence, 1u);
    for (Head *head : {&m.in.orbit.head, &m.in.primary.head, &m.in.secondary.head}) {
        *head = with(QUALITY_STALE);
        two_body_pointing_update(&m, {1000, 500});
        EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.status.head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.status.secondary, SECONDARY_TRACKED) << "old data are better than none";
        *head = good();
    }
}

TEST(TwoBodyPointing, without_an_orbit_or_a_primary_nothing_is_written)
{
    Random random{9};
    for (int lacking = 0; lacking < 2; lacking++) {
        TwoBodyPointing m = pointing(any_scene(random));
        (lacking ? m.in.orbit.head : m.in.primary.head) = Head{};
        two_body_pointing_update(&m, {500, 0});
        EXPECT_TRUE(all_zero(m.out));
        EXPECT_TRUE(all_zero(m.mem));
    }
}

TEST(TwoBodyPointing, holds_the_last_reference_at_the_primary_s_centre)
{
    Random random{10};
    Scene scene = any_scene(random);
    TwoBodyPointing m = pointing(scene);
    two_body_pointing_update(&m, {0, 0});
    TwoBodyPointing last = m;
    scene.craft = scene.primary;
    move(m, scene);
    two_body_pointing_update(&m, {500, 500});
    EXPECT_TRUE(same_content(m.out.reference, last.out.reference));
    EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(m.out.reference.head.t, 0);
    EXPECT_EQ(std::memcmp(&m.mem, &last.mem, sizeof m.mem), 0);
}

TEST(TwoBodyPointing, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    Random random{11};
    TwoBodyPointing m = pointing(any_scene(random));
    two_body_pointing_update(&m, {0, 0});
    auto &[orbit, primary, secondary] = m.in;
    expect_held(
        m,
        doubles(orbit.r_BN_N, orbit.v_BN_N, orbit.a_BN_N, primary.r_PN_N, primary.v_PN_N, primary.a_PN_N,
                secondary.r_PN_N, secondary.v_PN_N, secondary.a_PN_N, m.par),
        [](TwoBodyPointing &x) {
            two_body_pointing_update(&x, {500, 500});
        },
        [](TwoBodyPointing &x) {
            return std::vector{&x.out.reference.head, &x.out.status.head};
        });
}

} // namespace two_body_pointing_test
} // namespace flight::testing
