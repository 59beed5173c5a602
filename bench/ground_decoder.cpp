// SPDX-License-Identifier: Apache-2.0
// The cost of decoding packets by a database, and of monitoring them.
#include "bench/bench.h"

#include "ground/database/xtce.h"
#include "ground/monitor/monitor.h"
#include "ground/packets/packet_archive.h"

#include <chrono>
#include <cstring>
#include <ctime>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace fledge::ground;

/// A file of 20 packets with the header of CCSDS and other applications, each with these types in turn, `n` parameters.
std::string file(const std::vector<std::string> &types, int n, const std::string &more)
{
    std::string kinds, parameters, containers, list;
    for (std::size_t i = 0; i < types.size(); i++) {
        std::string type = types[i];
        kinds += type.replace(type.find("NAME"), 4, "t" + std::to_string(i));
    }
    for (const int bits : {1, 2, 3, 11, 14, 16}) {
        const std::string name = "h" + std::to_string(bits);
        kinds += "<IntegerParameterType name='" + name + "'><IntegerDataEncoding sizeInBits='" + std::to_string(bits) +
                 "'/></IntegerParameterType>";
    }
    for (const char *const name :
         {"version h3", "type h1", "secondary h1", "apid h11", "part h2", "count h14", "size h16"}) {
        const std::string words = name, kind = words.substr(words.find(' ') + 1);
        const std::string short_name = words.substr(0, words.find(' '));
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

/// Packets of the applications of `file`, of 1500 bytes.
std::vector<std::vector<std::uint8_t>> packets_of_file()
{
    std::vector<std::vector<std::uint8_t>> packets(20, std::vector<std::uint8_t>(1500));
    for (std::size_t i = 0; i < packets.size(); i++) {
        for (std::size_t j = 6; j < 1500; j++) {
            packets[i][j] = static_cast<std::uint8_t>(31 * i + 7 * j);
        }
        packets[i][1] = static_cast<std::uint8_t>(100 + i);
        packets[i][2] = 0xC0;
    }
    return packets;
}

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
    const auto packets = packets_of_file();
    for (const auto &packet : packets) {
        decoder.decode(packet); // makes its plan
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

double time_monitor(const char *folder, int limits, long n)
{
    const std::string bounds = "<DefaultAlarm><StaticAlarmRanges><WarningRange minInclusive='-2e9' maxInclusive='2e9'/>"
                               "<CriticalRange minInclusive='-2.1e9' maxInclusive='2.1e9'/></StaticAlarmRanges>"
                               "</DefaultAlarm>";
    const Database database = read_xtce_text(
        file({number("Integer", "Integer", "sizeInBits='32' encoding='twosComplement'", "", limits ? bounds : "")}, 369,
             ""),
        "s");
    Monitor monitor(database);
    std::optional<PacketArchive> archive;
    if (*folder != '\0') {
        archive.emplace(folder, "bench", database, std::int64_t(3600) * 1000000000);
        monitor.sink(&*archive);
    }
    const auto packets = packets_of_file();
    std::vector<Arrival> batch;
    std::size_t undecoded = 0;
    const auto processor = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
    double start = 0;
    for (long i = -40; i < n; i++) { // the first ones make plans
        start = i == 0 ? processor() : start;
        batch.push_back({(i + 40) * 50000, i, packets[static_cast<std::size_t>(i + 40) % packets.size()]});
        if (batch.size() == 200 || i == -1 || i == n - 1) {
            undecoded += monitor.take(batch).size() != 0 && i > 0;
            batch.clear();
        }
    }
    const double elapsed = processor() - start;
    monitor.sink(nullptr);
    return undecoded != 0 || monitor.newest(7)->newest.count == 0 ? -1 : elapsed / static_cast<double>(n);
}

double time_changes(long n)
{
    const Database database = read_xtce_text(file(integers, 500, ""), "s");
    Monitor monitor(database);
    for (auto &packet : packets_of_file()) {
        packet.resize(2100);
        const Arrival arrival{1, 1, packet};
        monitor.take({&arrival, 1});
    }
    std::size_t bytes = 0;
    const auto start = std::clock();
    for (long i = 0; i < n; i++) {
        bytes += monitor.changes(0, {}).bytes.size();
    }
    const double elapsed = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    return bytes < static_cast<std::size_t>(n) * 240000 ? -1 : elapsed / static_cast<double>(n);
}
