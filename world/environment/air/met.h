// SPDX-License-Identifier: Apache-2.0
// The Marshall Engineering Thermosphere: Jacchia's air of 1970 with the temperature of the exosphere by F10.7 and ap, a
// semiannual variation of it, and two variations with season and latitude of Jacchia's air of 1971.
// Source: Hickey 1988, in the version of NASA's JEOD, by whose published runs it is tested.
//
// Example:
//
//     using namespace world;
//     AirPlace place;
//     place.altitude = 400e3;
//     place.mjd = 61041.5;
//     SolarActivity sun;
//     sun.ap_before = 15.0;
//     const AirComposition air = met(place, sun); // air.density in kg/m^3
#pragma once

#include "world/environment/air/air.h"

namespace fledge::world {

/// Uses altitude, latitude, longitude, mjd and day_of_year of the place; the Sun by its own formula of the date.
/// F107_average is the mean of 162 days, as the law was made for. From 90 to 2500 km; below, all is as at 90 km. No
/// hydrogen below 500 km. What the season changes below 170 km is the density alone, not the species.
AirComposition met(const AirPlace &place, const SolarActivity &activity);

} // namespace fledge::world
