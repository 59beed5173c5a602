// SPDX-License-Identifier: Apache-2.0
// The packets in a file of telemetry frames.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace fledge::ground {

/// A packet, or what is wrong with a frame.
struct Found {
    std::size_t at; ///< [bytes] of the frame that ends the packet, or is wrong
    std::vector<std::uint8_t> packet;
    std::string problem;
};

/// The packets of TM frames (CCSDS 132.0-B-3) of `size` bytes each, with `skip` bytes in front of each frame, as a
/// synchronisation marker. Frames end with a CRC if that of the first one holds. Frames are of the first one's
/// spacecraft; a frame that is wrong is passed over.
std::vector<Found> packets_of_frames(std::span<const std::uint8_t> bytes, std::size_t size, std::size_t skip);

} // namespace fledge::ground
