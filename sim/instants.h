// SPDX-License-Identifier: Apache-2.0
// The parts of formulas that look at no later sample: comparisons, and what joins them. They are computed for a block
// of samples at a time, each once however many formulas have it, and only where a formula needs it.
#pragma once

#include "sim/formula.h"

#include <span>
#include <vector>

namespace fledge::sim {

class Instants {
public:
    static constexpr std::size_t most = 64; ///< samples in a block

    /// The bounds at each sample of a block.
    struct Column {
        const double *low, *high; ///< the same, if all are known, and both bounds are of the same atoms
        int fixed = 0;            ///< 1: true at each sample, -1: false at each
        bool known() const { return low == high; }
    };

    /// The number of a part: a kind without a window, whose operands a and b are numbers that this gave before.
    int add(FormulaNode what);
    /// A block of samples, as TemporalMonitor takes it.
    void take(std::span<const Ns> times, const double *margins, const unsigned char *unknown);
    void reset();

    std::span<const Ns> times() const { return times_; }
    /// In the newest block. A part of which one block was not wanted must not be wanted any more.
    const Column &column(int part);
    Witness witness(int part, std::size_t k, bool high) const;
    Robustness at(int part, std::size_t k);

private:
    struct Part {
        FormulaNode what;
        Column column{};
        std::uint64_t block = 0;         ///< of the column
        std::vector<double> lows, highs; ///< the memory of a column
        Robustness before, last;         ///< of ONCE and BEGINS: before this block, and at its end
        std::vector<Witness> at[2];      ///< of ONCE
    };

    void compute(Part &part);
    void join(Part &part, const Column &a, const Column &b);
    void hold(Part &part, const Column &a);
    void begin(Part &part, const Column &a);

    std::vector<Part> parts_;
    std::span<const Ns> times_;
    const double *margins_ = nullptr;
    const unsigned char *unknown_ = nullptr;
    std::uint64_t block_ = 0;
};

} // namespace fledge::sim
