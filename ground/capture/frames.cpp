// SPDX-License-Identifier: Apache-2.0
#include "ground/capture/frames.h"

#include "ccsds/tm_frame.h"

#include <array>

namespace fledge::ground {

namespace {

/// A virtual channel, whose packets become pieces of the file.
struct Virtual {
    std::vector<Found> *found;
    std::size_t at = 0;
    std::vector<std::uint8_t> memory = std::vector<std::uint8_t>(SPACE_PACKET_MAX);
    TmReceiver receiver{};
};

const char *what(CcsdsFault fault)
{
    switch (fault) {
    case CCSDS_VERSION: return "another version of the protocol";
    case CCSDS_SPACECRAFT: return "of another spacecraft";
    case CCSDS_CRC: return "its CRC does not hold";
    default: return "its header does not hold";
    }
}

} // namespace

std::vector<Found> packets_of_frames(std::span<const std::uint8_t> bytes, std::size_t size, std::size_t skip)
{
    std::vector<Found> found;
    if (size <= TM_FRAME_HEADER + TM_CONTROL + TM_CHECK || size > TM_FRAME_MAX) {
        found.push_back({0, {}, "a frame has 13 to " + std::to_string(TM_FRAME_MAX) + " bytes"});
        return found;
    }
    std::array<Virtual, TM_CHANNELS> channels;
    for (Virtual &one : channels) {
        one.found = &found;
        const auto keep = [](void *user, const std::uint8_t *packet, std::size_t n) {
            const Virtual &self = *static_cast<Virtual *>(user);
            self.found->push_back({self.at, {packet, packet + n}, ""});
        };
        tm_receiver_begin(&one.receiver, 256, one.memory.data(), one.memory.size(), keep, &one);
    }
    TmChannel channel{};
    std::size_t at = skip;
    for (; at + size <= bytes.size(); at += skip + size) {
        const std::uint8_t *const frame = &bytes[at];
        TmFrame read{};
        if (at == skip) { // what the first frame says holds for all
            channel = {static_cast<std::uint16_t>((frame[0] << 8 | frame[1]) >> 4 & 0x3FF),
                       static_cast<std::uint16_t>(size), static_cast<std::uint8_t>(frame[1] & 1), 1};
            channel.check = tm_frame_read(&channel, frame, size, &read) != CCSDS_CRC;
        }
        const CcsdsFault fault = tm_frame_read(&channel, frame, size, &read);
        if (fault != CCSDS_OK) {
            found.push_back({at, {}, std::string("a frame is passed over: ") + what(fault)});
            continue;
        }
        Virtual &one = channels[read.virtual_channel];
        const std::uint32_t before = one.receiver.missing;
        one.at = at;
        tm_receive(&one.receiver, &read);
        if (one.receiver.missing != before) {
            found.push_back({at,
                             {},
                             std::to_string(one.receiver.missing - before) + " frames of virtual channel " +
                                 std::to_string(read.virtual_channel) + " are missing in front of this one"});
        }
    }
    if (at < bytes.size() + skip) {
        found.push_back({at - skip, {}, "the file ends within a frame"});
    }
    return found;
}

} // namespace fledge::ground
