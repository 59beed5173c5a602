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

/// Read files, which may refer to each other. Throws Refusal with a line "file:line: reason" for each fault: unknown,
/// missing or repeated elements, loops, and sizes that no packet can have. lenient: items with a fault, and items that
/// refer to them, are left out and listed in the database's `left_out`. Elements of XTCE that Fledge does not compute
/// (algorithms, streams, services) are in its notes.
Database read_xtce(const std::vector<XtceFile> &files, bool lenient = false);

/// Read a text; its name is for messages.
Database read_xtce_text(std::string text, const std::string &name, bool lenient = false);

} // namespace fledge::ground
