// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of the database: short files, and values as text.
#pragma once

#include "ground/database/decoder.h"
#include "ground/database/xtce.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace fledge::ground::testing {

using Bytes = std::vector<std::uint8_t>;

/// The path of a file of real data: in FLEDGE_TEST_DATA, or ../shared/data of the repository.
inline std::string real_file(const std::string &name)
{
    const char *folder = std::getenv("FLEDGE_TEST_DATA");
    return (folder != nullptr ? folder : FLEDGE_ROOT "/../shared/data") + ("/" + name);
}

/// A database with these types, these parameters ("name:type ...") and these containers.
inline std::string file(const std::string &types, const std::string &parameters, const std::string &containers)
{
    std::string all = "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>\n" + types +
                      "\n</ParameterTypeSet><ParameterSet>\n";
    for (std::size_t at = 0, colon; (colon = parameters.find(':', at)) != std::string::npos;) {
        const std::size_t end = std::min(parameters.find(' ', colon), parameters.size());
        all += "<Parameter name='" + parameters.substr(at, colon - at) + "' parameterTypeRef='" +
               parameters.substr(colon + 1, end - colon - 1) + "'/>\n";
        at = std::min(end + 1, parameters.size());
    }
    return all + "</ParameterSet><ContainerSet>\n" + containers + "\n</ContainerSet></TelemetryMetaData></SpaceSystem>";
}

inline std::string integer(const std::string &name, int bits, const std::string &attributes = "",
                           const std::string &inside = "")
{
    return "<IntegerParameterType name='" + name + "'><IntegerDataEncoding sizeInBits='" + std::to_string(bits) + "' " +
           attributes + ">" + inside + "</IntegerDataEncoding></IntegerParameterType>";
}

/// A container with entries of parameters ("a b c"), or with entries in XML.
inline std::string container(const std::string &name, const std::string &entries, const std::string &more = "",
                             const std::string &attributes = "")
{
    std::string list = entries;
    if (entries.find('<') == std::string::npos) {
        list.clear();
        for (std::size_t at = 0; at < entries.size();) {
            const std::size_t end = std::min(entries.find(' ', at), entries.size());
            list += "<ParameterRefEntry parameterRef='" + entries.substr(at, end - at) + "'/>";
            at = end + 1;
        }
    }
    return "<SequenceContainer name='" + name + "' " + attributes + "><EntryList>" + list + "</EntryList>" + more +
           "</SequenceContainer>";
}

inline std::string extends(const std::string &base, const std::string &parameter, const std::string &value)
{
    return "<BaseContainer containerRef='" + base + "'><RestrictionCriteria><Comparison parameterRef='" + parameter +
           "' value='" + value + "'/></RestrictionCriteria></BaseContainer>";
}

/// "name=value ...", or the reason.
inline std::string text(const Database &database, const Decoder &decoder, const Decoded &packet)
{
    std::string all;
    for (std::size_t i = 0; i < packet.fields.size(); i++) {
        const Field &field = packet.fields[i];
        const std::uint64_t word = packet.values[i];
        const auto *bytes = packet.bytes.data() + (word >> 32);
        char number[40] = "?";
        all += (i > 0 ? " " : "") + decoder.name(packet, i) + "=";
        if (packet.status[i] == Status::uncalibrated || packet.status[i] == Status::malformed) {
            all += packet.status[i] == Status::malformed ? "malformed" : "none";
            continue;
        }
        switch (field.value) {
        case Kind::natural: all += std::to_string(word); break;
        case Kind::integer:
        case Kind::time:
        case Kind::duration: all += std::to_string(static_cast<std::int64_t>(word)); break;
        case Kind::real:
            std::snprintf(number, sizeof number, "%.17g", std::bit_cast<double>(word)), all += number;
            break;
        case Kind::boolean: all += word ? "true" : "false"; break;
        case Kind::label: all += word == no_id ? "?" : database.types[field.type].enumerators[word].label; break;
        case Kind::text: all.append(reinterpret_cast<const char *>(bytes), word & 0xFFFFFFFF); break;
        case Kind::binary:
            for (std::size_t j = 0; j < (word & 0xFFFFFFFF); j++) {
                std::snprintf(number, sizeof number, "%02x", bytes[j]), all += number;
            }
            break;
        case Kind::none: all += "none"; break;
        }
    }
    return all + (packet.reason.empty() ? "" : (all.empty() ? "" : " ") + ("(" + packet.reason + ")"));
}

/// Decode a packet by plans and entry by entry, which must agree.
inline std::string decoded(const std::string &xml, const Bytes &packet)
{
    const Database database = read_xtce_text(xml, "s.xml");
    Decoder fast(database), slow(database, false);
    const std::string planned = text(database, fast, fast.decode(packet)),
                      walked = text(database, slow, slow.decode(packet));
    return planned == walked ? planned : planned + " by plans, " + walked + " entry by entry";
}

} // namespace fledge::ground::testing
