// SPDX-License-Identifier: Apache-2.0
// JPL's planetary ephemeris DE405, from the Debian package casacore-data-jpl-de405.
//
// The package holds it as a casacore table. Of its files two are read:
//
//   table.dat   the description, big-endian: number of rows, byte order of the other files, and
//               records of keywords: MJD0 and dMJD [d], EMRAT, ..., and the layout of a row,
//               13 x 3 integers: where a body's coefficients begin, how many there are per
//               component, into how many intervals a row is divided for it
//   table.f0i   16 bytes, then a row per dMJD days from MJD0 + dMJD on: 12 bytes (1, number of
//               dimensions, length), coefficients as doubles [km], filled up to 16 bytes
//
// In JPL's own files two dates precede the coefficients of a row, and the layout counts them, from
// 1. Columns are Mercury to Pluto with the Earth-Moon barycentre third, relative to the solar
// system's barycentre; the Moon relative to the Earth; the Sun; nutations, not read; librations [rad].
// Source: the casacore Table Data System, file format; JPL, DE405.
#pragma once

#include "world/environment/spk.h"

namespace fledge::world {

/// Bodies: 1 to 10 relative to 0, 301 and 399 relative to 3. Throws SetupError if it is not there,
/// naming the package, or damaged.
SegmentFile read_de405(const std::string &folder = Ephemeris::de405_folder);

} // namespace fledge::world
