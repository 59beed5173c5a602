// SPDX-License-Identifier: Apache-2.0
// The distribution of durations against a sorted list of them; the clock's rules.
extern "C" {
#include "targets/linux/pace.h"
}

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace pace_test {

TEST(Pace, QuantilesAreThoseOfTheSortedDurationsToAnEighth)
{
    std::mt19937_64 rng(3);
    for (int round = 0; round < 50; round++) {
        PaceHistogram h{};
        std::vector<std::int64_t> all;
        std::lognormal_distribution<double> durations(std::uniform_real_distribution<>(1, 18)(rng), 1.0);
        for (int i = 0; i < 999; i++) {
            all.push_back(std::llround(std::min(durations(rng), 9e8)));
            pace_note(&h, all.back());
        }
        std::sort(all.begin(), all.end());
        EXPECT_EQ(h.least, all.front());
        EXPECT_EQ(h.most, all.back());
        EXPECT_EQ(pace_quantile(&h, 1.0), all.back());
        for (const double share : {0.01, 0.5, 0.9, 0.99}) {
            const auto exact = all[static_cast<std::size_t>(std::ceil(share * 999)) - 1];
            const auto quantile = pace_quantile(&h, share);
            EXPECT_GE(quantile, exact);
            EXPECT_LE(quantile, exact + exact / 8 + 1);
        }
    }
}

TEST(Pace, EveryDurationHasABin)
{
    for (int bit = 0; bit < 63; bit++) {
        for (const std::int64_t off : {-1, 0, 1}) {
            PaceHistogram h{};
            const std::int64_t ns = (std::int64_t{1} << bit) + off;
            pace_note(&h, ns);
            EXPECT_EQ(pace_quantile(&h, 0.5), ns); // the most caps the bin's upper end
        }
    }
    PaceHistogram h{};
    pace_note(&h, -5); // a clock that was set back
    EXPECT_EQ(h.least, -5);
    EXPECT_EQ(pace_quantile(&h, 0.5), -5);
    const PaceHistogram none{};
    EXPECT_EQ(pace_quantile(&none, 0.5), 0);
}

TEST(Pace, SleepsUntilThen)
{
    const std::int64_t until = pace_now() + 3'000'000;
    EXPECT_EQ(pace_sleep(until), 0);
    EXPECT_GE(pace_now(), until);
    EXPECT_EQ(pace_sleep(until), 0); // which has passed
    const std::int64_t cpu = pace_cpu();
    EXPECT_GE(pace_cpu(), cpu);
}

} // namespace pace_test
