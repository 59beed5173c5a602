// SPDX-License-Identifier: Apache-2.0
// The energy falls, the momentum moves into the wheels, and neither depends on what the module does not know.
#include "flight/testing/magnetic_orbit.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/rate_damping.h"
}

namespace flight::testing {
namespace rate_damping_test {

constexpr std::int64_t second = 1'000'000'000;

RateDamping any(Random &random, double torque_max = 0)
{
    RateDamping m{};
    m.in.gyro = {good(), vec(random.vector(0.1))};
    m.par.P = mat(random.spd(1e-2));
    m.par.torque_max = torque_max;
    return m;
}

TEST(RateDamping, the_body_comes_to_rest_and_wheels_have_its_momentum)
{
    Random random{1};
    for (int i = 0; i < runs(50); i++) {
        RateDamping m = any(random, i % 2 ? 2e-3 : 0);
        Craft craft;
        craft.I = random.spd(0.05);
        craft.measure(random.attitude());
        craft.omega = random.vector(0.1);
        craft.h = random.vector(0.02);
        const Vector3d H_N = craft.dcm_BN().transpose() * (craft.I * craft.omega + craft.h);
        for (int k = 0; k < 6000; k++) {
            m.in.gyro = {good(k * second / 10), vec(craft.omega)};
            rate_damping_update(&m, {k * second / 10, k ? second / 10 : 0});
            const double before = craft.energy();
            Actions act;
            act.wheels_B = eigen(m.out.torque.torque_B);
            EXPECT_LE(act.wheels_B.dot(craft.omega), 0);
            craft.step({}, 0, 0.1, act);
            EXPECT_LE(craft.energy(), before + 1e-12);
        }
        EXPECT_LT(craft.omega.norm(), 1e-5);
        EXPECT_LT((craft.dcm_BN().transpose() * (craft.I * craft.omega + craft.h) - H_N).norm(), 1e-6);
    }
}

TEST(RateDamping, the_limit_keeps_the_direction)
{
    Random random{2};
    for (int i = 0; i < 300; i++) {
        RateDamping free = any(random), m = free;
        m.par.torque_max = 1e-3;
        rate_damping_update(&free, {0, 0});
        rate_damping_update(&m, {0, 0});
        const Vector3d wanted = eigen(free.out.torque.torque_B), given = eigen(m.out.torque.torque_B);
        EXPECT_NEAR(given.norm(), std::min(1e-3, wanted.norm()), 1e-15);
        EXPECT_GT(given.dot(wanted), (1 - 1e-12) * given.norm() * wanted.norm());
    }
}

TEST(RateDamping, ends_without_usable_rates)
{
    Random random{3};
    expect_torque_ends(any(random), rate_damping_update,
                       [](RateDamping &m) { return std::pair(&m.in.gyro.head, &m.in.gyro.omega_BN_B.v[1]); });
}

TEST(RateDamping, holds_the_last_torque_against_numbers_that_are_not_finite)
{
    Random random{4};
    RateDamping m = any(random, 1e-3);
    rate_damping_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.gyro.omega_BN_B, m.par.P),
        [](RateDamping &module) {
            rate_damping_update(&module, {5, 5});
        },
        [](RateDamping &module) { return std::vector<Head *>{&module.out.torque.head}; });
}

} // namespace rate_damping_test
} // namespace flight::testing
