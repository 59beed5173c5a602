// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/correlation.h"

extern "C" {
#include "flight/navigation/utc_correlation.h"
}

namespace flight::testing {
namespace utc_correlation_test {

TEST(UtcCorrelation, is_the_straight_line_to_the_nanosecond)
{
    expect_the_straight_line(utc_correlation_update);
}

TEST(UtcCorrelation, takes_flights_time_without_a_vehicle_and_degrades_with_its_clock)
{
    expect_the_clock(utc_correlation_update);
}

} // namespace utc_correlation_test
} // namespace flight::testing
