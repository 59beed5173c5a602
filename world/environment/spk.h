// SPDX-License-Identifier: Apache-2.0
// SPICE SPK kernels (.bsp): the ephemerides of JPL and of missions.
//
// The container, DAF, is a file of 1024-byte records of 8-byte words, counted from 1:
//
//   record 1        "DAF/SPK ", ND = 2, NI = 6, ..., FWARD: the first summary record, ...,
//                   "LTL-IEEE" or "BIG-IEEE", and a string that shows damage by text-mode transfer
//   summary record  NEXT, PREVIOUS, NSUM as doubles, then NSUM summaries of ND doubles and NI
//                   integers: from, to, target, centre, frame, type, first word, last word
//
// A segment of type 2 (position) or 3 (position and velocity) is a sequence of records as in
// EphemerisSegment, then START, LENGTH, words per record, number of records. Others, see spk_types.h, are
// records, then
//
//   5             epochs, directory, gravitational parameter [km^3/s^2], number of records
//   8, 12         START, STEP, degree of 8 or window - 1 of 12, number
//   9, 13         epochs, directory, the same, number
//   18            epochs, directory, subtype, window, number
//   1, 21         last epochs, directory, of 21 the size of the tables, number
//
// where the directory has each hundredth epoch.
// Sources: NAIF, "DAF", "SPK" and "Frames Required Reading".
#pragma once

#include "world/environment/ephemeris.h"

namespace fledge::world {

struct SegmentFile {
    std::vector<EphemerisSegment> segments; ///< in the order of the file
    std::shared_ptr<const void> memory;     ///< where their records lie
    std::shared_ptr<const Librations> librations;
};

/// A kernel in this machine's byte order is mapped, so that only what is used occupies memory;
/// another is read and turned. Throws SetupError that names what is damaged, or which type of
/// segment, frame or file is not read.
SegmentFile read_spk(const std::string &path);

} // namespace fledge::world
