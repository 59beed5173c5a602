// SPDX-License-Identifier: Apache-2.0
// The complementary error function, whose bits are the same on all machines.
#pragma once

#include "flight/math/elementary.h"

#include <cmath>
#include <numbers>

namespace fledge::world {

/// erfc(x) for x >= 0.
inline double complementary_error(double x)
{
    if (x < 2.0) { // erf by its series of positive terms: no digits cancel
        double term = x, sum = x;
        for (int n = 1; term > 1e-17 * sum; n++) {
            term *= 2.0 * x * x / (2 * n + 1);
            sum += term;
        }
        return 1.0 - 2.0 / std::sqrt(std::numbers::pi) * fm_exp(-x * x) * sum;
    }
    double fraction = x; // the continued fraction, from its end
    for (int n = 60; n > 0; n--) {
        fraction = x + 0.5 * n / fraction;
    }
    return fm_exp(-x * x) / (std::sqrt(std::numbers::pi) * fraction);
}

} // namespace fledge::world
