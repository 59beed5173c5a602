// SPDX-License-Identifier: Apache-2.0
// The calibrators of a database: they convert raw numbers to numbers in units, and arguments of commands back.
#pragma once

#include "ground/database/model.h"

#include <functional>
#include <string_view>

namespace fledge::ground {

inline constexpr int math_depth = 32; ///< the largest stack of a calculation

/// A function of a calculation, by its name in XTCE; how many values it pops from the stack and pushes.
std::optional<std::uint8_t> math_function(std::string_view name);
int math_takes(std::uint8_t function);
int math_gives(std::uint8_t function);

/// The value of a reference, if there is one.
using Lookup = std::function<std::optional<Number>(const Reference &)>;

/// The calibrated x. Nothing: x is outside of a spline that does not extrapolate, the result is no number, or a value
/// is missing. Calculations and polynomials of whole numbers are exact up to 127 bits.
std::optional<Number> calibrated(const Calibrator &calibrator, const Number &x, const Lookup &lookup);

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
