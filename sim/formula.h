// SPDX-License-Identifier: Apache-2.0
// Signal temporal logic with quantitative semantics over sampled signals: how far a formula is from changing its
// truth. Each value is an interval, because a sample may be unknown and a window may reach beyond the end: [-inf, inf]
// says nothing. A formula holds if its interval lies above zero, and is violated if it lies below.
//
// The semantics are pointwise: a formula has a value at each sample, and a window has the samples in it.
// Sources: A. Donze, O. Maler, Robust satisfaction of temporal logic over real-valued signals, 2010; J. V. Deshmukh
// et al., Robust online monitoring of signal temporal logic, 2017 (intervals of what is not known yet).
#pragma once

#include "sim/integrator.h"

#include <cstdint>
#include <limits>

namespace fledge::sim {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();
inline constexpr Ns no_end = std::numeric_limits<Ns>::max();

/// Which sample and which atom decided a bound; unknown: as the atom had no value there.
struct Witness {
    Ns t = -1;
    int atom = -1;
    bool unknown = false;
};

/// What is known of a robustness.
struct Robustness {
    double low = -unbounded, high = unbounded;
    Witness at_low, at_high;

    static Robustness known(double value, Witness at = {}) { return {value, value, at, at}; }
    Robustness operator-() const { return {-high, -low, at_high, at_low}; }
};

inline constexpr Robustness true_always{unbounded, unbounded, {}, {}}, false_always{-unbounded, -unbounded, {}, {}};

/// Whether the bound y takes the place of the bound x. Of equal bounds the first counts, but rather one of an atom
/// without a value: it is why nothing is known.
inline bool less(double y, const Witness &of_y, double x, const Witness &of_x)
{
    return y < x || (y == x && of_y.unknown && !of_x.unknown);
}

inline Robustness least(const Robustness &a, const Robustness &b)
{
    const bool low = less(b.low, b.at_low, a.low, a.at_low), high = less(b.high, b.at_high, a.high, a.at_high);
    return {low ? b.low : a.low, high ? b.high : a.high, low ? b.at_low : a.at_low, high ? b.at_high : a.at_high};
}

inline Robustness greatest(const Robustness &a, const Robustness &b)
{
    return -least(-a, -b);
}

/// A formula as a tree in postfix order: the operands of a node come before it.
struct FormulaNode {
    enum Kind : std::uint8_t {
        ATOM,     ///< a: its number
        CONSTANT, ///< true if a is not 0
        NOT,
        AND,
        OR,
        ALWAYS,     ///< at all samples of [t + from, t + to]; with none in it, true
        EVENTUALLY, ///< at one of them; with none in it, false
        UNTIL,      ///< the second at a sample of [t, t + to], and the first at all samples before that one
        ONCE,       ///< at this sample or one before
        BEGINS,     ///< at this sample, and not at the one before
        CLOCK,      ///< true from the time `from` on
    } kind = ATOM;
    int a = -1, b = -1; ///< operands, by index; of an ATOM its number
    Ns from = 0, to = no_end;

    bool operator==(const FormulaNode &) const = default;
};

} // namespace fledge::sim
