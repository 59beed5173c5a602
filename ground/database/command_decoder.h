// SPDX-License-Identifier: Apache-2.0
// Decodes packets of commands: the inverse of the encoder.
//
// The commands of a database become containers, their arguments become parameters, and the values that a command fixes
// become restrictions: assigned arguments, fixed values, and the constants of its header. So the decoder of telemetry
// finds the most derived command of a packet, and the values of its arguments.
//
// Assigned values with a calibrator and assigned bytes are not compared. A calibrator without an inverse leaves an
// argument uncalibrated. If an argument's size is not in the packet, the argument has the rest of the packet.
#pragma once

#include "ground/database/decoder.h"

#include <map>
#include <set>

namespace fledge::ground {

/// The fields that a sender sets in each packet; commands do not fix them.
enum class Header : std::uint8_t {
    none,
    ccsds, ///< the sequence and the length of a space packet
    cfs    ///< also the checksum in its eighth byte
};

class CommandDecoder {
public:
    /// Copies what it needs of the database.
    CommandDecoder(const Database &database, Header header);

    /// If the packet is a command, its container has the command's path. Bits beyond `Decoded::bits` belong to no
    /// argument.
    const Decoded &decode(std::span<const std::uint8_t> packet) { return decoder_.decode(packet, built_.root); }

    const Decoder &decoder() const { return decoder_; }
    const Database &database() const { return built_.database; }

    /// The role of a parameter of a packet in the command.
    enum class Role : std::uint8_t { header, assigned, given };
    Role role(const Decoded &packet, Id parameter) const;

    /// The argument that only has the size of this argument, and its value.
    std::optional<std::pair<std::string, double>> counter(const Decoded &packet, std::size_t field) const;

private:
    struct Counter {
        std::string name;
        double slope, intercept; ///< [bits] = slope value + intercept
    };
    struct Built {
        Database database;
        Id root = no_id;
        Id first_argument = no_id;
        std::map<Id, Counter> counters;               ///< of arguments
        std::map<Id, std::set<std::string>> assigned; ///< by containers of commands
    };
    class Builder;

    const Built built_;
    Decoder decoder_;
};

} // namespace fledge::ground
