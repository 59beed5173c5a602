// SPDX-License-Identifier: Apache-2.0
// NRLMSISE-00: the neutral air from the ground to the exosphere.
//
// Above 123 km a temperature profile of Bates, below it cubic splines of 1/T over geopotential height; each species is
// in diffusive equilibrium at the temperature there, mixed below its turbopause, and corrected for chemistry.
// Temperatures and densities at the boundaries are expansions in Legendre functions of latitude, local time, season,
// longitude, time of day, the flux of the Sun and the magnetic activity. Below 62.5 km the air is mixed; below 0 km all
// is as at 0 km.
//
// The density is the effective one for drag, with anomalous oxygen: GTD7D of NRL's package. GTD7 leaves it out, and has
// less by 16 times 1.66e-27 kg, the model's unit of mass, times species.anomalous_O.
//
// The model has small jumps, and so has this: in density up to 1.1 % at 72.5 km and 0.9 % at 123.435 km, where
// variations of the temperature end, 0.3 % at 160 km, 0.05 % at 300 km, where the mixing of a species ends; and at
// midnight UTC, since it counts whole days.
//
// Where ap is 200 and more, the published splines of 1/T may cross 0 between 90 and 123 km near the poles, and give no
// density; here the temperature ends at 5000 K.
//
// Source: Picone et al. 2002; coefficients and test values of NRL's package (docs/references.md).
#pragma once

#include "world/environment/air/air.h"

namespace fledge::world {

/// Uses altitude, latitude, longitude, hour_angle, day_of_year and seconds_of_day of the place, and F107, F107_average,
/// ap and history of the activity. Local time is the true Sun's; the mean Sun's differs by up to 16 min.
AirComposition nrlmsise00(const AirPlace &place, const SolarActivity &activity);

} // namespace fledge::world
