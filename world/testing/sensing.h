// SPDX-License-Identifier: Apache-2.0
// A sensor without the kernel, and what tests ask of one.
#pragma once

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

namespace fledge::world::testing {

template <class Interface, class Model> struct Bench {
    Interface i{};
    Model model{i};
    Ns t = 0;
    std::vector<std::string> wired;

    /// The truth is good, and at rest at the origin.
    void begin(std::uint64_t seed = 1)
    {
        i.in.truth.head.quality = QUALITY_GOOD;
        model.prepare({"world.sensor", seed, nullptr, wired});
        model.reset(0);
        model.update({t = 0, 0});
    }
    void step(Ns dt)
    {
        t += dt;
        i.in.truth.head.t = t;
        model.update({t, dt});
    }
    void fault(FaultKind kind, std::uint32_t channels, double size = 0.0)
    {
        i.par.faults[i.par.n_faults++] = {kind, channels, size, 0, 0};
    }
};

/// Mean and mean square of a sample, which must be those of a normal distribution within four deviations.
struct Sample {
    int n = 0;
    double sum = 0.0, square = 0.0;

    void add(double x)
    {
        n++;
        sum += x;
        square += x * x;
    }
    double mean() const { return sum / n; }
    double variance() const { return square / n; }
    ::testing::AssertionResult is_normal(double variance) const
    {
        const double scaled = this->variance() / variance - 1.0, shift = mean() / std::sqrt(variance);
        if (std::abs(scaled) < 4.0 * std::sqrt(2.0 / n) && std::abs(shift) < 4.0 / std::sqrt(n)) {
            return ::testing::AssertionSuccess();
        }
        return ::testing::AssertionFailure() << n << " values have the mean " << mean() << " and the variance "
                                             << this->variance() << ", not " << variance;
    }
};

} // namespace fledge::world::testing
