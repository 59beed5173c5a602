// SPDX-License-Identifier: Apache-2.0
// The packets in a file of telemetry frames, of TM (CCSDS 132.0-B-3) or AOS (732.0-B-4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace fledge::ground {

/// A packet, what is wrong with a frame, or a note.
struct Piece {
    std::size_t at; ///< [bytes] place of the frame that ends the packet, or is wrong
    std::vector<std::uint8_t> packet;
    std::string problem;
    std::string note;
};

/// How the frames stand in the file.
struct FrameFormat {
    std::size_t size;        ///< [bytes] of a frame
    std::size_t skip = 0;    ///< [bytes] before each, as a synchronisation marker
    std::size_t trailer = 0; ///< [bytes] to skip behind each
    std::size_t code = 0;    ///< the depth of the Reed-Solomon code behind each; 0: none
    std::size_t insert = 0;  ///< [bytes] of the insert zone of AOS frames
    bool control = false;    ///< AOS frames have an operational control field; TM frames have a flag for it
    bool randomized = false; ///< the frames and their code are randomized
};

/// The packets of frames. The first 16 frames show the version, the spacecraft, and whether frames have a CRC and AOS
/// frames a header error control. Wrong frames are skipped. The last piece is a note with a summary of the file. Throws
/// std::invalid_argument for impossible sizes.
std::vector<Piece> packets_of_frames(std::span<const std::uint8_t> bytes, const FrameFormat &format);

} // namespace fledge::ground
