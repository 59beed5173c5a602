// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/protection/rate_limit.h"
}

#include <gtest/gtest.h>

#include <string>

namespace flight::testing {
namespace rate_limit_test {

/// What becomes of a row of rates, as parts of the limit: x is within, X beyond, ? not finite, - missing, s stale and
/// h held, as large as the one before; the result has a bang where
/// the protection is tripped.
std::string row(const std::string &rates, std::uint32_t persistence, std::uint32_t release, RateLimit *last = nullptr)
{
    RateLimit m{};
    m.par = {0.1, persistence, release};
    std::string out;
    std::int64_t t = 0;
    for (const char rate : rates) {
        const GyroRate before = m.in.rate;
        m.in.rate = {good(t), vec3(0, rate == 'X' ? 0.11 : 0.09, 0)};
        if (rate == 's' || rate == 'h') {
            m.in.rate = before;
            m.in.rate.head.quality = rate == 's' ? QUALITY_STALE : QUALITY_DEGRADED;
        } else if (rate == '?') {
            m.in.rate.omega_BN_B.v[2] = NAN;
        } else if (rate == '-') {
            m.in.rate.head = {};
        }
        rate_limit_update(&m, {t++, 1});
        EXPECT_EQ(m.out.state.head.quality, rate != 'x' && rate != 'X' ? QUALITY_DEGRADED : QUALITY_GOOD);
        out += m.out.state.tripped ? '!' : '.';
    }
    if (last) {
        *last = m;
    }
    return out;
}

TEST(RateLimit, trips_after_updates_in_a_row)
{
    EXPECT_EQ(row("XXxXXxXXXxxx", 3, 0), "........!!!!");
    EXPECT_EQ(row("xX", 1, 0), ".!");
    EXPECT_EQ(row("xxxxx", 1, 0), ".....");
}

TEST(RateLimit, is_released_after_updates_in_a_row)
{
    RateLimit m;
    EXPECT_EQ(row("XXxxXxxxXX", 2, 3, &m), ".!!!!!!..!");
    EXPECT_EQ(m.out.state.trips, 2u);
    EXPECT_EQ(m.out.state.count, 2u);
    EXPECT_NEAR(m.out.state.value, 1.1, 1e-15);
    rate_limit_reset(&m);
    EXPECT_TRUE(all_zero(m.out));
}

TEST(RateLimit, what_is_not_known_changes_no_count)
{
    RateLimit m;
    EXPECT_EQ(row("X?X-Xx", 3, 0, &m), "....!!");
    EXPECT_EQ(m.out.state.unknown, 2u);
    EXPECT_EQ(row("XXx?-?x?x", 2, 3), ".!!!!!!!.");
    EXPECT_EQ(row("XhhhssXhX", 3, 0), "........!") << "the last word of a gyro that fell silent trips nothing";
    EXPECT_EQ(row("XXxhhsx", 2, 3), ".!!!!!!") << "and releases nothing";
}

} // namespace rate_limit_test
} // namespace flight::testing
