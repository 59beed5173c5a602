// SPDX-License-Identifier: Apache-2.0
// Finds the packets in a file that has them back to back.
//
// Example:
//
//     void list(std::span<const std::uint8_t> file)
//     {
//         for (const ground::Piece &piece : ground::packets_of_bytes(file, 0)) {
//             std::printf("%zu: %zu bytes %s\n", piece.at, piece.packet.size(), piece.problem.c_str());
//         }
//     }
#pragma once

#include "ground/capture/frames.h"

namespace fledge::ground {

/// Space packets and encapsulation packets, with `skip` bytes in front of each; zeros between them are padding.
///
/// Where the lengths lead from packet to packet to the end of the file, each is one, whatever part of a unit of data it
/// has: what lacks its other parts is a packet, too.
///
/// In other files, as packets have no check, those around it show whether a place has one. A packet *continues* an
/// earlier one if the first two bytes are equal and the earlier count is 1 to 256 less, or equal if the counts never
/// change or both are parts of a unit, and if its part may follow the earlier packet's part.
///
/// - While packets follow each other, all are read. But bytes that continue no earlier packet are no packet if a packet
///   that continues an earlier one begins inside of them or of the packet before. A part that continues none has a
///   note, and so has a packet in which packets that continue others begin.
/// - Behind bytes that are no packet, the next packet is the first that continues an earlier one or that one of the
///   next 64 continues, and behind which two more packets follow or the file ends. If there is none, it is a packet
///   that ends with the file, of an application that had packets before or in a file that had none. Other bytes are
///   skipped and counted.
/// - A packet before such bytes is dropped if the next packet begins inside of it, else it has a note that it may be
///   damaged. The same holds for up to four packets before them that continue none.
std::vector<Piece> packets_of_bytes(std::span<const std::uint8_t> bytes, std::size_t skip);

} // namespace fledge::ground
