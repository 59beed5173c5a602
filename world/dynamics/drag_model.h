// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/drag.h:
//
//   F = -1/2 density Cd A v |v|,   v = v_B - v_air(r_B),   A: the cross section, or of a facet A (n . v) / |v| if > 0
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
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;

private:
    const char *port() const override { return "air"; }
    void check() const override;
};

} // namespace fledge::world
