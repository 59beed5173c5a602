// SPDX-License-Identifier: Apache-2.0
// The law JB2008 of Bowman, Tobiska and others: Jacchia's air of 1970 with the temperature of the exosphere from four
// indices of the Sun and from the storms' Dst, and with a semiannual variation by the Sun.
// Source: Bowman et al. 2008, with the coefficients of the authors' published program.
#pragma once

#include "world/environment/air/air.h"

namespace fledge::world {

/// Uses all of the place but latitude and longitude. F107_average is the mean of F10_jb. From 90 to 4000 km; below, all
/// is as at 90 km. The semiannual variation ends at 2000 km by a step, as the law has it; densities of species are
/// scaled as their sum is.
AirComposition jb2008(const AirPlace &place, const SolarActivity &activity);

} // namespace fledge::world
