// SPDX-License-Identifier: Apache-2.0
// Commands to bytes, by a database.
#pragma once

#include "ground/database/numbers.h"

#include <map>

namespace fledge::ground {

/// A value that a user gives.
struct Given {
    enum class What : std::uint8_t { integer, real, text, bytes, list, members };
    What what = What::integer;
    Wide integer = 0; ///< a time is in nanoseconds; a boolean is 0 or 1
    double real = 0;
    std::string text; ///< or an enumerator; of a number or bytes: its digits, as databases write them
    std::vector<std::uint8_t> bytes;
    std::vector<Given> list;        ///< elements, or the values of members
    std::vector<std::string> names; ///< of members
};

/// Where an argument, or a parameter of the header, stands in a packet.
struct Placed {
    std::string name;
    bool argument;
    std::size_t bit, bits;
};

/// The packet of a command. `given` has values of its arguments, and of parameters that stand in its packet, as those
/// of headers. Missing ones are the initial values of the database. A calibrator of an argument makes the raw number of
/// the value in units. Throws Refusal: what is missing, not known, out of range or without room.
/// places: if given, what stands where, in the order of the entries.
std::vector<std::uint8_t> encode(const Database &database, Id command, const std::map<std::string, Given> &given,
                                 std::vector<Placed> *places = nullptr);

} // namespace fledge::ground
