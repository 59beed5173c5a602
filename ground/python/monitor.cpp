// SPDX-License-Identifier: Apache-2.0
// The monitor of telemetry for Python. Functions that take long or wait for another thread release the GIL.
#include "ground/monitor/monitor.h"
#include "ground/database/times.h"
#include "ground/python/loaded.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <variant>

namespace fledge::ground {

namespace {

constexpr const char *levels[] = {"normal", "watch", "warning", "distress", "critical", "severe"};
constexpr const char *kinds[] = {"none",    "natural", "integer", "real", "label",
                                 "boolean", "text",    "binary",  "time", "duration"};
constexpr const char *statuses[] = {"good", "uncalibrated", "unlabelled", "malformed"};

/// Numbers of 8 or 4 bytes, copied because the bytes may not be aligned.
template <class Number> std::vector<Number> numbers(const py::bytes &bytes, const char *name)
{
    const std::string_view view = bytes;
    if (view.size() % sizeof(Number) != 0) {
        throw Refusal(std::string(name) + " have " + std::to_string(sizeof(Number)) + " bytes each; found " +
                      std::to_string(view.size()) + " bytes");
    }
    std::vector<Number> result(view.size() / sizeof(Number));
    std::copy(view.begin(), view.end(), reinterpret_cast<char *>(result.data()));
    return result;
}

LimitDict dict_of(const Bands &bands)
{
    py::dict result;
    for (const auto &[level, band] : bands) {
        py::list ends;
        ends.append(end_of(band.first));
        ends.append(end_of(band.second));
        result[levels[static_cast<std::size_t>(level)]] = ends;
    }
    return result;
}

/// Whether its parameters are the header of packets: it is abstract, or others extend it and it extends none.
bool is_header(const Container &container)
{
    return container.is_abstract || (container.base == no_id && !container.heirs.empty());
}

/// Whether a type's values are numbers of IEEE 754 with at most 32 bits.
bool is_single(const Type &type)
{
    return type.sort == Type::Sort::real && type.encoding.form == NumberForm::ieee754 && type.encoding.bits <= 32 &&
           type.encoding.calibrator.kind == Calibrator::Kind::none && type.encoding.contexts.empty();
}

/// Run an action, which may wait for another thread, without the GIL.
template <class Action> auto released(const Action &action)
{
    const py::gil_scoped_release here;
    return action();
}

using Batch = Typed<py::list, "list[tuple[int, int, bytes]]">;
using Notes = Typed<py::list, "list[tuple[Any, ...]]">;

/// A monitor, and a decoder for inspections, which do not disturb it.
class Watcher {
public:
    Watcher(const Loaded &loaded, const std::optional<std::string> &root)
        : db_(loaded.database()), root_(root ? db_.container(*root) : no_id), monitor_(db_, root_),
          inspector_(db_, false)
    {
    }

    Notes take(const Batch &batch)
    {
        const py::tuple held(batch); // another thread may change the list
        std::vector<Arrival> arrivals;
        arrivals.reserve(held.size());
        for (const auto &item : held) {
            const auto packet = py::cast<py::tuple>(item);
            if (packet.size() != 3 || !py::isinstance<py::bytes>(packet[2])) {
                throw py::type_error("a batch has tuples of t, received and the bytes of a packet");
            }
            arrivals.push_back({packet[0].cast<std::int64_t>(), packet[1].cast<std::int64_t>(),
                                octets(packet[2].cast<std::string_view>())});
        }
        return with([&] { return monitor_.take(arrivals); }, &held);
    }

    /// Run an action and return its notes as tuples; batch: the packets.
    template <class Action> Notes with(const Action &action, const py::tuple *batch = nullptr)
    {
        py::list result;
        for (const Note &note : released(action)) {
            const auto arrival = [&] { return batch != nullptr ? py::tuple((*batch)[note.packet]) : py::tuple(); };
            switch (note.kind) {
            case Note::Kind::concern:
                result.append(py::make_tuple("concern", note.slot, note.t, static_cast<int>(note.old),
                                             static_cast<int>(note.now)));
                break;
            case Note::Kind::undecoded:
                result.append(py::make_tuple("undecoded", note.t, arrival()[1], arrival()[2], note.text));
                break;
            case Note::Kind::watched:
                result.append(
                    py::make_tuple("watched", db_.containers[note.container].path, note.t, arrival()[1], arrival()[2]));
                break;
            case Note::Kind::verified: result.append(py::make_tuple("verified", note.slot, note.t, note.text)); break;
            case Note::Kind::slots: result.append(py::make_tuple("slots", note.slot)); break;
            case Note::Kind::full: result.append(py::make_tuple("full", note.text)); break;
            case Note::Kind::archive: result.append(py::make_tuple("archive", note.text)); break;
            }
        }
        return result;
    }

    std::uint32_t slot(const std::string &name) const
    {
        const std::uint32_t slot = monitor_.find(name);
        if (slot == no_id) {
            py::list names;
            for (const auto &known : monitor_.slots(0)) {
                names.append(known.slot.name);
            }
            const py::list near = py::module_::import("difflib").attr("get_close_matches")(name, names);
            throw Refusal("there is no parameter " + name +
                          (near.empty() ? "" : "; near it: " + py::str(", ").attr("join")(near).cast<std::string>()));
        }
        return slot;
    }

    DictRows slots(std::uint32_t first, std::uint32_t most) const
    {
        py::list result;
        for (const auto &described : monitor_.slots(first, most)) {
            py::dict row;
            row["slot"] = first + result.size();
            row["name"] = described.slot.name;
            row["path"] = described.slot.path;
            row["container"] = path_of(db_, described.slot.container);
            row["header"] = described.slot.container != no_id && is_header(db_.containers[described.slot.container]);
            row["kind"] = name_of(described.slot.kind);
            row["single"] = described.slot.parameter != no_id && is_single(db_.types[described.slot.type]);
            std::vector<std::string> labels;
            std::string unit = described.slot.unit, description = described.slot.description;
            if (described.slot.parameter != no_id) {
                const Type &type = db_.types[described.slot.type];
                for (const Enumerator &label : type.enumerators) {
                    labels.push_back(label.label);
                }
                if (described.slot.kind == Kind::boolean) {
                    labels = {type.zero_label, type.one_label};
                }
                unit = unit_of(type);
                description = db_.parameters[described.slot.parameter].description;
            }
            row["unit"] = unit;
            row["labels"] = labels;
            row["description"] = description;
            row["limits"] = dict_of(described.limits);
            row["persistence"] = described.persistence;
            row["replaced"] = described.replaced ? py::object(dict_of(*described.replaced)) : py::none();
            result.append(row);
        }
        return result;
    }

    /// The label of a raw number of a slot; nothing: it has none.
    std::optional<std::string> label(std::uint32_t slot, double raw) const
    {
        const Id type = released([&] { return monitor_.slot(slot); }).type;
        if (type != no_id) {
            for (const Enumerator &known : db_.types[type].enumerators) {
                if (static_cast<double>(known.low) <= raw && raw <= static_cast<double>(known.high)) {
                    return known.label;
                }
            }
        }
        return std::nullopt;
    }

    /// (first, last) of each stretch of slots without a value
    auto missing() const
    {
        return released([&] { return monitor_.missing(); });
    }

    /// (t, received, raw, value, status, concern, count)
    using NewestRow = std::tuple<std::int64_t, std::int64_t, Value, Value, const char *, int, std::uint64_t>;

    std::optional<NewestRow> newest(std::uint32_t slot) const
    {
        const auto shown = released([&] { return monitor_.newest(slot); });
        if (!shown) {
            return std::nullopt;
        }
        const Newest &newest = shown->newest;
        const Slot place = released([&] { return monitor_.slot(slot); });
        static const Type plain;
        const Type &type = place.type != no_id ? db_.types[place.type] : plain;
        const bool good = newest.status == Status::good || newest.status == Status::unlabelled;
        return NewestRow(newest.t, newest.received, object(type, newest.raw_kind, newest.raw, shown->raw, newest.raw),
                         good ? object(type, place.kind, newest.value, shown->value, newest.raw) : Value(py::none()),
                         statuses[static_cast<std::size_t>(newest.status)], static_cast<int>(newest.concern),
                         newest.count);
    }

    std::pair<std::uint64_t, py::bytes> changes(std::uint64_t since, const std::optional<py::bytes> &slots) const
    {
        const auto chosen = slots ? numbers<std::uint32_t>(*slots, "slots") : std::vector<std::uint32_t>();
        const Frame result = released([&] {
            return monitor_.changes(since,
                                    slots ? std::optional(std::span<const std::uint32_t>(chosen)) : std::nullopt);
        });
        return {result.version, py::bytes(result.bytes)};
    }

    void watch(const std::vector<std::string> &names)
    {
        std::vector<Id> containers;
        containers.reserve(names.size());
        for (const std::string &name : names) {
            containers.push_back(db_.container(name));
        }
        released([&] { monitor_.watch(containers); });
    }

    std::uint32_t expect(const std::string &command, std::size_t verifier,
                         const std::map<std::string, std::string> &arguments)
    {
        const Id id = db_.command(command);
        return released([&] { return monitor_.expect(id, verifier, arguments); });
    }

    /// (whether it holds, what does not, timeout, whether it is suspendable) of each constraint
    auto judge(const std::string &command, const std::map<std::string, std::string> &arguments)
    {
        const Id id = db_.command(command);
        std::vector<std::tuple<std::optional<bool>, std::string, double, bool>> result;
        for (auto &[constraint, holds, text] : released([&] { return monitor_.judge(id, arguments); })) {
            result.emplace_back(holds, std::move(text), constraint->timeout, constraint->suspendable);
        }
        return result;
    }

    py::bytes rows(std::uint32_t trigger)
    {
        const auto result = released([&] { return monitor_.rows(trigger); });
        return {reinterpret_cast<const char *>(result.data()), 8 * result.size()};
    }

    Typed<py::dict, "dict[str, Any]"> inspect(const py::bytes &bytes)
    {
        released([&] { monitor_.lend(inspector_); });
        const Decoded &done = inspector_.decode(octets(bytes), root_);
        py::list rows;
        for (std::size_t i = 0; i < done.fields.size(); i++) {
            const auto [raw, value] = objects(db_, done, i);
            const Field &field = done.fields[i];
            const auto word = static_cast<std::int64_t>(done.values[i]);
            const Value shown =
                is_time(field.value) && !value.is_none() ? Value(py::str(time_words(field.value, word))) : value;
            rows.append(py::make_tuple(inspector_.name(done, i), raw, shown,
                                       statuses[static_cast<std::size_t>(done.status[i])], done.places[i].at,
                                       done.places[i].n));
        }
        py::dict result;
        result["container"] = path_of(db_, done.container);
        result["nearest"] = path_of(db_, done.nearest);
        result["reason"] = done.reason;
        result["bit"] = done.stopped ? py::object(py::int_(*done.stopped)) : py::object(py::none());
        result["rows"] = rows;
        return result;
    }

    Monitor &monitor() { return monitor_; }

private:
    const Database &db_;
    const Id root_;
    Monitor monitor_;
    Decoder inspector_; ///< under the GIL
};

} // namespace

py::object end_of(const Number &end)
{
    if (std::isinf(end.real())) {
        return py::none();
    }
    if (const auto whole = end.is_whole() ? word_of(Kind::integer, end) : std::nullopt) {
        return py::int_(static_cast<std::int64_t>(*whole));
    }
    const auto natural = end.is_whole() ? word_of(Kind::natural, end) : std::nullopt;
    return natural ? py::object(py::int_(*natural)) : py::object(py::float_(end.real()));
}

Bands bands_of(const LimitDict &given)
{
    using End = std::variant<std::int64_t, std::uint64_t, double>; // the first that takes the number
    Bands result;
    for (const auto &[key, value] : given) {
        const auto name = key.cast<std::string>();
        const auto *const found = std::find(std::begin(levels) + 1, std::end(levels), name);
        if (found == std::end(levels)) {
            throw Refusal("a level is watch, warning, distress, critical or severe; found " + name);
        }
        const auto ends = value.cast<std::array<std::optional<End>, 2>>();
        const auto end = [](const std::optional<End> &bound, double otherwise) {
            return bound ? std::visit([](auto number) { return Number(number); }, *bound) : Number(otherwise);
        };
        result[static_cast<Concern>(found - std::begin(levels))] = {end(ends[0], -infinite), end(ends[1], infinite)};
    }
    return result;
}

const char *name_of(Kind kind)
{
    return kinds[static_cast<std::size_t>(kind)];
}

void bind_monitor(py::module_ &m)
{
    [[maybe_unused]] const py::class_<PacketSink> base(m, "PacketSink", "Stores packets.");
    py::class_<Watcher>(m, "Monitor", "The newest values of a spacecraft's telemetry, and their limits.")
        .def(py::init<const Loaded &, const std::optional<std::string> &>(), py::arg("database"),
             py::arg("root") = py::none(), py::keep_alive<1, 2>())
        .def(
            "sink",
            [](Watcher &watcher, std::optional<PacketSink *> sink) {
                released([&] { watcher.monitor().sink(sink.value_or(nullptr)); });
            },
            py::arg("sink"), py::keep_alive<1, 2>(), "Set the archive that stores the packets, or None.")
        .def("take", &Watcher::take, py::arg("batch"),
             "Decode, archive and publish a batch: (t [ns of the spacecraft's clock], received [ns UTC], packet) of "
             "each. Returns notes as tuples:\n"
             "(\"concern\", slot, t, old, new): the state by its limits, 0 normal to 5 severe\n"
             "(\"undecoded\", t, received, packet, reason); (\"watched\", container, t, received, packet)\n"
             "(\"verified\", number, t, text): of expect()\n"
             "(\"slots\", first): there are new slots; (\"full\", text): values are lost\n"
             "(\"archive\", text): why it stores no packets; \"\": it does again.")
        .def("slots", &Watcher::slots, py::arg("first") = 0, py::arg("most") = no_id,
             "At most `most` slots from the first on: dicts of slot, name, path, container, header (whether others "
             "extend its container, as the CCSDS header), unit, kind, single (whether a real is of at most 32 bits), "
             "labels, description, limits, persistence, replaced (the database's limits if others are in force, else "
             "None).")
        .def("slot", &Watcher::slot, py::arg("name"),
             "The slot of a name or path. Raises SetupError with similar names.")
        .def("newest", &Watcher::newest, py::arg("slot"),
             "(t, received, raw, value, status, concern, count), or None before the first value. status: good, "
             "uncalibrated, unlabelled or malformed.")
        .def("label", &Watcher::label, py::arg("slot"), py::arg("raw"),
             "The label of a raw number of an enumerated slot; None: it has none.")
        .def("missing", &Watcher::missing, "The slots that have no value yet: (first, last) of each stretch.")
        .def_property_readonly("version",
                               [](Watcher &watcher) { return released([&] { return watcher.monitor().version(); }); })
        .def("changes", &Watcher::changes, py::arg("since"), py::arg("slots") = py::none(),
             "(version, frame) of the values after a version, of all slots or of those given as 32-bit numbers; "
             "ground/monitor/monitor.h describes the frame.")
        .def("watch", &Watcher::watch, py::arg("containers"),
             "Return a note for each packet of these containers and of those that extend them.")
        .def(
            "expect", &Watcher::expect, py::arg("command"), py::arg("verifier"), py::arg("arguments"),
            "Return a note for each packet that fulfils a verifier, which is given by its place in the command's form; "
            "returns the number that the notes have. arguments: as text. Raises SetupError if it cannot be computed.")
        .def("judge", &Watcher::judge, py::arg("command"), py::arg("arguments"),
             "(holds, text, timeout [s], suspendable) of each constraint of a command, by the newest values. holds: "
             "None if it cannot be judged; text: what does not hold, with the values. arguments: as text.")
        .def(
            "forget",
            [](Watcher &watcher, std::uint32_t number) { released([&] { watcher.monitor().forget(number); }); },
            py::arg("number"), "End what `expect` began.")
        .def(
            "set_limits",
            [](Watcher &watcher, std::uint32_t slot, const std::optional<LimitDict> &limits,
               std::uint32_t persistence) {
                const auto bands = limits ? std::optional(bands_of(*limits)) : std::nullopt;
                return watcher.with([&] { return watcher.monitor().set_limits(slot, bands, persistence); });
            },
            py::arg("slot"), py::arg("limits"), py::arg("persistence") = 1,
            "Replace the database's limits: {\"warning\": [low, high]}, None for an open end; None for all restores "
            "them. The newest value is judged at once; returns notes as `take`. Raises SetupError.")
        .def(
            "trigger",
            [](Watcher &watcher, const std::vector<std::uint32_t> &inputs) {
                return released([&] { return watcher.monitor().trigger(inputs); });
            },
            py::arg("inputs"), "A number for `rows` of these slots.")
        .def("rows", &Watcher::rows, py::arg("trigger"),
             "The rows since the last call, one for each packet with an input, once all inputs have a value: int64 t, "
             "and each input as a double: times in seconds, raw values of enumerations, NaN where there is no number.")
        .def(
            "derive",
            [](Watcher &watcher, const std::string &name, const std::string &unit, const std::string &description,
               const LimitDict &limits, std::uint32_t persistence) {
                const Bands bands = bands_of(limits);
                return released([&] { return watcher.monitor().derive(name, unit, description, bands, persistence); });
            },
            py::arg("name"), py::arg("unit") = "", py::arg("description") = "", py::arg("limits") = py::dict(),
            py::arg("persistence") = 1, "Add a slot whose numbers `put` sets. Raises SetupError if the name is taken.")
        .def(
            "put",
            [](Watcher &watcher, std::uint32_t slot, const py::bytes &t, const py::bytes &values) {
                const auto times = numbers<std::int64_t>(t, "times");
                const auto all = numbers<double>(values, "values");
                return watcher.with([&] { return watcher.monitor().put(slot, times, all); });
            },
            py::arg("slot"), py::arg("t"), py::arg("values"),
            "Set values of a derived slot: int64 t and doubles. NaN: no value. Returns notes as `take`.")
        .def("inspect", &Watcher::inspect, py::arg("packet"),
             "A packet's container, nearest, reason, rows (name, raw, value, status, first bit, bits), and bit: where "
             "decoding stopped, or the value of the failed comparison.");
}

} // namespace fledge::ground
