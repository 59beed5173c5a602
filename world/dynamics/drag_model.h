// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/drag.h:
//
//   F = -1/2 density Cd A v |v|,   v = v_B - v_air(r_B),   A: the cross section, or of a facet A (n . v) / |v| if > 0
//
// In free molecular flow, with the most probable speed c = sqrt(2 R T / M) of the molecules and s = n . v / c,
//
//   F = -A [flux v + (density c^2 (1 + erf s) / 4 + flux w) n]
//   flux = density c (e^(-s^2) / sqrt(pi) + s (1 + erf s)) / 2
//
// flux w is the recoil of the molecules that leave, of which each has 2 k T_r: half a Maxwell distribution, of
// w^2 = pi / 2 R T_r / M. Accommodation puts 2 k T_r between what they brought, m v^2 / 2 + 2 k T, and 2 k T_wall.
#pragma once

#include "world/dynamics/drag.h"
#include "world/dynamics/surface.h"
#include "world/environment/air_source.h"

namespace fledge::world {

class DragModel final : public Surface<Drag, AirSource, DRAG_FACETS_MAX> {
public:
    using Surface::Surface;
    std::string source_text() const override
    {
        return "a model of air: world.Atmosphere(...), or a prototype with a method air_at(self, t, r_BN_N)";
    }
    void start(const Vec3 &omega, double *x) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;

private:
    const char *port() const override { return "air"; }
    void check() const override;
    void push_freely(const AirSource::State &air, const Vec3 &v_B, const Motion &motion, Loads &loads) const;
};

} // namespace fledge::world
