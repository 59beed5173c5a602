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
struct Found {
    std::size_t at; ///< [bytes] of the frame that ends the packet, or is wrong
    std::vector<std::uint8_t> packet;
    std::string problem;
    std::string note;
};

/// How the frames stand in the file.
struct FrameFormat {
    std::size_t size;        ///< [bytes] of a frame
    std::size_t skip = 0;    ///< [bytes] in front of each, as a synchronisation marker
    std::size_t trailer = 0; ///< [bytes] behind each, which are passed over
    std::size_t code = 0;    ///< the depth of a Reed-Solomon code behind each; 0: there is none
    std::size_t insert = 0;  ///< [bytes] of the insert zone of AOS frames
    bool control = false;    ///< AOS frames have an operational control field; TM frames say so themselves
    bool randomized = false; ///< the frames and their code are
};

/// The packets of frames. Version, spacecraft, CRC and the header error control of AOS are those of the first 16
/// frames: what is there is found by its check. A frame that is wrong is passed over. The last one found is a note of
/// what the file had. Throws std::invalid_argument for sizes that cannot be.
std::vector<Found> packets_of_frames(std::span<const std::uint8_t> bytes, const FrameFormat &format);

} // namespace fledge::ground
