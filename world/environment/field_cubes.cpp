// SPDX-License-Identifier: Apache-2.0
#include "world/environment/field_cubes.h"

#include <cmath>
#include <limits>

namespace fledge::world {

using Eigen::Vector3d;

namespace {

constexpr double lebesgue = 1.85;
constexpr double outer = 0.92387953251128674, inner = 0.38268343236508977; // cos(pi / 8), cos(3 pi / 8): the roots

/// From the values at the four roots, which ascend, to the factors of the powers.
void to_powers(double *f, std::size_t stride)
{
    constexpr double outer2 = outer * outer, apart = outer2 - inner * inner;
    double &f0 = f[0], &f1 = f[stride], &f2 = f[2 * stride], &f3 = f[3 * stride];
    const double even_outer = 0.5 * (f3 + f0), even_inner = 0.5 * (f2 + f1);
    const double odd_outer = 0.5 * (f3 - f0) / outer, odd_inner = 0.5 * (f2 - f1) / inner;
    f2 = (even_outer - even_inner) / apart;
    f3 = (odd_outer - odd_inner) / apart;
    f0 = even_outer - f2 * outer2;
    f1 = odd_outer - f3 * outer2;
}

} // namespace

void FieldCubes::set(double error, double fourth)
{
    edge_ = 2.0 * std::sqrt(std::sqrt(192.0 * error / ((1.0 + lebesgue + lebesgue * lebesgue) * fourth)));
    per_edge_ = 1.0 / edge_;
    for (Cube &cube : cubes_) {
        cube.key.fill(std::numeric_limits<std::int64_t>::min());
    }
}

void FieldCubes::fill(Cube &cube, const std::function<Vector3d(const Vector3d &)> &exact) const
{
    constexpr double roots[4] = {-outer, -inner, inner, outer};
    double(&p)[4][4][4][4] = cube.powers;
    const auto place = [&](int i, std::size_t root) {
        return edge_ * (static_cast<double>(cube.key[i]) + 0.5 * (roots[root] + 1.0));
    };
    for (std::size_t i = 0; i < 64; i++) {
        const Vector3d value = exact({place(0, i / 16), place(1, i / 4 % 4), place(2, i % 4)});
        double *to = p[i / 16][i / 4 % 4][i % 4];
        to[3] = 0.0;
        Vector3d::Map(to) = value;
    }
    double *all = p[0][0][0];
    for (const std::size_t stride : {4, 16, 64}) {
        for (std::size_t i = 0; i < 256; i++) {
            if (i / stride % 4 == 0) {
                to_powers(all + i, stride);
            }
        }
    }
}

} // namespace fledge::world
