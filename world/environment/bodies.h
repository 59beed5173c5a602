// SPDX-License-Identifier: Apache-2.0
// The bodies of the solar system by their NAIF numbers: names, gravitational parameters, radii.
//
// 0 is the barycentre of the solar system, 1 to 9 are those of the planets' systems, 10 is the Sun,
// 199 to 999 are the planets themselves, 301 is the Moon.
#pragma once

#include <string>
#include <string_view>

namespace fledge::world {

/// "MARS (499)"; of a body without a name here, its number.
std::string body_name(int id);

/// The number of a name ("Mars", "EARTH MOON BARYCENTER", "jupiter_barycenter", "EMB") or of the
/// text of a number. Case does not matter, and blanks and underscores are the same. Throws
/// SetupError that lists the names.
int body_id(std::string_view name);

/// [m^3/s^2] Values of JPL's DE431: the Sun, the planets and the Moon, and the systems with their
/// moons. Throws SetupError that lists the bodies.
double body_mu(int id);

struct BodyRadii {
    double equatorial = 0.0; ///< [m] mean of the two equatorial radii
    double polar = 0.0;      ///< [m]
};

/// The Sun, the planets and the Moon, of the IAU's report of 2000. Throws SetupError that lists
/// the bodies.
BodyRadii body_radii(int id);

} // namespace fledge::world
