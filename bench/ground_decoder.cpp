// SPDX-License-Identifier: Apache-2.0
// The cost of decoding packets by a database.
#include "bench/bench.h"

#include "ground/database/decoder.h"
#include "ground/database/xtce.h"

#include <chrono>
#include <cstring>
#include <string>
#include <vector>

namespace {

using namespace fledge::ground;

/// A file of 20 packets with the header of CCSDS and other applications, each with these types in turn, `n` parameters.
std::string file(const std::vector<std::string> &types, int n, const std::string &more)
{
    std::string kinds, parameters, containers, list;
    for (std::size_t i = 0; i < types.size(); i++) {
        std::string one = types[i];
        kinds += one.replace(one.find("NAME"), 4, "t" + std::to_string(i));
    }
    for (const int bits : {1, 2, 3, 11, 14, 16}) {
        const std::string name = "h" + std::to_string(bits);
        kinds += "<IntegerParameterType name='" + name + "'><IntegerDataEncoding sizeInBits='" + std::to_string(bits) +
                 "'/></IntegerParameterType>";
    }
    for (const char *const name :
         {"version h3", "type h1", "secondary h1", "apid h11", "part h2", "count h14", "size h16"}) {
        const std::string one = name, kind = one.substr(one.find(' ') + 1), short_name = one.substr(0, one.find(' '));
        parameters += "<Parameter name='" + short_name + "' parameterTypeRef='" + kind + "'/>";
        list += "<ParameterRefEntry parameterRef='" + short_name + "'/>";
    }
    containers =
        "<SequenceContainer name='Packet' abstract='true'><EntryList>" + list + "</EntryList></SequenceContainer>";
    for (int i = 0; i < 20; i++) {
        list.clear();
        for (int j = 0; j < n; j++) {
            const std::string name = "p" + std::to_string(i) + "_" + std::to_string(j);
            parameters += "<Parameter name='" + name + "' parameterTypeRef='t" +
                          std::to_string(static_cast<std::size_t>(j) % types.size()) + "'/>";
            list += "<ParameterRefEntry parameterRef='" + name + "'/>";
        }
        containers += "<SequenceContainer name='P" + std::to_string(i) + "'><EntryList>" + list + more +
                      "</EntryList><BaseContainer containerRef='Packet'><RestrictionCriteria><Comparison "
                      "parameterRef='apid' value='" +
                      std::to_string(100 + i) + "'/></RestrictionCriteria></BaseContainer></SequenceContainer>";
    }
    return "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>" + kinds + "</ParameterTypeSet><ParameterSet>" +
           parameters + "</ParameterSet><ContainerSet>" + containers +
           "</ContainerSet></TelemetryMetaData></SpaceSystem>";
}

/// A type of a number; behind: what follows its encoding.
std::string number(const std::string &kind, const std::string &encoding, const std::string &attributes,
                   const std::string &calibrator = "", const std::string &behind = "")
{
    const std::string inside = calibrator.empty() ? "" : "<DefaultCalibrator>" + calibrator + "</DefaultCalibrator>";
    return "<" + kind + "ParameterType name='NAME'><" + encoding + "DataEncoding " + attributes + ">" + inside + "</" +
           encoding + "DataEncoding>" + behind + "</" + kind + "ParameterType>";
}

const std::string line = "<PolynomialCalibrator><Term exponent='0' coefficient='-40'/><Term exponent='1' "
                         "coefficient='0.01'/></PolynomialCalibrator>";
const std::string spline = "<SplineCalibrator><SplinePoint raw='0' calibrated='1'/><SplinePoint raw='1000' "
                           "calibrated='20'/><SplinePoint raw='4095' calibrated='30'/></SplineCalibrator>";
const std::string labels = "<EnumerationList><Enumeration value='0' label='OFF'/><Enumeration value='1' label='ON'/>"
                           "</EnumerationList>";
const std::vector<std::string> integers = {number("Integer", "Integer", "sizeInBits='32' encoding='twosComplement'")};
const std::vector<std::string> mixed = {
    number("Float", "Float", "sizeInBits='32'"),
    number("Float", "Integer", "sizeInBits='16' encoding='twosComplement'", line),
    number("Float", "Float", "sizeInBits='64'"),
    number("Enumerated", "Integer", "sizeInBits='4'", "", labels),
    number("Boolean", "Integer", "sizeInBits='1'"),
    number("Integer", "Integer", "sizeInBits='11'"),
    number("Float", "Integer", "sizeInBits='12'", spline),
    number("Integer", "Integer", "sizeInBits='32' byteOrder='leastSignificantByteFirst'"),
};
const std::string repeated = "<ParameterRefEntry parameterRef='version'><RepeatEntry><Count><DynamicValue>"
                             "<ParameterInstanceRef parameterRef='part'/></DynamicValue></Count></RepeatEntry>"
                             "</ParameterRefEntry>";

} // namespace

double time_decoder(const char *name, long n)
{
    const bool whole = std::strcmp(name, "369 integers") == 0,
               varies = std::strcmp(name, "mixed, of varying size") == 0;
    if (!whole && !varies && std::strcmp(name, "mixed") != 0) {
        return -1;
    }
    const Database database =
        read_xtce_text(whole ? file(integers, 369, "") : file(mixed, 200, varies ? repeated : ""), "s");
    Decoder decoder(database);
    std::vector<std::vector<std::uint8_t>> packets(20, std::vector<std::uint8_t>(1500));
    for (std::size_t i = 0; i < packets.size(); i++) {
        for (std::size_t j = 6; j < 1500; j++) {
            packets[i][j] = static_cast<std::uint8_t>(31 * i + 7 * j);
        }
        packets[i][1] = static_cast<std::uint8_t>(100 + i);
        packets[i][2] = 0xC0;
        decoder.decode(packets[i]); // makes its plan
    }
    std::size_t parameters = 0;
    const auto start = std::chrono::steady_clock::now();
    for (long i = 0; i < n; i++) {
        const Decoded &packet = decoder.decode(packets[static_cast<std::size_t>(i) % packets.size()]);
        parameters += packet.reason.empty() ? packet.values.size() : 0;
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    return parameters == 0 ? -1 : elapsed.count() / static_cast<double>(parameters);
}
