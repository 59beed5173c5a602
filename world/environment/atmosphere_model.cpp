// SPDX-License-Identifier: Apache-2.0
#include "world/environment/atmosphere_model.h"

#include "flight/math/elementary.h"
#include "sim/text.h"
#include "world/constants.h"

#include <algorithm>

namespace fledge::world {

namespace {

} // namespace

void AtmosphereModel::refresh()
{
    EnvironmentModel::refresh();
    const auto &par = interface_.par;
    standard_ = nullptr;
    if (par.law != ATMOSPHERE_STANDARD_1976 && par.density == 0.0) {
        refuse(".density must be > 0 kg/m^3, but for the law STANDARD_1976; found 0 kg/m^3");
    }
    switch (par.law) {
    case ATMOSPHERE_CONSTANT: break;
    case ATMOSPHERE_EXPONENTIAL:
        if (!(par.scale_height >= 1.0)) {
            refuse(".scale_height must be >= 1 m for the exponential law; found " +
                   sim::format_number(par.scale_height) + " m");
        }
        break;
    case ATMOSPHERE_STANDARD_1976:
        if (par.density != 0.0) {
            refuse(".density: the standard atmosphere has its own; found " + sim::format_number(par.density) +
                   " kg/m^3 besides");
        }
        standard_ = &StandardAtmosphere::get();
        break;
    }
}

AirSource::State AtmosphereModel::air(const Place &place) const
{
    const auto &par = interface_.par;
    State state;
    if (standard_) {
        const Air air = standard_->at(place.altitude);
        state.density = air.density;
        state.temperature = air.temperature;
        state.molar_mass = air.density * gas_constant * air.temperature / air.pressure;
    } else if (par.law == ATMOSPHERE_CONSTANT) {
        state.density = par.density;
    } else {
        // Where it would be thicker than anything the craft is inside the body, and its run ends.
        state.density = par.density * fm_exp(std::min((par.base - place.altitude) / par.scale_height, 100.0));
    }
    return state;
}

} // namespace fledge::world
