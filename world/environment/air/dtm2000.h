// SPDX-License-Identifier: Apache-2.0
// The law DTM2000, the Drag Temperature Model of CNES: a temperature profile of Bates above 120 km, each species in
// diffusive equilibrium in it, and expansions in Legendre functions, local time, season, flux and Kp of the exosphere's
// temperature, of the temperature and its slope at 120 km and of the densities there.
// Source: Bruinsma, Thuillier and Barlier 2003, with CNES's coefficients.
#pragma once

#include "world/environment/air/air.h"

namespace fledge::world {

/// From 120 km on; below, all is as at 120 km. Uses altitude, latitude, longitude, hour_angle and day_of_year of the
/// place; the law counts whole days. No argon, no atomic nitrogen.
AirComposition dtm2000(const AirPlace &place, const SolarActivity &activity);

} // namespace fledge::world
