// SPDX-License-Identifier: Apache-2.0
// What TimeCorrelation and UtcCorrelation share: the straight line, in long double, and what becomes of the clock.
#pragma once

#include "flight/testing/eigen.h"

extern "C" {
#include "flight/msg/avionics.h"
}

#include <gtest/gtest.h>

namespace flight::testing {

template <class Module> void expect_the_straight_line(void (*update)(Module *, Tick))
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        Module m{};
        m.par.clock_0 = std::llround(random.real(-1e18, 1e18));
        m.par.time_0 = std::llround(random.real(-1e18, 1e18));
        m.par.drift = random.real(-1e-3, 1e-3);
        const std::int64_t since = std::llround(random.real(-1e17, 1e17));
        m.in.vehicle.time = m.par.clock_0 + since;
        m.in.vehicle.head = good();
        update(&m, {5, 0});
        const long double exact = static_cast<long double>(m.par.time_0) +
                                  static_cast<long double>(since) * (1 + static_cast<long double>(m.par.drift));
        EXPECT_NEAR(static_cast<double>(m.out.time.time - exact), 0.0, 0.51);
        EXPECT_EQ(m.out.time.head.quality, QUALITY_GOOD);
    }
}

template <class Module> void expect_the_clock(void (*update)(Module *, Tick))
{
    Module m{};
    m.par.time_0 = 1000;
    update(&m, {7, 0});
    EXPECT_EQ(m.out.time.time, 1007);
    EXPECT_EQ(m.out.time.head.quality, QUALITY_GOOD);
    m.in.vehicle = {with(QUALITY_STALE), 50, 0, 0, 0};
    update(&m, {8, 1});
    EXPECT_EQ(m.out.time.time, 1050);
    EXPECT_EQ(m.out.time.head.quality, QUALITY_DEGRADED);
    // Times that an int64_t does not hold are the nearest that it can.
    m.par.time_0 = m.par.clock_0 = INT64_MIN;
    m.in.vehicle.time = 5;
    update(&m, {9, 1});
    EXPECT_EQ(m.out.time.time, -1);
    m.par.time_0 = -1;
    m.par.clock_0 = INT64_MAX;
    m.in.vehicle.time = INT64_MIN;
    update(&m, {9, 1});
    EXPECT_EQ(m.out.time.time, INT64_MIN);
}

} // namespace flight::testing
