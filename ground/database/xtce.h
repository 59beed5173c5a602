// SPDX-License-Identifier: Apache-2.0
// Databases of spacecraft in XTCE (XML Telemetric and Command Exchange, OMG 1.0 to 1.2).
#pragma once

#include "ground/database/model.h"

namespace fledge::ground {

/// A file, and the path of the space system in which its own one stands: "" for the top.
struct XtceFile {
    std::string name;
    std::string under;
};

/// Read files, which may refer to one another. Throws Refusal with the file, the line and the reason: what XTCE does
/// not know, what is missing, repeated or a loop, and what no packet can have. What XTCE knows and Fledge does not
/// compute (algorithms, streams, services) is in the notes of the database.
Database read_xtce(const std::vector<XtceFile> &files);

/// The same of a text, whose name is for messages.
Database read_xtce_text(std::string text, const std::string &name);

/// A constant of a comparison.
Literal literal_of(const std::string &text);

} // namespace fledge::ground
