// SPDX-License-Identifier: Apache-2.0
// Units of bytes (packets, frames) in a message: what a link carries from one instant of flight to the next. The
// message has room for `bytes` of them, of each its time [ns] (64 bits), its length (32 bits), both big-endian, and its
// bytes.
#pragma once

#include "cosim/protocol/protocol.h"
#include "sim/carrier.h"

#include <optional>

namespace fledge::cosim {

inline constexpr std::size_t unit_header = 12;

/// The definition of a message with so much room [byte].
Schema units_schema(std::size_t room);

/// Such a message from this program to others.
class UnitsOut {
public:
    /// Another node asks for it, or none does; every: the time between the instants at which it may be written.
    Publication open(std::uint32_t channel, std::size_t room, Ns every);
    void close() { channel_.reset(); }
    explicit operator bool() const { return channel_.has_value(); }

    /// Write the first of the units that a message has room for at t, if there are any, and forget them; what is left
    /// may go at the next instant. Throws sim::RunError if one alone has no room.
    void write(Ns t, std::vector<sim::Packet> &units, std::vector<Record> &records);

private:
    std::optional<std::uint32_t> channel_;
    std::size_t room_ = 0;
    Ns every_ = 0;
    std::uint32_t count_ = 0;
};

/// The units of a message. Throws ProtocolError.
std::vector<sim::Packet> units_of(std::span<const std::byte> payload);

// As bytes, for snapshots.
Bytes packed(std::span<const sim::Packet> units);
std::vector<sim::Packet> unpacked(std::span<const std::byte> bytes); ///< throws ProtocolError

} // namespace fledge::cosim
