// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/sensing/gyro_rates.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace gyro_rates_test {

constexpr std::int64_t ms = 1'000'000;

struct Unit {
    GyroRates m{};
    std::int64_t t = 0;

    Unit()
    {
        m.par.bits = 16;
        m.par.scale = 1e-5;
        m.par.tick = ms;
        gyro_rates_reset(&m);
        m.in.registers.head.quality = QUALITY_GOOD;
    }
    void update(std::int64_t dt = 250 * ms)
    {
        t += dt;
        gyro_rates_update(&m, {t, dt});
    }
    /// The angle about each axis as it is now, in counts.
    void read(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t dt = 250 * ms)
    {
        GyroRegisters &r = m.in.registers;
        r.angle[0] = static_cast<std::uint32_t>(x & 0xFFFF);
        r.angle[1] = static_cast<std::uint32_t>(y & 0xFFFF);
        r.angle[2] = static_cast<std::uint32_t>(z & 0xFFFF);
        r.time = time_tag(t + dt, ms);
        r.counter++;
        update(dt);
    }
    const GyroRate &out() const { return m.out.rate; }
};

TEST(GyroRates, the_rate_is_the_turn_over_its_time_also_where_counts_wrap_around)
{
    std::mt19937 random(2);
    std::uniform_int_distribution<std::int64_t> step(-32768, 32767), time(50, 400);
    Unit unit;
    std::int64_t angle[3] = {0, 0, 0};
    unit.read(0, 0, 0);
    EXPECT_EQ(unit.out().head.quality, QUALITY_NONE) << "one reading is no rate";
    for (int k = 0; k < 1000; k++) {
        const std::int64_t steps[3] = {step(random), step(random), k % 2 ? 32767 : -32768};
        for (int i = 0; i < 3; i++) {
            angle[i] += steps[i];
        }
        const std::int64_t dt = time(random) * ms;
        unit.read(angle[0], angle[1], angle[2], dt);
        for (int i = 0; i < 3; i++) {
            ASSERT_DOUBLE_EQ(unit.out().omega_BN_B.v[i], 1e-5 * static_cast<double>(steps[i]) / tick_seconds(dt));
        }
        EXPECT_EQ(unit.out().head.t, unit.t);
        EXPECT_EQ(unit.out().head.sequence, static_cast<std::uint32_t>(k + 1));
    }
}

TEST(GyroRates, no_turn_is_lost_where_readings_are_missing)
{
    Unit unit;
    unit.read(10, 0, 0);
    unit.update();
    EXPECT_EQ(unit.out().head.quality, QUALITY_NONE);
    unit.read(60, 0, 0);
    EXPECT_DOUBLE_EQ(unit.out().omega_BN_B.v[0], 50e-5 / 0.5);
    unit.update();
    EXPECT_EQ(unit.out().head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(unit.out().head.sequence, 1u);
}

TEST(GyroRates, counters_that_begin_anew_and_rates_that_cannot_be_are_left_out)
{
    Unit unit;
    unit.m.par.rate_max = 0.1;
    for (int k = 0; k < 5; k++) {
        unit.read(100 * k, 0, 0);
    }
    EXPECT_EQ(unit.out().head.sequence, 4u);
    unit.m.in.registers.counter = 0; // it was without power
    unit.read(0, 0, 0);
    EXPECT_EQ(unit.out().head.sequence, 4u);
    EXPECT_EQ(unit.m.mem.refused, 0u);
    unit.read(100, 0, 0);
    EXPECT_EQ(unit.out().head.sequence, 5u);
    unit.read(100 ^ 1 << 14, 0, 0); // a bit has flipped
    unit.read(300, 0, 0);
    EXPECT_EQ(unit.out().head.sequence, 5u);
    EXPECT_EQ(unit.m.mem.refused, 2u);
    unit.read(400, 0, 0);
    EXPECT_EQ(unit.out().head.sequence, 6u);
    EXPECT_DOUBLE_EQ(unit.out().omega_BN_B.v[0], 100e-5 / 0.25);
}

} // namespace gyro_rates_test
