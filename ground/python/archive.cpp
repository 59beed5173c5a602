// SPDX-License-Identifier: Apache-2.0
// The archive of a spacecraft's packets for Python: its writer and its reader.
#include "ground/packets/history.h"
#include "ground/packets/packet_archive.h"
#include "ground/python/loaded.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

namespace fledge::ground {

namespace {

using namespace py::literals;
using core::list_of;
using NameList = std::vector<std::string>;

/// An array that owns the values of a vector.
template <class Value> py::array_t<Value> array(std::vector<Value> values, std::size_t columns = 0)
{
    auto *const owner = new std::vector<Value>(std::move(values));
    const py::capsule free(owner, [](void *all) { delete static_cast<std::vector<Value> *>(all); });
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(owner->size() / std::max<std::size_t>(columns, 1))};
    if (columns != 0) {
        shape.push_back(static_cast<py::ssize_t>(columns));
    }
    return py::array_t<Value>(shape, owner->data(), free);
}

/// What a function returns that runs while other threads may run Python.
template <class Function> auto without_gil(Function function)
{
    const py::gil_scoped_release free;
    return function();
}

using SeriesDict =
    Typed<py::dict, "dict[str, tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray, numpy.ndarray, numpy.ndarray, "
                    "numpy.ndarray, tuple[str, list[int | float | str | bytes | None]] | None]]">;

DictRows sessions(History &history)
{
    py::list result;
    for (const auto &session : without_gil([&] { return history.sessions(); })) {
        auto gaps = list_of(session.gaps, [](const Missing &gap) { return std::tuple(gap.from, gap.to, gap.why); });
        result.append(py::dict("session"_a = session.number, "first"_a = session.first, "last"_a = session.last,
                               "packets"_a = session.packets, "ended"_a = session.ended, "gaps"_a = std::move(gaps)));
    }
    return result;
}

/// name -> (received, bands or None for those of the database, persistence) of each setting.
using GivenParameters =
    std::map<std::string, std::vector<std::tuple<std::int64_t, std::optional<LimitDict>, std::uint32_t>>>;

History::Settings settings_of(const GivenParameters &given)
{
    History::Settings result;
    for (const auto &[name, all] : given) {
        for (const auto &[received, bands, persistence] : all) {
            result[name].push_back(
                {received, bands ? std::make_shared<const Limits>(bands_of(*bands), persistence) : nullptr});
        }
    }
    return result;
}

/// The kind of a series, and its values as objects, None where there is none.
std::pair<const char *, std::vector<Value>> exact_of(const Database &db, const History::Series &series)
{
    const Type &type = db.types[series.type];
    const Kind kind = value_kind(type);
    std::vector<Value> result;
    for (const auto &exact : series.exact) {
        if (result.size() % 8192 == 8191) { // let other threads run
            const py::gil_scoped_release free;
        }
        const bool good = exact.status == Status::good || exact.status == Status::unlabelled;
        result.push_back(good ? object(type, kind, exact.value, exact.bytes, exact.raw) : Value(py::none()));
    }
    return {name_of(kind), std::move(result)};
}

/// The batches of a replay, in the form of Monitor.take.
struct Replay {
    History &history;
    History::Query query;
    const std::size_t most;
    const std::int64_t span;
    std::size_t skip = 0;

    auto next()
    {
        const auto all = without_gil([&] { return history.next(query, skip, most, span); });
        if (all.empty()) {
            throw py::stop_iteration();
        }
        // The next batch begins behind those packets of the last time that are in this batch.
        std::size_t same = 0;
        while (same < all.size() && all[all.size() - 1 - same].t == all.back().t) {
            same++;
        }
        skip = same + (all.back().t == query.from ? skip : 0);
        query.from = all.back().t;
        return list_of(all, [](const History::Packet &packet) {
            return std::tuple(packet.t, packet.received, bytes_of(packet.bytes));
        });
    }
};

SeriesDict series(History &history, const NameList &names, std::int64_t from, std::int64_t to, std::size_t points,
                  std::int64_t of, const std::optional<GivenParameters> &limits, bool exact)
{
    const auto settings = limits ? settings_of(*limits) : History::Settings();
    auto all = without_gil([&] {
        return history.series(names, {from, to, of}, points, limits ? &settings : nullptr, exact);
    });
    py::dict result;
    for (std::size_t i = 0; i < names.size(); i++) {
        auto values = exact ? std::optional(exact_of(history.database(), all[i])) : std::nullopt;
        result[py::str(names[i])] =
            std::tuple(array(std::move(all[i].t)), array(std::move(all[i].value)), array(std::move(all[i].low)),
                       array(std::move(all[i].high)), array(std::move(all[i].concern)), array(std::move(all[i].worst)),
                       std::move(values));
    }
    return result;
}

auto rows(History &history, const NameList &inputs, std::int64_t from, std::int64_t to, std::int64_t of)
{
    History::Rows all = without_gil([&] { return history.rows(inputs, {from, to, of}); });
    return std::pair(array(std::move(all.values), inputs.size() + 1), array(std::move(all.received)));
}

auto packets(History &history, std::int64_t from, std::int64_t to, const std::optional<std::string> &container,
             std::size_t limit, bool backwards, std::int64_t of, std::uint64_t most_bytes)
{
    const auto all = without_gil([&] {
        return history.packets({from, to, of}, container.value_or(""), limit, backwards, most_bytes);
    });
    return list_of(all, [](const History::Packet &packet) {
        return std::tuple(packet.t, packet.received,
                          packet.container.empty() ? std::nullopt : std::optional(packet.container),
                          bytes_of(packet.bytes));
    });
}

void bind_writer(py::module_ &m)
{
    using Free = py::call_guard<py::gil_scoped_release>;
    py::class_<PacketArchive, PacketSink>(m, "PacketArchive", "The archive of a spacecraft, for one writer.")
        .def(py::init([](const std::string &folder, const std::string &craft, const Loaded &database, double period) {
                 return std::make_unique<PacketArchive>(folder, craft, database.database(),
                                                        static_cast<std::int64_t>(std::min(period, 9e9) * 1e9));
             }),
             py::arg("folder"), py::arg("craft"), py::arg("database"), py::arg("period_s") = 3600.0,
             py::keep_alive<1, 4>(), Free())
        .def(
            "put",
            [](PacketArchive &archive, std::int64_t t, std::int64_t received, const py::bytes &packet,
               std::optional<Id> container) {
                archive.put({t, received, octets(packet)}, container.value_or(no_id));
            },
            py::arg("t"), py::arg("received"), py::arg("packet"), py::arg("container") = py::none(),
            "Add a packet, as Monitor.take does; container: its place in Database.containers.")
        .def("missing", &PacketArchive::missing, py::arg("t0"), py::arg("t1"), py::arg("why"),
             "Record that packets of these times [ns] were lost before they arrived here.")
        .def("save", &PacketArchive::save, Free(), "Write the packets that were put to the file; raises SetupError.")
        .def("close", &PacketArchive::close, Free(), "End the session; raises SetupError.")
        .def_property_readonly("problem", &PacketArchive::problem, "Why packets are not saved; empty: they are.")
        .def_property_readonly("lost", &PacketArchive::lost, "How many packets were dropped so far.");
}

void bind_reader(py::module_ &m)
{
    const auto t0 = py::arg("t0") = 0;
    const auto t1 = py::arg("t1") = std::numeric_limits<std::int64_t>::max();
    const auto session = py::arg("session") = -1;
    py::class_<Replay>(m, "Replay", "An iterator of batches for Monitor.take.")
        .def(
            "__iter__", [](const py::object &self) -> Typed<py::object, "Replay"> { return self; })
        .def("__next__", &Replay::next);
    py::class_<History>(m, "History", "Reads the archive of a spacecraft.")
        .def(py::init([](const std::string &folder, const std::string &craft, const Loaded &database,
                         const std::optional<std::string> &root) {
                 return std::make_unique<History>(folder, craft, database.database(), root.value_or(""));
             }),
             py::arg("folder"), py::arg("craft"), py::arg("database"), py::arg("root") = py::none(),
             py::keep_alive<1, 4>())
        .def("sessions", &sessions, "dicts of session, first, last, packets, ended and gaps (from, to, why).")
        .def(
            "series", &series, py::arg("names"), t0, t1, py::arg("points") = 0, session, py::arg("limits") = py::none(),
            py::arg("exact") = false,
            "name -> arrays of t [ns], value, low, high, concern and worst concern, and None; points: at most so many, "
            "0: all. limits: name -> (received [ns], bands as of Monitor.set_limits, persistence) of each setting; "
            "without it, no value is judged. exact: instead of None, the kind and a list of the values as "
            "Database.decode has them, also of texts and bytes; None: there is none.")
        .def("rows", &rows, py::arg("inputs"), t0, t1, session,
             "(n, 1 + inputs) of the time, whose 64 bits are an integer, and values; and when each was received [ns].")
        .def("packets", &packets, t0, t1, py::arg("container") = py::none(), py::arg("limit") = 1000,
             py::arg("backwards") = false, session, py::arg("most_bytes") = UINT64_MAX,
             "(t, received, path of the container or None, packet) of each; container: \"undecoded\" for those.")
        .def(
            "replay",
            [](History &history, std::int64_t from, std::int64_t to, std::int64_t of, std::size_t most,
               std::int64_t span) {
                return Replay{history, {from, to, of}, most, span};
            },
            t0, t1, session, py::arg("most") = 1000, py::arg("span_ns") = 1'000'000'000, py::keep_alive<0, 1>(),
            "Batches of (t, received, packet), each of at most so many and so long.");
}

} // namespace

void bind_archive(py::module_ &m)
{
    bind_writer(m);
    bind_reader(m);
}

} // namespace fledge::ground
