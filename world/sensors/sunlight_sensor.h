// SPDX-License-Identifier: Apache-2.0
// What sun sensors share: they see the Sun, and the sunlight that a planet reflects.
#pragma once

#include "world/environment/planet_radiation_model.h"
#include "world/sensors/sensor.h"

namespace fledge::world {

template <class Interface, std::size_t channels>
class SunlightSensor : public PlanetViewer<LimitedSensor<Interface, channels>> {
public:
    using PlanetViewer<LimitedSensor<Interface, channels>>::PlanetViewer;

    void reset(sim::Ns t) override
    {
        this->check_source(this->name_);
        LimitedSensor<Interface, channels>::reset(t);
    }

protected:
    void check() const override
    {
        LimitedSensor<Interface, channels>::check();
        if (!this->has_sun()) {
            throw sim::SetupError(this->name_ + " has no Sun: wire its input sun or light, or give it s_N");
        }
    }
};

} // namespace fledge::world
