// SPDX-License-Identifier: Apache-2.0
#include "flight/navigation/testing/correlation.h"

extern "C" {
#include "flight/navigation/time_correlation.h"
}

namespace flight::testing {
namespace time_correlation_test {

TEST(TimeCorrelation, is_the_straight_line_to_the_nanosecond)
{
    expect_the_straight_line(time_correlation_update);
}

TEST(TimeCorrelation, takes_flights_time_without_a_vehicle_and_degrades_with_its_clock)
{
    expect_the_clock(time_correlation_update);
}

} // namespace time_correlation_test
} // namespace flight::testing
