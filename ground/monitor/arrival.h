// SPDX-License-Identifier: Apache-2.0
// A packet from a spacecraft, and the interface of what stores packets.
#pragma once

#include "ground/database/model.h"

#include <cstdint>
#include <span>

namespace fledge::ground {

struct Arrival {
    std::int64_t t;        ///< [ns] of the spacecraft's clock
    std::int64_t received; ///< [ns] UTC since 1970
    std::span<const std::uint8_t> bytes;
};

/// Stores packets, as the archive does. Both functions throw Refusal on failure.
class PacketSink {
public:
    PacketSink() = default;
    PacketSink(const PacketSink &) = delete;
    PacketSink &operator=(const PacketSink &) = delete;
    virtual ~PacketSink() = default;

    /// container: no_id if the packet was not decoded.
    virtual void put(const Arrival &arrival, Id container) = 0;

    /// End a batch: its packets survive the end of the program.
    virtual void save() = 0;
};

} // namespace fledge::ground
