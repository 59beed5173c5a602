// SPDX-License-Identifier: Apache-2.0
// The behaviour behind world/dynamics/solar_pressure.h. With the irradiance E, the speed of light c and the unit vector
// s towards the Sun, a sphere feels F = -E / c Cr A s, and a lit facet, n . s > 0,
//
//   F = -E / c A (n . s) [ (1 - specular) s + 2 (specular (n . s) + diffuse / 3) n ]
//
// and likewise by the light of each element of a planet, in infrared with shares of its own.
#pragma once

#include "world/dynamics/solar_pressure.h"
#include "world/dynamics/surface.h"
#include "world/environment/planet_radiation_model.h"
#include "world/environment/sunlight_model.h"

namespace fledge::world {

class SolarPressureModel final : public Surface<SolarPressure, SunlightModel, SOLAR_FACETS_MAX> {
public:
    using Surface::Surface;
    std::vector<Further> further() override
    {
        std::vector<Further> all = Surface::further();
        all.push_back({"radiation", &radiation_});
        return all;
    }
    void refresh() override;
    void start(const Vec3 &omega, double *x) override;
    bool latch(const double *x, const BodyRate &rate, double dt) override;
    void copy_setup(const sim::Model &original,
                    const std::function<sim::Model *(const sim::Model *)> &counterpart) override;
    void derive(const double *x, const Motion &motion, double *dx, Loads &loads) const override;

private:
    const char *port() const override { return "light"; }
    void check() const override;

    /// Adds the push of light from the direction s_B: visible and infrared irradiance [W/m^2].
    void shine(const Vec3 &s_B, double visible, double infrared, const Motion &motion, Loads &loads) const;

    SourceOf<PlanetRadiationModel> radiation_; ///< optional
};

} // namespace fledge::world
