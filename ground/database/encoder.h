// SPDX-License-Identifier: Apache-2.0
// Encodes commands by a database.
#pragma once

#include "ground/database/numbers.h"

#include <map>

namespace fledge::ground {

/// A value from the user.
struct Given {
    enum class Kind : std::uint8_t { integer, real, text, bytes, list, members };
    Kind kind = Kind::integer;
    Wide integer = 0; ///< a time is [ns] since 1970 UTC, a duration [ns]; a boolean is 0 or 1
    double real = 0;
    std::string text; ///< a text, an enumerator, a date or a duration (times.h); for a number or bytes its digits
    std::vector<std::uint8_t> bytes;
    std::vector<Given> list;        ///< elements, or the values of members
    std::vector<std::string> names; ///< of members
    bool of_database = false;       ///< a text that the database has: a time without a unit is in seconds
};

/// The place of an argument or of a parameter of the header in a packet.
struct Placed {
    std::string name;
    bool argument;
    std::size_t bit, bits;
};

/// The packet of a command. `given` has values of its arguments and of parameters in its packet, as of headers; missing
/// values are the initial values of the database. An argument's calibrator converts the value in units to the raw
/// number. Throws Refusal if a value is missing, not known, out of range or too long. places: not nullptr: receives the
/// place of each entry, in their order.
std::vector<std::uint8_t> encode(const Database &database, Id command, const std::map<std::string, Given> &given,
                                 std::vector<Placed> *places = nullptr);

} // namespace fledge::ground
