// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/drag.h:
//
//   F = -1/2 density Cd A v |v|,   v = v_B - v_air(r_B),   A: the cross section, or of a facet A (n . v) / |v| if > 0
#pragma once

#include "world/dynamics/drag.h"
#include "world/dynamics/surface.h"
#include "world/environment/atmosphere_model.h"

namespace fledge::world {

class DragModel final : public Surface<Drag, AtmosphereModel, DRAG_FACETS_MAX> {
public:
    using Surface::Surface;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;

private:
    const char *port() const override { return "air"; }
    void check() const override;
};

} // namespace fledge::world
