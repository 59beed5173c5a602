// SPDX-License-Identifier: Apache-2.0
#include "ground/database/calibrate.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace fledge::ground {

namespace {

using N = const Number &;

/// A function of up to two values: x1 lies below x2 on the stack; a function of a single value has it in x2.
struct Function {
    const char *name;
    int takes;
    double (*of_reals)(double x1, double x2) = nullptr;
    Number (*of)(N x1, N x2) = nullptr; ///< instead of of_reals; neither: it moves values
};

/// The whole number whose bits are operated on; nothing: a double beyond 64 bits, or NaN.
std::optional<Wide> bits_in(N x)
{
    constexpr double limit = 18446744073709551616.0;
    if (x.is_whole()) {
        return x.whole();
    }
    return std::abs(x.real()) < limit ? Number(std::trunc(x.real())).nearest() : std::nullopt;
}

/// Operations on the bits of whole numbers, which are those of two's complement without an end.
template <class Bits> Number by_bits(N x1, N x2, Bits bits)
{
    const auto a = bits_in(x1), b = bits_in(x2);
    return a && b ? Number(bits(*a, *b)) : Number(std::nan(""));
}

Number shifted(N x1, N x2, bool left)
{
    const double by = std::trunc(left ? x2.real() : -x2.real());
    const auto whole = bits_in(x1);
    if (whole && by < 0) {
        return *whole >> static_cast<int>(std::min(-by, 127.0));
    }
    if (!(std::abs(by) < 64)) {
        return std::nan("");
    }
    if (!whole) {
        return std::floor(std::ldexp(std::trunc(x1.real()), static_cast<int>(by)));
    }
    return Number(*whole) * Number(Wide(1) << static_cast<int>(by));
}

/// A quotient, rounded to a whole number if `round` says so: down, or up if it is divided by a negative number.
Number divided(N a, N b, bool round)
{
    constexpr Wide least = Wide(1) << 127;
    if (a.is_whole() && b.is_whole() && b != 0 && !(a == least && b == -1)) { // whose quotient has 128 bits
        const Wide rest = a.whole() % b.whole(), quotient = a.whole() / b.whole();
        if (rest == 0 || round) {
            return quotient - (rest < 0 ? b.whole() > 0 ? 1 : -1 : 0);
        }
    }
    const double quotient = a.real() / b.real();
    return !round ? quotient : b < 0 ? std::ceil(quotient) : std::floor(quotient);
}

Number power(N base, N exponent)
{
    if (base.is_whole() && exponent.is_whole() && exponent >= 0 && exponent < 128) {
        Number product = 1;
        for (Wide i = 0; i < exponent.whole() && product.is_whole(); i++) {
            product = product * base;
        }
        if (product.is_whole()) {
            return product;
        }
    }
    return std::pow(base.real(), exponent.real());
}

constexpr Function functions[] = {
    {"+", 2, nullptr, [](N a, N b) { return a + b; }},
    {"-", 2, nullptr, [](N a, N b) { return a - b; }},
    {"*", 2, nullptr, [](N a, N b) { return a * b; }},
    {"/", 2, nullptr, [](N a, N b) { return divided(a, b, false); }},
    {"%", 2, nullptr,
     [](N a, N b) {
         return a.is_whole() && b.is_whole() && b != 0 ? b == -1 ? Number(0) : Number(a.whole() % b.whole())
                                                       : Number(std::fmod(a.real(), b.real()));
     }},
    {"^", 2, nullptr, power},
    {"y^x", 2, nullptr, [](N a, N b) { return power(b, a); }},
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
    {"<<", 2, nullptr, [](N a, N b) { return shifted(a, b, true); }},
    {">>", 2, nullptr, [](N a, N b) { return shifted(a, b, false); }},
    {"&", 2, nullptr, [](N a, N b) { return by_bits(a, b, [](auto x, auto y) { return x & y; }); }},
    {"|", 2, nullptr, [](N a, N b) { return by_bits(a, b, [](auto x, auto y) { return x | y; }); }},
    {"xor", 2, nullptr, [](N a, N b) { return by_bits(a, b, [](auto x, auto y) { return x ^ y; }); }},
    {"~", 1, nullptr, [](N, N x) { return by_bits(0, x, [](auto, auto y) { return ~y; }); }},
    {"&&", 2, nullptr, [](N a, N b) { return Number(a != 0 && b != 0); }},
    {"||", 2, nullptr, [](N a, N b) { return Number(a != 0 || b != 0); }},
    {"!", 1, nullptr, [](N, N x) { return Number(x == 0); }},
    {"abs", 1, nullptr, [](N, N x) { return x.is_whole() ? (x < 0 ? Number(0) - x : x) : Number(std::abs(x.real())); }},
    {"div", 2, nullptr, [](N a, N b) { return divided(a, b, true); }},
    {"int", 1, nullptr, [](N, N x) { return x.is_whole() ? x : Number(std::trunc(x.real())); }},
    {">", 2, nullptr, [](N a, N b) { return Number(a > b); }},
    {">=", 2, nullptr, [](N a, N b) { return Number(a >= b); }},
    {"<", 2, nullptr, [](N a, N b) { return Number(a < b); }},
    {"<=", 2, nullptr, [](N a, N b) { return Number(a <= b); }},
    {"==", 2, nullptr, [](N a, N b) { return Number(a == b); }},
    {"!=", 2, nullptr, [](N a, N b) { return Number(a != b); }},
    {"min", 2, nullptr, [](N a, N b) { return std::min(a, b); }},
    {"max", 2, nullptr, [](N a, N b) { return std::max(a, b); }},
    {"swap", 2},
    {"drop", 1},
    {"dup", 1},
    {"over", 2},
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

Number calculated(const Calibrator &calibrator, N x, const Lookup &lookup)
{
    std::array<Number, math_depth> stack; // the reader has checked its depth
    std::size_t n = 0;
    for (const MathStep &step : calibrator.steps) {
        switch (step.kind) {
        case MathStep::Kind::number: stack[n++] = step.number; break;
        case MathStep::Kind::this_value: stack[n++] = x; break;
        case MathStep::Kind::value: {
            const auto found = lookup(step.value);
            if (!found) {
                return std::nan("");
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
                const Number above = stack[n - 1], below = function.takes == 2 ? stack[n - 2] : 0;
                n -= static_cast<std::size_t>(function.takes);
                stack[n++] =
                    function.of != nullptr ? function.of(below, above) : function.of_reals(below.real(), above.real());
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

std::optional<Number> calibrated(const Calibrator &calibrator, const Number &x, const Lookup &lookup)
{
    const auto &terms = calibrator.coefficients;
    std::optional<Number> y;
    switch (calibrator.kind) {
    case Calibrator::Kind::none: return x;
    case Calibrator::Kind::polynomial:
        if (terms.empty()) {
            break;
        }
        y = exactly(terms.back());
        for (std::size_t i = terms.size() - 1; i-- > 0;) { // as `polynomial` if a number is not whole
            y = *y * x + exactly(terms[i]);
        }
        break;
    case Calibrator::Kind::spline: y = spline(calibrator, x.real()); break;
    case Calibrator::Kind::math:
        if (!calibrator.steps.empty()) {
            y = calculated(calibrator, x, lookup);
        }
        break;
    }
    return y && *y == *y ? y : std::nullopt;
}

} // namespace fledge::ground
