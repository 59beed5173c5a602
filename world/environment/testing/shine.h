// SPDX-License-Identifier: Apache-2.0
// A planet at the origin that shines, and the Sun in x.
#pragma once

#include "world/environment/planet_radiation_model.h"

namespace fledge::world::testing {

struct Shine {
    static constexpr double R = 6.4e6, AU = 149597870700.0, E = 1361.0;

    Sunlight light_interface{};
    SunlightModel light{light_interface};
    PlanetRadiation i{};
    PlanetRadiationModel model{i};

    Shine()
    {
        GravityBody planet{.name = "PLANET", .mu = 4e14, .radius = R};
        GravityBody sun = planet;
        sun.name = "SUN";
        sun.radius = 6.957e8;
        sun.r_PN_N = {AU, 0, 0};
        light.set_body(sun);
        light.add_body(planet);
        model.set_body(planet);
        model.set_source(light);
    }
    void prepare()
    {
        light.prepare({"world.light", 1, nullptr});
        model.prepare({"world.shine", 1, nullptr});
        model.reset(0);
    }
};

} // namespace fledge::world::testing
