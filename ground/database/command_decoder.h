// SPDX-License-Identifier: Apache-2.0
// Packets of commands back to what they command: the inverse of the encoder.
//
// The commands of a database become containers, their arguments parameters, and what a command fixes restrictions: the
// arguments that it assigns, its fixed values, and the constants of its header. So the decoder of telemetry finds the
// most derived command that a packet is, and the values of its arguments.
//
// What is not compared: assigned values that a calibrator makes, and assigned bytes. A calibrator without an inverse
// leaves an argument uncalibrated. An argument's size that stands nowhere in the packet is what the packet has left.
#pragma once

#include "ground/database/decoder.h"

#include <map>
#include <set>

namespace fledge::ground {

/// What a sender sets in each packet, which therefore no command fixes.
enum class Header : std::uint8_t {
    none,
    ccsds, ///< the sequence and the length of a space packet
    cfs    ///< also the checksum in its eighth byte
};

class CommandDecoder {
public:
    /// Takes a copy of what it needs of the database.
    CommandDecoder(const Database &database, Header header);

    /// The container of a packet that is a command has the command's path. `bits` of the packet beyond the last entry
    /// belong to no argument.
    const Decoded &decode(std::span<const std::uint8_t> packet) { return decoder_.decode(packet, built_.root); }

    const Decoder &decoder() const { return decoder_; }
    const Database &database() const { return built_.database; }

    /// What a field is of the command that was decoded.
    enum class Role : std::uint8_t { header, assigned, given };
    Role role(const Decoded &packet, std::size_t field) const;

    /// The argument that only says the size of this one, and its value.
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
