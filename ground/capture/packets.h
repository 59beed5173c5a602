// SPDX-License-Identifier: Apache-2.0
// The packets in a file that has them one behind the other.
//
// Example:
//
//     void list(std::span<const std::uint8_t> file)
//     {
//         for (const ground::Found &found : ground::packets_of_bytes(file, 0)) {
//             std::printf("%zu: %zu bytes %s\n", found.at, found.packet.size(), found.problem.c_str());
//         }
//     }
#pragma once

#include "ground/capture/frames.h"

namespace fledge::ground {

/// Space packets and encapsulation packets, with `skip` bytes in front of each; zeros between them are padding.
///
/// Packets have no check, so a place is taken for a packet's by what stands around it. A packet *continues* one whose
/// first two bytes are the same and whose count is 1 to 256 less, or the same if the counts never change; its part of
/// a longer unit is one that may come.
///
/// - As long as one packet follows another, all are taken. But one that continues none before it is none if one that
///   does begins inside of it, or of the packet in front. A part that continues none has a note, and so has a packet
///   in which others do.
/// - Behind bytes that are no packet, the next one is the first that continues another, or that one of the next 64
///   continues, and behind which two more follow or the file ends. If there is none, it is one that ends with the
///   file, of an application that was there before or in a file without any. All else is passed over, and counted.
/// - A packet in front of such bytes is dropped if the next one begins inside of it, else it has a note that it may
///   be damaged. So have up to four that continue none.
std::vector<Found> packets_of_bytes(std::span<const std::uint8_t> bytes, std::size_t skip);

} // namespace fledge::ground
