// SPDX-License-Identifier: Apache-2.0
// Databases of spacecraft in XTCE (XML Telemetric and Command Exchange, OMG 1.0 to 1.2).
//
// Example:
//
//     #include "ground/database/decoder.h"
//     #include "ground/database/encoder.h"
//     using namespace ground;
//     void decode_and_encode(std::span<const std::uint8_t> packet)
//     {
//         const Database database = read_xtce({{"spacecraft.xml", ""}}); // throws Refusal
//         Decoder decoder(database);
//         const Decoded &decoded = decoder.decode(packet);
//         for (std::size_t i = 0; i < decoded.fields.size(); i++) {
//             std::printf("%s: %lx\n", decoder.name(decoded, i).c_str(), decoded.values[i]);
//         }
//         const auto command = encode(database, database.command("NOOP"), {});
//     }
#pragma once

#include "ground/database/model.h"

namespace fledge::ground {

/// A file, and the path of the space system in which its own one stands: "" for the top.
struct XtceFile {
    std::string name;
    std::string under;
};

/// Read files, which may refer to one another. Throws Refusal with a line for each fault, which has the file, the line
/// and the reason: what XTCE does not know, what is missing, repeated or a loop, and what no packet can have. lenient:
/// what has a fault, and what refers to it, is left out, and in `left_out` of the database. What XTCE knows and Fledge
/// does not compute (algorithms, streams, services) is in its notes.
Database read_xtce(const std::vector<XtceFile> &files, bool lenient = false);

/// The same of a text, whose name is for messages.
Database read_xtce_text(std::string text, const std::string &name, bool lenient = false);

/// A constant of a comparison.
Literal literal_of(const std::string &text);

} // namespace fledge::ground
