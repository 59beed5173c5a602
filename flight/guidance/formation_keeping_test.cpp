// SPDX-License-Identifier: Apache-2.0
// Formation keeping about chiefs on any conic, against numerical derivatives of Keplerian motion.
#include "flight/testing/conics.h"
#include "flight/testing/derivative.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/formation_keeping.h"
#include "flight/math/attitude.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace formation_keeping_test {

constexpr double mu = mu_mars;
constexpr std::int64_t second = 1'000'000'000;

FormationKeeping any(Random &random)
{
    FormationKeeping m{};
    m.par.mu = mu;
    m.par.mass = 50;
    m.par.a = random.real(-500, 500);
    m.par.b = random.real(-500, 500);
    m.par.lead = random.real(-2000, 2000);
    m.par.start = random.real(-pi, pi);
    m.par.phase = random.real(-pi, pi);
    m.par.K = 1e-6;
    m.par.P = 2e-3;
    return m;
}

/// The wanted position in N, by its definition.
Vector3d wanted(const FormationKeeping &m, const Motion &chief, double n, double t)
{
    const double u = n * t + m.par.start;
    const Vector3d rho(m.par.a * std::cos(u), m.par.lead - 2 * m.par.a * std::sin(u),
                       m.par.b * std::cos(u + m.par.phase));
    const Motion C = kepler(chief, mu, t);
    Matrix3d HN;
    HN.row(0) = C.r.normalized();
    HN.row(2) = C.r.cross(C.v).normalized();
    HN.row(1) = HN.row(2).cross(HN.row(0));
    return C.r + HN.transpose() * rho;
}

void update(FormationKeeping &m, const Motion &chief, const Motion &deputy, double t)
{
    const Motion C = kepler(chief, mu, t);
    m.in.chief = {good(std::llround(t * 1e9)), vec(C.r), vec(C.v), {}};
    m.in.orbit = {good(std::llround(t * 1e9)), vec(deputy.r), vec(deputy.v), {}};
    m.in.attitude.head = good();
    formation_keeping_update(&m, {std::llround(t * 1e9), second});
}

TEST(FormationKeeping, the_error_obeys_its_linear_equation_about_any_conic)
{
    Random random{1};
    for (int i = 0; i < 100; i++) {
        FormationKeeping m = any(random);
        const Motion chief = about_mars(random, i % 2 ? 0.0 : random.real(0, 1.5), 3);
        const double n = std::sqrt(mu / std::pow(chief.r.norm(), 3)), h = 0.02 / n,
                     t = std::round(random.real(0, 2 / n));
        m.in.attitude.sigma_BN = random.mrp();
        update(m, chief, chief, 0); // where the time begins
        const auto star = [&](double dt) -> Vector3d { return wanted(m, chief, n, t + dt); };
        const auto dstar = [&](double at) -> Vector3d {
            return derivative<Vector3d>([&](double dt) -> Vector3d { return star(at + dt); }, h);
        };
        const Vector3d e = random.vector(100), de = random.vector(0.5);
        const Motion deputy{star(0) + e, dstar(0) + de};
        update(m, chief, deputy, t);
        const Vector3d force = dcm(m.in.attitude.sigma_BN).transpose() * eigen(m.out.force.force_B);
        const Vector3d g = -mu / std::pow(deputy.r.norm(), 3) * deputy.r;
        const Vector3d dde = force / 50 + g - derivative<Vector3d>(dstar, h);
        EXPECT_LT((dde + 1e-6 * e + 2e-3 * de).norm(), 1e-8) << i;
        EXPECT_NEAR(eigen(m.out.relative.rho_error_H).norm(), e.norm(), 1e-6);
        EXPECT_EQ(m.out.force.head.quality, QUALITY_GOOD);
    }
}

TEST(FormationKeeping, about_a_circle_the_wanted_motion_is_nearly_free)
{
    FormationKeeping m{};
    m.par = {mu, 50, 100, 50, 300, 0.3, 1, 1e-6, 2e-3, 0, 0, 0};
    const double r = 7e6, n = std::sqrt(mu / std::pow(r, 3));
    const Motion chief{{r, 0, 0}, {0, std::sqrt(mu / r), 0}};
    for (const double t : {0.0, 1000.0, 5000.0}) {
        const auto star = [&](double dt) -> Vector3d { return wanted(m, chief, n, t + dt); };
        update(m, chief, {star(0), derivative<Vector3d>(star, 20)}, t);
        // The linear equations leave out 3 n^2 rho^2 / (2 r) and the like.
        EXPECT_LT(vec_norm(m.out.force.force_B), 50 * 6 * n * n * 500 * 500 / r);
        EXPECT_GT(vec_norm(m.out.force.force_B), 0);
    }
}

TEST(FormationKeeping, rests_near_the_wanted_motion_and_keeps_to_its_limit)
{
    Random random{2};
    const Motion chief = about_mars(random, 0.1);
    FormationKeeping m = any(random);
    m.par.force_max = 0.01;
    update(m, chief, {chief.r + Vector3d(5e4, 0, 0), chief.v}, 0);
    EXPECT_NEAR(vec_norm(m.out.force.force_B), 0.01, 1e-12);
    m.par.quiet = 1e6;
    update(m, chief, {chief.r + Vector3d(5e4, 0, 0), chief.v}, 1);
    EXPECT_EQ(vec_norm(m.out.force.force_B), 0.0);
}

TEST(FormationKeeping, carries_a_chief_and_an_orbit_of_before_to_now)
{
    Random random{4};
    const Motion chief = about_mars(random, 0.01, 1), deputy{chief.r + Vector3d(300, 0, 0), chief.v};
    for (const double age : {1.0, 5.0}) {
        FormationKeeping m = any(random), late = m;
        update(m, chief, chief, 0);
        late = m;
        const Motion D = kepler(deputy, mu, 100);
        update(m, chief, D, 100);
        update(late, chief, D, 100);
        const Motion C = kepler(chief, mu, 100 - age), before = kepler(deputy, mu, 100 - age);
        late.in.chief = {{std::llround((100 - age) * 1e9), QUALITY_DEGRADED, 9}, vec(C.r), vec(C.v), {}};
        formation_keeping_update(&late, {100 * second, second});
        const Vector3d force = eigen(m.out.force.force_B);
        EXPECT_LT((eigen(late.out.force.force_B) - force).norm(), 0.02 * force.norm());
        late.in.orbit = {{std::llround((100 - age) * 1e9), QUALITY_DEGRADED, 9}, vec(before.r), vec(before.v), {}};
        formation_keeping_update(&late, {100 * second, second});
        EXPECT_LT((eigen(late.out.force.force_B) - force).norm(), 0.02 * force.norm());
    }
}

TEST(FormationKeeping, the_force_ends_without_new_data)
{
    Random random{3};
    const Motion chief = about_mars(random, 0.1);
    for (int which = 0; which < 3; which++) {
        for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
            FormationKeeping m = any(random);
            m.par.hold = 3;
            update(m, chief, {chief.r + Vector3d(1e3, 0, 0), chief.v}, 0);
            Head *heads[] = {&m.in.orbit.head, &m.in.attitude.head, &m.in.chief.head};
            heads[which]->quality = lost;
            if (lost == QUALITY_GOOD) {
                Vec3 *numbers[] = {&m.in.orbit.r_BN_N, &m.in.attitude.sigma_BN, &m.in.chief.v_PN_N};
                numbers[which]->v[1] = NAN;
            }
            for (int k = 1; k < 8; k++) {
                formation_keeping_update(&m, {k * second, second});
                EXPECT_EQ(vec_norm(m.out.force.force_B) > 0, k <= 3);
                EXPECT_EQ(m.out.force.head.quality, QUALITY_DEGRADED);
            }
        }
    }
}

} // namespace formation_keeping_test
} // namespace flight::testing
