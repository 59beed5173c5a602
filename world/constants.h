// SPDX-License-Identifier: Apache-2.0
// Physical constants that several models need: exact, by the definition of the SI.
#pragma once

namespace fledge::world {

inline constexpr double speed_of_light = 299792458.0;    // [m/s]
inline constexpr double boltzmann = 1.380649e-23;        // [J/K]
inline constexpr double gas_constant = 8.31446261815324; // [J/(mol K)]
inline constexpr double day_s = 86'400.0;                // [s]

} // namespace fledge::world
