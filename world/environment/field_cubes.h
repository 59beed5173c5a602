// SPDX-License-Identifier: Apache-2.0
// A smooth field as a polynomial in cubes, for places that lie close together, such as those of an orbit's steps.
//
// In a cube, each component is of third degree in each of x, y and z, and equals the field at 4 x 4 x 4 places: the
// roots of Chebyshev's polynomial along each edge. The cubes are fixed in the body, so that no result depends on where
// the craft came from. Where D is the largest fourth derivative along an edge e, the error is below
//
//     (1 + L + L^2) D (e / 2)^4 / (4! 2^3),    L = 1.85, Lebesgue's constant of four such places
//
// Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), chapters 8 and 15.
#pragma once

#include "sim/wide.h"

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>

namespace fledge::world {

class FieldCubes {
public:
    /// With edges [m] for which the error stays below `error` where no fourth derivative exceeds `fourth` [1/m^4].
    /// All cubes are forgotten.
    void set(double error, double fourth);
    double edge() const { return edge_; } ///< [m]

    /// The field at r [m]. `exact` is a function of a place, the field that has the number `when`.
    Eigen::Vector3d at(const Eigen::Vector3d &r, std::int64_t when, const auto &exact)
    {
        Key key{0, 0, 0, when};
        double place[3];
        if (!find(r, key, place)) {
            return exact(r);
        }
        Cube &cube = cubes_[4 * (key[0] & 1) + 2 * (key[1] & 1) + (key[2] & 1)];
        if (cube.key != key) {
            cube.key = key;
            fill(cube, exact);
        }
        double field[4];
        sim::in_registers<&FieldCubes::evaluate>(*this, cube, place, field);
        return {field[0], field[1], field[2]};
    }

private:
    using Key = std::array<std::int64_t, 4>; ///< the place along each axis; the field's number
    struct alignas(32) Cube {
        double powers[4][4][4][4]; ///< of x, y, z, from -1 to 1 within the cube, and the component
        Key key;
    };

    /// Where r is, and the place in the cube. False where there is none.
    bool find(const Eigen::Vector3d &r, Key &key, double *place) const
    {
        for (int i = 0; i < 3; i++) {
            const double in_edges = per_edge_ * r[i];
            if (!(std::abs(in_edges) < most_cubes)) {
                return false;
            }
            const auto toward_zero = static_cast<std::int64_t>(in_edges);
            key[i] = toward_zero - (in_edges < static_cast<double>(toward_zero));
            place[i] = 2.0 * (in_edges - static_cast<double>(key[i])) - 1.0;
        }
        return true;
    }
    void fill(Cube &cube, const std::function<Eigen::Vector3d(const Eigen::Vector3d &)> &exact) const;
    [[gnu::always_inline]] void evaluate(const Cube &cube, const double *place, double *to) const
    {
        using Four [[gnu::vector_size(32), gnu::may_alias]] = double;
        const auto *all = reinterpret_cast<const Four *>(cube.powers);
        const double x = place[0], y = place[1], z = place[2];
        Four sum{}, line{};
        for (int i = 3; i >= 0; i--) {
            for (int j = 3; j >= 0; j--) {
                const Four *f = all + 16 * i + 4 * j;
                const Four along = ((f[3] * z + f[2]) * z + f[1]) * z + f[0];
                line = j == 3 ? along : line * y + along;
            }
            sum = i == 3 ? line : sum * x + line;
        }
        for (int i = 0; i < 4; i++) {
            to[i] = sum[i];
        }
    }

    static constexpr double most_cubes = 1e9; ///< along an axis: behind them there are none

    double edge_ = 0.0, per_edge_ = 0.0;
    /// Neighbours have places of their own, so that a craft in a face or a corner does not fill them again and again.
    std::array<Cube, 8> cubes_;
};

} // namespace fledge::world
