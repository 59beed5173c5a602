// SPDX-License-Identifier: Apache-2.0
// The calibrators of a database: from a raw number to one in units, and for arguments of commands the other way.
#pragma once

#include "ground/database/model.h"

#include <functional>
#include <string_view>

namespace fledge::ground {

inline constexpr int math_depth = 32; ///< the largest stack of a calculation

/// A function of a calculation, by its name in XTCE; how many values it takes from the stack and leaves there.
std::optional<std::uint8_t> math_function(std::string_view name);
int math_takes(std::uint8_t function);
int math_gives(std::uint8_t function);

/// What a reference leads to, or nothing.
using Lookup = std::function<std::optional<double>(const Reference &)>;

/// The value of x. Nothing: outside of a spline that does not extrapolate, no number, or a value that is not there.
std::optional<double> calibrated(const Calibrator &calibrator, double x, const Lookup &lookup);

/// c0 + c1 x + c2 x^2 + ..., by Horner's rule, of at least one coefficient.
inline double polynomial(const std::vector<double> &coefficients, double x)
{
    double y = coefficients.back();
    for (std::size_t i = coefficients.size() - 1; i-- > 0;) {
        y = y * x + coefficients[i];
    }
    return y;
}

} // namespace fledge::ground
