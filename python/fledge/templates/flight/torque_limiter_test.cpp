// SPDX-License-Identifier: Apache-2.0
// The properties of the limiter hold for all numbers, so the tests draw random ones.
#include "flight/testing/poison.h"

extern "C" {
#include "flight/torque_limiter.h"
}

#include <gtest/gtest.h>

namespace {

using namespace flight::testing;

constexpr std::int64_t step = 500'000'000; // ns

TorqueLimiter any(Random &random)
{
    TorqueLimiter m{};
    m.par.rate = random.real(0.01, 1.0);
    torque_limiter_reset(&m);
    torque_limiter_update(&m, {0, 0});
    m.in.wanted = {good(), vec(random.vector())};
    return m;
}

TEST(TorqueLimiter, never_changes_faster_than_it_may)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        TorqueLimiter m = any(random);
        for (int k = 1; k <= 20; k++) {
            m.in.wanted.torque_B = vec(random.vector());
            const Vec3 last = m.out.torque.torque_B;
            torque_limiter_update(&m, {k * step, step});
            const double change = vec_norm(vec_sub(m.out.torque.torque_B, last));
            EXPECT_LE(change, m.par.rate * 0.5 * (1 + 1e-14));
        }
    }
}

TEST(TorqueLimiter, arrives_when_the_rate_allows_it_and_stays)
{
    Random random{2};
    for (int i = 0; i < 1000; i++) {
        TorqueLimiter m = any(random);
        const Vec3 wanted = m.in.wanted.torque_B;
        const int steps = static_cast<int>(std::ceil(vec_norm(wanted) / (m.par.rate * 0.5)));
        for (int k = 1; k <= steps + 3; k++) {
            torque_limiter_update(&m, {k * step, step});
            const double left = vec_norm(vec_sub(wanted, m.out.torque.torque_B));
            EXPECT_NEAR(left, std::max(0.0, vec_norm(wanted) - k * m.par.rate * 0.5), 1e-12);
        }
        EXPECT_TRUE(same_content(m.out.torque, m.in.wanted));
    }
}

TEST(TorqueLimiter, holds_its_torque_without_data)
{
    Random random{3};
    TorqueLimiter m = any(random);
    torque_limiter_update(&m, {step, step});
    expect_held(
        m, doubles(m.in.wanted.torque_B),
        [](TorqueLimiter &x) {
            torque_limiter_update(&x, {2 * step, step});
        },
        [](TorqueLimiter &x) { return std::vector{&x.out.torque.head}; });

    TorqueLimiter never{};
    torque_limiter_update(&never, {step, step});
    EXPECT_TRUE(all_zero(never.out));
}

} // namespace
