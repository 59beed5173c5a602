// SPDX-License-Identifier: Apache-2.0
// The derivative of a smooth function, by central differences extrapolated to step zero
// (Richardson).
#pragma once

#include <array>
#include <cstddef>

namespace flight::testing {

/// df/dt at 0, from f at +-h, +-h/2, ... +-h/2^(Levels - 1); the error is of order h^(2 Levels).
/// T is a type with + - and scaling that can be assigned: a double or a fixed-size Eigen matrix.
template <class T, std::size_t Levels = 5, class F> T derivative(F f, double h)
{
    std::array<T, Levels> row;
    for (std::size_t i = 0; i < Levels; i++, h /= 2) {
        T ahead = f(h), behind = f(-h);
        row[i] = (ahead - behind) / (2 * h);
    }
    double power = 4;
    for (std::size_t level = 1; level < Levels; level++, power *= 4) {
        for (std::size_t i = 0; i + level < Levels; i++) {
            row[i] = (row[i + 1] * power - row[i]) / (power - 1);
        }
    }
    return row[0];
}

} // namespace flight::testing
