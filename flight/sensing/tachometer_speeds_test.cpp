// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/sensing/tachometer_speeds.h"
}

#include <gtest/gtest.h>

namespace tachometer_speeds_test {

TEST(TachometerSpeeds, a_turn_in_a_second_is_two_pi)
{
    TachometerSpeeds m{};
    m.par.marks = 24;
    m.par.window = 250'000'000;
    tachometer_speeds_reset(&m);
    tachometer_speeds_update(&m, {0, 0});
    EXPECT_EQ(m.out.speeds.head.quality, QUALITY_NONE) << "without counts there is no speed";
    m.in.tachometers.head = {0, QUALITY_GOOD, 1};
    m.in.tachometers.counts[0] = 6;
    m.in.tachometers.counts[7] = -12;
    tachometer_speeds_update(&m, {5, 5});
    EXPECT_DOUBLE_EQ(m.out.speeds.Omega[0], 2 * M_PI);
    EXPECT_DOUBLE_EQ(m.out.speeds.Omega[7], -4 * M_PI);
    EXPECT_EQ(m.out.speeds.Omega[1], 0.0);
    EXPECT_EQ(m.out.speeds.head.t, 5);
    m.in.tachometers.head.quality = QUALITY_STALE;
    tachometer_speeds_update(&m, {9, 4});
    EXPECT_EQ(m.out.speeds.head.quality, QUALITY_DEGRADED);
}

} // namespace tachometer_speeds_test
