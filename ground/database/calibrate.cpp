// SPDX-License-Identifier: Apache-2.0
#include "ground/database/calibrate.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace fledge::ground {

namespace {

/// A function of up to two values: x1 lies below x2 on the stack; a function of a single value has it in x2.
struct Function {
    const char *name;
    int takes;
    double (*of)(double x1, double x2); ///< nullptr: it moves values
};

/// Operations on the bits of whole numbers; other numbers, or those beyond 64 bits, have no value.
template <class Bits> double by_bits(double x1, double x2, Bits bits)
{
    constexpr double limit = 9223372036854775808.0;
    if (!(std::abs(x1) < limit && std::abs(x2) < limit)) {
        return std::nan("");
    }
    return static_cast<double>(bits(static_cast<std::int64_t>(x1), static_cast<std::int64_t>(x2)));
}

double shifted(double x1, double x2, bool left)
{
    return std::abs(x2) < 64 ? std::floor(std::ldexp(std::trunc(x1), static_cast<int>(left ? x2 : -x2))) : std::nan("");
}

constexpr Function functions[] = {
    {"+", 2, [](double a, double b) { return a + b; }},
    {"-", 2, [](double a, double b) { return a - b; }},
    {"*", 2, [](double a, double b) { return a * b; }},
    {"/", 2, [](double a, double b) { return a / b; }},
    {"%", 2, [](double a, double b) { return std::fmod(a, b); }},
    {"^", 2, [](double a, double b) { return std::pow(a, b); }},
    {"y^x", 2, [](double a, double b) { return std::pow(b, a); }},
    {"ln", 1, [](double, double x) { return std::log(x); }},
    {"log", 1, [](double, double x) { return std::log10(x); }},
    {"e^x", 1, [](double, double x) { return std::exp(x); }},
    {"1/x", 1, [](double, double x) { return 1 / x; }},
    {"x!", 1, [](double, double x) { return x >= 0 ? std::round(std::tgamma(std::floor(x) + 1)) : std::nan(""); }},
    {"tan", 1, [](double, double x) { return std::tan(x); }},
    {"cos", 1, [](double, double x) { return std::cos(x); }},
    {"sin", 1, [](double, double x) { return std::sin(x); }},
    {"atan", 1, [](double, double x) { return std::atan(x); }},
    {"atan2", 2, [](double a, double b) { return std::atan2(b, a); }},
    {"acos", 1, [](double, double x) { return std::acos(x); }},
    {"asin", 1, [](double, double x) { return std::asin(x); }},
    {"tanh", 1, [](double, double x) { return std::tanh(x); }},
    {"cosh", 1, [](double, double x) { return std::cosh(x); }},
    {"sinh", 1, [](double, double x) { return std::sinh(x); }},
    {"atanh", 1, [](double, double x) { return std::atanh(x); }},
    {"acosh", 1, [](double, double x) { return std::acosh(x); }},
    {"asinh", 1, [](double, double x) { return std::asinh(x); }},
    {"<<", 2, [](double a, double b) { return shifted(a, b, true); }},
    {">>", 2, [](double a, double b) { return shifted(a, b, false); }},
    {"&", 2, [](double a, double b) { return by_bits(a, b, [](auto x, auto y) { return x & y; }); }},
    {"|", 2, [](double a, double b) { return by_bits(a, b, [](auto x, auto y) { return x | y; }); }},
    {"xor", 2, [](double a, double b) { return by_bits(a, b, [](auto x, auto y) { return x ^ y; }); }},
    {"~", 1, [](double, double x) { return by_bits(0, x, [](auto, auto y) { return ~y; }); }},
    {"&&", 2, [](double a, double b) { return a != 0 && b != 0 ? 1. : 0.; }},
    {"||", 2, [](double a, double b) { return a != 0 || b != 0 ? 1. : 0.; }},
    {"!", 1, [](double, double x) { return x == 0 ? 1. : 0.; }},
    {"abs", 1, [](double, double x) { return std::abs(x); }},
    {"div", 2, [](double a, double b) { return b < 0 ? std::ceil(a / b) : std::floor(a / b); }},
    {"int", 1, [](double, double x) { return std::trunc(x); }},
    {">", 2, [](double a, double b) { return a > b ? 1. : 0.; }},
    {">=", 2, [](double a, double b) { return a >= b ? 1. : 0.; }},
    {"<", 2, [](double a, double b) { return a < b ? 1. : 0.; }},
    {"<=", 2, [](double a, double b) { return a <= b ? 1. : 0.; }},
    {"==", 2, [](double a, double b) { return a == b ? 1. : 0.; }},
    {"!=", 2, [](double a, double b) { return a != b ? 1. : 0.; }},
    {"min", 2, [](double a, double b) { return std::min(a, b); }},
    {"max", 2, [](double a, double b) { return std::max(a, b); }},
    {"swap", 2, nullptr},
    {"drop", 1, nullptr},
    {"dup", 1, nullptr},
    {"over", 2, nullptr},
};
constexpr std::uint8_t swap = std::size(functions) - 4, drop = swap + 1, dup = swap + 2, over = swap + 3;

std::optional<double> spline(const Calibrator &calibrator, double x)
{
    const auto &points = calibrator.points;
    if (!calibrator.extrapolate && !(x >= points.front().raw && x <= points.back().raw)) {
        return std::nullopt;
    }
    const auto above = std::upper_bound(points.begin(), points.end(), x,
                                        [](double value, const Calibrator::Point &point) { return value < point.raw; });
    const std::size_t below = above == points.begin() ? 0 : static_cast<std::size_t>(above - points.begin()) - 1;
    if (calibrator.order == 0) {
        return points[below].calibrated;
    }
    // Lagrange's polynomial through order + 1 points, from the last point that is not above x.
    const std::size_t first = std::min(below, points.size() - 1 - calibrator.order);
    double y = 0;
    for (std::size_t i = first; i <= first + calibrator.order; i++) {
        double term = points[i].calibrated;
        for (std::size_t j = first; j <= first + calibrator.order; j++) {
            if (j != i) {
                term *= (x - points[j].raw) / (points[i].raw - points[j].raw);
            }
        }
        y += term;
    }
    return y;
}

std::optional<double> calculated(const Calibrator &calibrator, double x, const Lookup &lookup)
{
    std::array<double, math_depth> stack; // the reader has checked its depth
    std::size_t n = 0;
    for (const MathStep &step : calibrator.steps) {
        switch (step.kind) {
        case MathStep::Kind::number: stack[n++] = step.number; break;
        case MathStep::Kind::this_value: stack[n++] = x; break;
        case MathStep::Kind::value: {
            const auto found = lookup(step.value);
            if (!found) {
                return std::nullopt;
            }
            stack[n++] = *found;
            break;
        }
        case MathStep::Kind::function:
            if (step.function == swap) {
                std::swap(stack[n - 1], stack[n - 2]);
            } else if (step.function == drop) {
                n--;
            } else if (step.function == dup || step.function == over) {
                stack[n] = stack[n - (step.function == dup ? 1 : 2)];
                n++;
            } else {
                const Function &function = functions[step.function];
                const double below = function.takes == 2 ? stack[n - 2] : 0;
                n -= static_cast<std::size_t>(function.takes);
                stack[n] = function.of(below, stack[n + static_cast<std::size_t>(function.takes) - 1]);
                n++;
            }
        }
    }
    return stack[0];
}

} // namespace

std::optional<std::uint8_t> math_function(std::string_view name)
{
    const auto found = std::find_if(std::begin(functions), std::end(functions),
                                    [&](const Function &candidate) { return name == candidate.name; });
    return found == std::end(functions) ? std::nullopt
                                        : std::optional(static_cast<std::uint8_t>(found - std::begin(functions)));
}

int math_takes(std::uint8_t function)
{
    return functions[function].takes;
}

int math_gives(std::uint8_t function)
{
    return function == drop ? 0 : function == swap || function == dup ? 2 : function == over ? 3 : 1;
}

std::optional<double> calibrated(const Calibrator &calibrator, double x, const Lookup &lookup)
{
    std::optional<double> y;
    switch (calibrator.kind) {
    case Calibrator::Kind::none: return x;
    case Calibrator::Kind::polynomial:
        if (!calibrator.coefficients.empty()) {
            y = polynomial(calibrator.coefficients, x);
        }
        break;
    case Calibrator::Kind::spline: y = spline(calibrator, x); break;
    case Calibrator::Kind::math:
        if (!calibrator.steps.empty()) {
            y = calculated(calibrator, x, lookup);
        }
        break;
    }
    return y && !std::isnan(*y) ? y : std::nullopt;
}

} // namespace fledge::ground
