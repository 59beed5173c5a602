// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/navigation/time_correlation.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace time_correlation_test {

TEST(TimeCorrelation, is_the_straight_line_to_the_nanosecond)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        TimeCorrelation m{};
        m.par.clock_0 = std::llround(random.real(-1e18, 1e18));
        m.par.time_0 = std::llround(random.real(-1e18, 1e18));
        m.par.drift = random.real(-1e-3, 1e-3);
        const std::int64_t since = std::llround(random.real(-1e17, 1e17));
        m.in.vehicle.time = m.par.clock_0 + since;
        m.in.vehicle.head = good();
        time_correlation_update(&m, {5, 0});
        const long double exact = static_cast<long double>(m.par.time_0) +
                                  static_cast<long double>(since) * (1 + static_cast<long double>(m.par.drift));
        EXPECT_NEAR(static_cast<double>(m.out.time.time - exact), 0.0, 0.51);
        EXPECT_EQ(m.out.time.head.quality, QUALITY_GOOD);
    }
}

TEST(TimeCorrelation, takes_flights_time_without_a_vehicle_and_degrades_with_its_clock)
{
    TimeCorrelation m{};
    m.par.time_0 = 1000;
    time_correlation_update(&m, {7, 0});
    EXPECT_EQ(m.out.time.time, 1007);
    EXPECT_EQ(m.out.time.head.quality, QUALITY_GOOD);
    m.in.vehicle = {with(QUALITY_STALE), 50, 0, 0, 0};
    time_correlation_update(&m, {8, 1});
    EXPECT_EQ(m.out.time.time, 1050);
    EXPECT_EQ(m.out.time.head.quality, QUALITY_DEGRADED);
}

} // namespace time_correlation_test
} // namespace flight::testing
