// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/link_budget.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace fledge::world {
namespace link_budget_test {

constexpr double pi = std::numbers::pi, deg = pi / 180.0;

TEST(LinkBudget, TheErrorFunctionIsThatOfTheLibrary)
{
    for (double x = 0.0; x < 26.0; x += 0.0137) {
        EXPECT_NEAR(complementary_error(x) / std::erfc(x), 1.0, 3e-13) << x;
    }
}

TEST(LinkBudget, DecibelsAreLogarithms)
{
    EXPECT_NEAR(decibels(1000.0), 30.0, 1e-13);
    EXPECT_NEAR(ratio(-228.6), std::pow(10.0, -22.86), 1e-35);
    EXPECT_NEAR(decibels(ratio(4.7)), 4.7, 1e-13);
}

TEST(LinkBudget, FreeSpaceIsThatOfTextbooks)
{
    // 32.45 dB at 1 km and 1 MHz, and 20 log10 of both.
    EXPECT_NEAR(free_space_loss(1e3, 1e6), 32.447783, 1e-6);
    EXPECT_NEAR(free_space_loss(35786e3, 12e9), 32.447783 + 20 * std::log10(35786.0) + 20 * std::log10(12000.0), 1e-6);
}

TEST(LinkBudget, UncodedBitsHaveTheErrorsOfTextbooks)
{
    // Proakis, figure of coherent PSK: 1e-5 at 9.59 dB, 1e-3 at 6.79 dB.
    EXPECT_NEAR(bit_error_rate(RADIO_UNCODED, ratio(9.588)), 1e-5, 3e-8);
    EXPECT_NEAR(bit_error_rate(RADIO_UNCODED, ratio(6.790)), 1e-3, 3e-6);
    EXPECT_EQ(bit_error_rate(RADIO_UNCODED, 0.0), 0.5);
    EXPECT_EQ(bit_error_rate(RADIO_BLOCK, ratio(1.0)), 0.0);
}

TEST(LinkBudget, TheConvolutionalCodeGainsWhatItIsKnownToGain)
{
    // 5.1 dB at 1e-5, and 10 d_free / 2 = 5, which is 7 dB, in the limit.
    const auto needs = [](RadioCode code, double rate) {
        double low = 0.0, high = 40.0;
        while (high - low > 1e-9) {
            const double middle = 0.5 * (low + high);
            (bit_error_rate(code, ratio(middle)) > rate ? low : high) = middle;
        }
        return low;
    };
    EXPECT_NEAR(needs(RADIO_UNCODED, 1e-5) - needs(RADIO_CONVOLUTIONAL, 1e-5), 5.3, 0.2);
    EXPECT_NEAR(needs(RADIO_UNCODED, 1e-200) - needs(RADIO_CONVOLUTIONAL, 1e-200), 7.0, 0.05);
    EXPECT_EQ(bit_error_rate(RADIO_CONVOLUTIONAL, ratio(-5.0)), 0.5);
    double before = 1.0;
    for (double dB = -3.0; dB < 12.0; dB += 0.1) {
        const double now = bit_error_rate(RADIO_CONVOLUTIONAL, ratio(dB));
        EXPECT_LE(now, before);
        before = now;
    }
}

TEST(LinkBudget, TheMainLobeFallsByThreeDecibelsAtHalfItsWidth)
{
    EXPECT_EQ(pattern_loss(0.0, 10 * deg, 30.0), 0.0);
    EXPECT_NEAR(pattern_loss(5 * deg, 10 * deg, 30.0), 3.0, 1e-12);
    EXPECT_NEAR(pattern_loss(10 * deg, 10 * deg, 30.0), 12.0, 1e-12);
    EXPECT_EQ(pattern_loss(90 * deg, 10 * deg, 30.0), 30.0);
}

TEST(LinkBudget, ABeamSeesItsShareOfADisc)
{
    const double radius = 0.267 * deg;
    for (const double beam : {0.02 * deg, 0.065 * deg, 0.3 * deg, 2 * deg, 30 * deg}) {
        const double sigma = beam / std::sqrt(8.0 * std::log(2.0));
        EXPECT_NEAR(beam_share(0.0, radius, beam), 1.0 - std::exp(-0.5 * radius * radius / sigma / sigma), 2e-6);
        // Elsewhere, by the share of the beam's rays that meet the disc.
        std::mt19937 random(1);
        std::normal_distribution<double> ray(0.0, sigma);
        for (const double angle : {0.5 * radius, radius, radius + sigma}) {
            const int n = 200000;
            int hits = 0;
            for (int i = 0; i < n; i++) {
                const double x = ray(random), y = ray(random) - angle;
                hits += x * x + y * y < radius * radius;
            }
            const double share = static_cast<double>(hits) / n;
            EXPECT_NEAR(beam_share(angle, radius, beam), share, 5.0 * std::sqrt((share + 1.0 / n) / n));
        }
    }
    EXPECT_EQ(beam_share(2 * deg, radius, 0.065 * deg), 0.0);
}

} // namespace link_budget_test
} // namespace fledge::world
