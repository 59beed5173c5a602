// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/solar_pressure.h. With the irradiance E, the speed of light c and the unit vector
// s towards the Sun, a sphere feels F = -E / c Cr A s, and a lit facet, n . s > 0,
//
//   F = -E / c A (n . s) [ (1 - specular) s + 2 (specular (n . s) + diffuse / 3) n ]
#pragma once

#include "world/dynamics/solar_pressure.h"
#include "world/dynamics/surface.h"
#include "world/environment/sunlight_model.h"

namespace fledge::world {

class SolarPressureModel final : public Surface<SolarPressure, SunlightModel, SOLAR_FACETS_MAX> {
public:
    using Surface::Surface;
    void refresh() override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;

private:
    const char *port() const override { return "light"; }
    void check() const override;
};

} // namespace fledge::world
