// SPDX-License-Identifier: Apache-2.0
// The container of records, for fledge.archive.
#include "core/extension.h"

#include "record/mcap_reader.h"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using Texts = Typed<py::dict, "dict[str, str]">;
using Named = std::vector<std::pair<std::string, Texts>>;
/// The length that a channel's Message records have to state, by its topic, definition, encoding and metadata.
using Declare = std::function<std::optional<std::uint64_t>(
    const std::string &topic, const std::array<std::string, 3> &definition, const std::string &encoding, Texts)>;

record::Bytes bytes_of(const py::buffer_info &info)
{
    return {static_cast<const std::uint8_t *>(info.ptr), static_cast<std::size_t>(info.size * info.itemsize)};
}

Texts dict_of(const record::Pairs &pairs)
{
    py::dict made;
    for (const auto &[key, value] : pairs) {
        made[py::str(key)] = value;
    }
    return made;
}

Named by_name(const record::Metadata &metadata)
{
    Named made;
    for (const auto &[name, pairs] : metadata) {
        made.emplace_back(name, dict_of(pairs));
    }
    return made;
}

record::Scan scan(const py::buffer &file, const Declare &declare)
{
    const py::buffer_info info = file.request();
    try {
        return {bytes_of(info), [&](const record::Channel &channel) {
                    return declare(channel.topic, channel.definition, channel.encoding, dict_of(channel.metadata));
                }};
    } catch (const record::Unsupported &reason) {
        throw py::value_error(reason.what);
    }
}

} // namespace

void bind_records(py::module_ &m)
{
    using record::Scan;
    py::class_<Scan>(m, "McapScan", "What an MCAP file has; declare is called for each channel.")
        .def(py::init(&scan), "file"_a, "declare"_a)
        .def_readonly("profile", &Scan::profile)
        .def_readonly("library", &Scan::library)
        .def_readonly("problem", &Scan::problem)
        .def_readonly("problem_at", &Scan::problem_at)
        .def_readonly("good_until", &Scan::good_until)
        .def_property_readonly("metadata", [](const Scan &s) { return by_name(s.metadata); })
        .def_property_readonly("offsets", [](const Scan &s) {
            std::vector<std::pair<std::uint16_t, py::bytes>> made; // by id, each an array of 64 bits
            for (const record::Channel &channel : s.channels) {
                made.emplace_back(channel.id, py::bytes(reinterpret_cast<const char *>(channel.offsets.data()),
                                                        channel.offsets.size() * sizeof(std::uint64_t)));
            }
            return made;
        });
    m.def(
        "mcap_metadata", [](const py::buffer &file) { return by_name(record::metadata_of(bytes_of(file.request()))); },
        "file"_a, "The metadata records of an MCAP file, without its messages.");
}

} // namespace fledge::core
