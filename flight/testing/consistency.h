// SPDX-License-Identifier: Apache-2.0
// Whether the errors of estimates are as large as the estimates say, over many random runs.
#pragma once

#include "flight/testing/eigen.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string_view>

namespace flight::testing {

/// How many runs: few in the suite, all with FLEDGE_CAMPAIGN=1 in the environment.
inline int campaign_runs(int few, int all)
{
    const char *campaign = std::getenv("FLEDGE_CAMPAIGN");
    return campaign && std::string_view(campaign) == "1" ? all : runs(few);
}

/// The average of n squares of normalised errors is within the 99.8 % interval of chi-square, by Wilson and Hilferty.
inline void expect_chi_square(double average, double degrees, int n)
{
    const double spread = 2 / (9 * degrees * n);
    EXPECT_GT(average, degrees * std::pow(1 - spread - 3.09 * std::sqrt(spread), 3)) << n << " runs";
    EXPECT_LT(average, degrees * std::pow(1 - spread + 3.09 * std::sqrt(spread), 3)) << n << " runs";
}

} // namespace flight::testing
