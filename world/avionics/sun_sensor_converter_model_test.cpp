// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/sun_sensor_converter_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>

namespace sun_sensor_converter_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

struct Converter {
    SunSensorConverter i{};
    SunSensorConverterModel model{i};
    Ns t = 0;

    Converter()
    {
        i.par.n = 8;
        i.par.bits = 12;
        i.par.scale = 2e-6;
        i.par.offset = 1e-4;
        i.in.currents.head.quality = QUALITY_GOOD;
        for (std::size_t k = 0; k < 8; k++) {
            i.in.currents.current[k] = 1e-3 + 1e-4 * static_cast<double>(k);
        }
        begin(1);
    }
    void begin(std::uint64_t seed)
    {
        model.prepare({"world.adc", seed, nullptr});
        model.reset(0);
        t = 0;
    }
    std::array<std::uint16_t, 8> read()
    {
        t += second;
        model.update({t, second});
        return std::to_array(i.out.counts.counts);
    }
};

TEST(SunSensorConverter, ACountIsTheNearestToItsCurrent)
{
    Converter c;
    for (double current = 1e-4; current < 8.2e-3; current += 1.37e-6) {
        c.i.in.currents.current[3] = current;
        ASSERT_NEAR(1e-4 + 2e-6 * c.read()[3], current, 1e-6 * (1 + 1e-9));
    }
    c.i.in.currents.current[3] = 0.0; // below and above the range
    c.i.in.currents.current[4] = 1.0;
    EXPECT_EQ(c.read()[3], 0);
    EXPECT_EQ(c.read()[4], 4095);
}

TEST(SunSensorConverter, ItReadsTheSensorsFromItsFirstOneOn)
{
    Converter c;
    const auto all = c.read();
    c.i.par.n = 4;
    c.i.par.first = 4;
    c.begin(1);
    const auto half = c.read();
    EXPECT_TRUE(std::equal(half.begin(), half.begin() + 4, all.begin() + 4));
    EXPECT_TRUE(std::all_of(half.begin() + 4, half.end(), [](std::uint16_t count) { return count == 0; }));
    c.i.par.first = 5;
    try {
        c.begin(1);
        FAIL() << "there is no ninth sensor";
    } catch (const fledge::sim::SetupError &e) {
        EXPECT_STREQ(e.what(), "world.adc has 4 channels from sensor 5 on, but there are 8 sensors");
    }
}

TEST(SunSensorConverter, FaultsHaveTheirTimesAndTheirChannels)
{
    Converter c;
    const auto sound = c.read();
    c.begin(1);
    c.i.par.n_faults = 3;
    c.i.par.faults[0] = {FAULT_HIGH, 1u << 1, 0.0, 5 * second, 95 * second};
    c.i.par.faults[1] = {FAULT_LOW, 1u << 2, 0.0, 5 * second, 95 * second};
    c.i.par.faults[2] = {FAULT_BABBLE, 1u << 3, 0.0, 5 * second, 95 * second};
    std::set<int> babble;
    double sum = 0.0;
    for (int k = 1; k <= 110; k++) {
        auto counts = c.read();
        if (k < 5 || k >= 100) {
            EXPECT_EQ(counts, sound) << k;
            continue;
        }
        EXPECT_EQ(counts[1], 4095);
        EXPECT_EQ(counts[2], 0);
        babble.insert(counts[3]);
        sum += counts[3];
        counts[1] = sound[1], counts[2] = sound[2], counts[3] = sound[3];
        EXPECT_EQ(counts, sound);
    }
    EXPECT_GT(babble.size(), 80u);
    EXPECT_NEAR(sum / 95, 2047.5, 4 * 4095 / std::sqrt(12.0 * 95));
}

TEST(SunSensorConverter, NoiseHasItsDeviationAndItsSeed)
{
    Converter c;
    c.i.par.noise = 4e-5; // 20 counts
    double sum = 0.0, square = 0.0;
    const int n = 4000;
    for (int k = 0; k < n; k++) {
        const double error = c.read()[0] - 450.0;
        sum += error / n;
        square += error * error / n;
    }
    EXPECT_NEAR(sum, 0.0, 4 * 20 / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(square), 20.0, 4 * 20 / std::sqrt(2.0 * n));
    c.begin(2);
    const auto first = c.read();
    c.begin(3);
    const auto other = c.read();
    c.begin(2);
    EXPECT_EQ(c.read(), first);
    EXPECT_NE(other, first);
}

} // namespace sun_sensor_converter_model_test
