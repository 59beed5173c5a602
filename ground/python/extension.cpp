// SPDX-License-Identifier: Apache-2.0
// The extension `_ground`: databases of XTCE, which decode packets and encode commands; an entity of CFDP; the ground's
// end of a link of frames.
#include "ground/capture/packets.h"
#include "ground/database/encoder.h"
#include "ground/database/times.h"
#include "ground/database/xtce.h"
#include "ground/python/loaded.h"

#include <pybind11/stl.h>

namespace fledge::ground {

void bind_archive(py::module_ &m);          // archive.cpp
void bind_entity(py::module_ &m);           // entity.cpp
void bind_link_end(py::module_ &m);         // link_end.cpp
void bind_monitor(py::module_ &m);          // monitor.cpp
DictRows command_forms(const Database &db); // forms.cpp
Names container_names(const Database &db);

Value object(const Type &type, Kind kind, std::uint64_t word, std::string_view bytes, std::uint64_t raw)
{
    switch (kind) {
    case Kind::natural: return py::int_(word);
    case Kind::integer:
    case Kind::time:
    case Kind::duration: return py::int_(static_cast<std::int64_t>(word));
    case Kind::real: return py::float_(std::bit_cast<double>(word));
    case Kind::boolean: return py::bool_(word != 0);
    case Kind::label:
        return word != no_id ? Value(py::str(type.enumerators[word].label))
                             : object(type, raw_kind(type.encoding), raw, bytes, raw);
    case Kind::text:
        return py::reinterpret_steal<Value>(
            PyUnicode_DecodeUTF8(bytes.data(), static_cast<Py_ssize_t>(bytes.size()), "replace"));
    case Kind::binary: return py::bytes(bytes.data(), bytes.size());
    default: return py::none();
    }
}

std::pair<Value, Value> objects(const Database &database, const Decoded &packet, std::size_t i)
{
    const Field &field = packet.fields[i];
    const Type &type = database.types[field.type];
    const auto bytes = [&](Kind kind, std::uint64_t word) {
        return kind == Kind::text || kind == Kind::binary ? packet.text(word) : std::string_view();
    };
    const bool good = packet.status[i] == Status::good || packet.status[i] == Status::unlabelled;
    const auto raw_bytes = bytes(field.raw, packet.raw[i]);
    const auto own = field.value == Kind::label ? raw_bytes : bytes(field.value, packet.values[i]);
    return {object(type, field.raw, packet.raw[i], raw_bytes, packet.raw[i]),
            good ? object(type, field.value, packet.values[i], own, packet.raw[i]) : Value(py::none())};
}

namespace {

/// A packet in objects of Python.
struct Packet {
    PathOrNone container, nearest;
    std::string reason;
    std::vector<std::tuple<std::string, Value, Value>> rows;  ///< (name, raw, value)
    std::vector<std::pair<const char *, std::string>> fields; ///< (kind, unit) of each
    ArgumentDict raw, values;
    std::size_t bits;
};

/// The nested dicts and lists of a packet's parameters.
class Tree {
public:
    Tree(const Database &database, const Decoded &packet) : db_(database), packet_(packet), inner_(packet.nodes.size())
    {
    }

    /// at: the node of the value.
    void put(py::dict &top, Id parameter, std::uint32_t at, const py::object &value)
    {
        const py::str name(db_.parameters[parameter].name);
        if (at == 0) {
            top[name] = value;
            parameter_ = no_id;
            return;
        }
        insert(holder(top, name, parameter, at), at, value);
    }

private:
    /// The dict or list that the value of a node belongs to.
    py::object holder(py::dict &top, const py::str &name, Id parameter, std::uint32_t at)
    {
        const PathNode &node = packet_.nodes[at];
        const bool array = db_.types[node.type].sort == Type::Sort::array;
        const auto fresh = [&]() -> py::object { return array ? py::object(py::list()) : py::object(py::dict()); };
        if (node.parent != 0) {
            if (!inner_[node.parent]) {
                inner_[node.parent] = fresh();
                insert(holder(top, name, parameter, node.parent), node.parent, inner_[node.parent]);
            }
            return inner_[node.parent];
        }
        if (parameter != parameter_ || (at != at_ && node.place <= place_)) { // the parameter is in the packet again
            outer_ = fresh();
            top[name] = outer_;
        }
        parameter_ = parameter;
        place_ = node.place;
        at_ = at;
        return outer_;
    }

    void insert(const py::object &holder, std::uint32_t at, const py::object &value)
    {
        const PathNode &node = packet_.nodes[at];
        if (py::isinstance<py::list>(holder)) {
            holder.cast<py::list>().append(value);
        } else {
            holder[py::str(db_.types[node.type].members[node.place].name)] = value;
        }
    }

    const Database &db_;
    const Decoded &packet_;
    std::vector<py::object> inner_; ///< of each node
    py::object outer_;
    Id parameter_ = no_id;
    std::uint32_t place_ = 0, at_ = 0;
};

/// Calls action(field, parameter, node) for each field and, without a field, for each array without elements.
template <class Do> void each_value(const Decoded &packet, const Do &action)
{
    auto empty = packet.empty.begin();
    for (std::size_t i = 0; i <= packet.fields.size(); i++) {
        for (; empty != packet.empty.end() && empty->before == i; ++empty) {
            action(std::optional<std::size_t>(), empty->parameter, empty->node);
        }
        if (i < packet.fields.size()) {
            action(std::optional(i), packet.fields[i].parameter, packet.fields[i].node);
        }
    }
}

Given given(const py::handle &value, int depth = 0)
{
    Given result;
    if (depth > 64) {
        throw Refusal("a value is nested deeper than 64");
    }
    const py::object number = py::module_::import("numbers");
    if (py::isinstance<py::str>(value)) {
        result.kind = Given::Kind::text;
        result.text = value.cast<std::string>();
    } else if (py::isinstance<py::bytes>(value) || PyByteArray_Check(value.ptr())) {
        const std::string text = py::bytes(py::reinterpret_borrow<py::object>(value));
        result.kind = Given::Kind::bytes;
        result.bytes.assign(text.begin(), text.end());
    } else if (py::isinstance<py::dict>(value)) {
        result.kind = Given::Kind::members;
        for (const auto &[key, item] : py::reinterpret_borrow<py::dict>(value)) {
            result.names.push_back(key.cast<std::string>());
            result.list.push_back(given(item, depth + 1));
        }
    } else if (py::isinstance(value, number.attr("Integral")) || py::hasattr(value, "__index__")) {
        const py::int_ whole = py::reinterpret_steal<py::int_>(PyNumber_Index(value.ptr()));
        const py::object bound = py::int_(1).attr("__lshift__")(64);
        if (!py::bool_(whole.attr("__lt__")(bound)) || !py::bool_(whole.attr("__gt__")(bound.attr("__neg__")()))) {
            throw Refusal("a whole number has at most 64 bits; found " + py::repr(whole).cast<std::string>());
        }
        const bool negative = py::bool_(whole.attr("__lt__")(0));
        const auto size = py::object(whole.attr("__abs__")()).cast<std::uint64_t>();
        result.integer = negative ? -Wide(size) : Wide(size);
    } else if (py::isinstance<py::float_>(value) || py::hasattr(value, "__float__")) {
        result.kind = Given::Kind::real;
        result.real = value.cast<double>();
    } else if (py::isinstance<py::sequence>(value) || py::hasattr(value, "__len__")) {
        result.kind = Given::Kind::list;
        for (const auto &item : value) {
            result.list.push_back(given(item, depth + 1));
        }
    } else {
        throw Refusal("a command's value is a number, text, bytes, a list or a dict; found " +
                      py::repr(value).cast<std::string>());
    }
    return result;
}

template <class Things> std::vector<std::string> paths(const Things &things)
{
    std::vector<std::string> result;
    result.reserve(things.size());
    for (const auto &thing : things) {
        result.push_back(thing.path);
    }
    return result;
}

Packet decode_packet(Loaded &loaded, const py::bytes &bytes, const std::optional<std::string> &root)
{
    const Database &db = loaded.database();
    const Id from = root ? db.container(*root) : no_id;
    const Decoded &done = loaded.decoder().decode(octets(bytes), from);
    Packet result{
        path_of(db, done.container), path_of(db, done.nearest), done.reason, {}, {}, py::dict(), py::dict(), done.bits};
    Tree raws(db, done), values(db, done);
    each_value(done, [&](std::optional<std::size_t> i, Id parameter, std::uint32_t node) {
        if (!i) {
            raws.put(result.raw, parameter, node, py::list());
            values.put(result.values, parameter, node, py::list());
            return;
        }
        const auto [raw, value] = objects(db, done, *i);
        result.rows.emplace_back(loaded.decoder().name(done, *i), raw, value);
        result.fields.emplace_back(name_of(done.fields[*i].value), unit_of(db.types[done.fields[*i].type]));
        raws.put(result.raw, parameter, node, raw);
        values.put(result.values, parameter, node, value);
    });
    return result;
}

Header header_of(const std::string &name)
{
    const auto known = {"none", "ccsds", "cfs"};
    const auto found = std::find(known.begin(), known.end(), name);
    return found != known.end() ? static_cast<Header>(found - known.begin())
                                : throw Refusal("a header is none, ccsds or cfs; found " + name);
}

/// A packet of a command in objects of Python.
struct CommandPacket {
    PathOrNone command;
    ArgumentDict arguments, header;
    std::string reason;
    std::size_t bits;
};

CommandPacket decode_command(Loaded &loaded, const py::bytes &bytes, const std::string &header)
{
    CommandDecoder &decoder = loaded.commands(header_of(header));
    const Database &db = decoder.database();
    const auto packet = octets(bytes);
    const Decoded &done = decoder.decode(packet);
    CommandPacket result{std::nullopt, {}, {}, done.reason, done.bits};
    if (done.reason.empty() && (done.bits + 7) / 8 < packet.size()) {
        result.reason = "the packet is longer than a " + db.containers[done.container].path + ", which has " +
                        std::to_string(done.bits) + " bits";
    } else if (done.reason.empty()) {
        result.command = db.containers[done.container].path;
    }
    Tree arguments(db, done), parameters(db, done);
    each_value(done, [&](std::optional<std::size_t> i, Id parameter, std::uint32_t node) {
        const py::object value = i ? py::object(objects(db, done, *i).second) : py::object(py::list());
        const CommandDecoder::Role role = decoder.role(done, parameter);
        if (role == CommandDecoder::Role::header) {
            parameters.put(result.header, parameter, node, value);
        } else if (role == CommandDecoder::Role::given) {
            arguments.put(result.arguments, parameter, node, value);
            if (const auto counter = i ? decoder.counter(done, *i) : std::nullopt) {
                result.arguments[py::str(counter->first)] = nearest(counter->second);
            }
        }
    });
    return result;
}

std::map<std::string, Given> all_given(const ArgumentDict &arguments)
{
    std::map<std::string, Given> all;
    for (const auto &[key, value] : arguments) {
        all.emplace(key.cast<std::string>(), given(value));
    }
    return all;
}

py::bytes encode_command(const Loaded &loaded, const std::string &name, const ArgumentDict &arguments)
{
    return bytes_of(ground::encode(loaded.database(), loaded.database().command(name), all_given(arguments)));
}

/// (name, whether it is an argument, first bit, bits) of each entry of a command's packet.
auto command_places(const Loaded &loaded, const std::string &name, const ArgumentDict &arguments)
{
    std::vector<Placed> places;
    ground::encode(loaded.database(), loaded.database().command(name), all_given(arguments), &places);
    std::vector<std::tuple<std::string, bool, std::size_t, std::size_t>> result;
    result.reserve(places.size());
    for (const Placed &place : places) {
        result.emplace_back(place.name, place.argument, place.bit, place.bits);
    }
    return result;
}

std::vector<std::string> units(const Loaded &loaded, const std::string &parameter)
{
    const Database &db = loaded.database();
    for (const Parameter &candidate : db.parameters) {
        if (candidate.name == parameter || candidate.path == parameter) {
            return db.types[candidate.type].units;
        }
    }
    throw Refusal("the database has no parameter " + parameter);
}

/// (place, packet, problem, note) of each.
auto tuples(const std::vector<Piece> &pieces)
{
    std::vector<std::tuple<std::size_t, py::bytes, std::string, std::string>> all;
    all.reserve(pieces.size());
    for (const Piece &piece : pieces) {
        all.emplace_back(piece.at, bytes_of(piece.packet), piece.problem, piece.note);
    }
    return all;
}

} // namespace

} // namespace fledge::ground

PYBIND11_MODULE(_ground, m)
{
    using namespace fledge::ground;
    m.doc() = "The database and the files of the ground. Use the package fledge.ground instead.";
    py::module_::import("_core"); // for its exception
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            std::rethrow_exception(std::move(thrown));
        } catch (const Refusal &refusal) {
            PyErr_SetString(py::module_::import("_core").attr("SetupError").ptr(), refusal.what());
        }
    });
    bind_entity(m);
    bind_link_end(m);
    m.def(
        "packets_of_frames",
        [](const py::bytes &bytes, std::size_t size, std::size_t skip, std::size_t trailer, std::size_t code,
           std::size_t insert, bool control, bool randomized) {
            return tuples(packets_of_frames(octets(bytes), {size, skip, trailer, code, insert, control, randomized}));
        },
        py::arg("bytes"), py::arg("size"), py::arg("skip"), py::arg("trailer") = 0, py::arg("code") = 0,
        py::arg("insert") = 0, py::arg("control") = false, py::arg("randomized") = false);
    m.def(
        "time_text",
        [](const std::string &kind, std::int64_t ns) {
            return time_text(kind == name_of(Kind::time) ? Kind::time : Kind::duration, ns);
        },
        py::arg("kind"), py::arg("ns"), "A value of the kind time as a date of UTC; of the kind duration in seconds.");
    m.def(
        "packets_of_bytes",
        [](const py::bytes &bytes, std::size_t skip) { return tuples(packets_of_bytes(octets(bytes), skip)); },
        py::arg("bytes"), py::arg("skip"));
    py::class_<Packet>(m, "Packet", "A packet that was decoded.")
        .def_readonly("container", &Packet::container, "The path of its container; None: none fits.")
        .def_readonly("nearest", &Packet::nearest, "Then the path of the one that came nearest.")
        .def_readonly("reason", &Packet::reason, "Why values are missing; empty: the packet is whole.")
        .def_readonly("rows", &Packet::rows, "(name, raw value, value) of each field, in the packet's order.")
        .def_readonly("fields", &Packet::fields, "(kind, unit) of each row's value; the kinds are those of slots.")
        .def_readonly("raw", &Packet::raw, "Parameter -> raw value; the last one of those that repeat.")
        .def_readonly("values", &Packet::values,
                      "Parameter -> value: dicts of members, lists of elements; None: no value.")
        .def_readonly("bits", &Packet::bits, "How many bits its entries take.");
    py::class_<CommandPacket>(m, "CommandPacket", "A packet of a command that was decoded.")
        .def_readonly("command", &CommandPacket::command, "The path of the command; None: it is none, or not whole.")
        .def_readonly("arguments", &CommandPacket::arguments, "Argument -> value, as encode() takes them.")
        .def_readonly("header", &CommandPacket::header, "Parameter of its header -> value.")
        .def_readonly("reason", &CommandPacket::reason, "Why there is no command; empty: there is one.")
        .def_readonly("bits", &CommandPacket::bits, "How many bits its entries take.");
    py::class_<Loaded>(m, "Database", "A database of packets and commands.")
        .def_static(
            "read",
            [](const std::vector<std::pair<std::string, std::string>> &files, bool plans, bool lenient) {
                std::vector<XtceFile> all;
                all.reserve(files.size());
                for (const auto &[name, under] : files) {
                    all.push_back({name, under});
                }
                return std::make_unique<Loaded>(read_xtce(all, lenient), plans);
            },
            py::arg("files"), py::arg("plans") = true, py::arg("lenient") = false)
        .def("decode", &decode_packet, py::arg("packet"), py::arg("root") = py::none())
        .def("decode_command", &decode_command, py::arg("packet"), py::arg("header") = "none")
        .def("encode", &encode_command, py::arg("name"), py::arg("arguments"))
        .def("places", &command_places, py::arg("name"), py::arg("arguments"))
        .def("units", &units, py::arg("parameter"), "The units of a parameter.")
        .def(
            "forms", [](const Loaded &loaded) { return command_forms(loaded.database()); },
            "Of each command that can be sent: name (in Fledge's words where there are such), path, group, "
            "description, hazardous (why, or empty), and its arguments: name, type, unit, low, high, labels, initial, "
            "description, size [bits].")
        .def(
            "container_names", [](const Loaded &loaded) { return container_names(loaded.database()); },
            "Path of each container -> its name in Fledge's words, or the path.")
        .def_property_readonly("notes", [](const Loaded &loaded) { return loaded.database().notes; })
        .def_property_readonly("left_out", [](const Loaded &loaded) { return loaded.database().left_out; })
        .def_property_readonly("containers", [](const Loaded &loaded) { return paths(loaded.database().containers); })
        .def_property_readonly("parameters", [](const Loaded &loaded) { return paths(loaded.database().parameters); })
        .def_property_readonly("commands", [](const Loaded &loaded) { return paths(loaded.database().commands); });
    bind_monitor(m);
    bind_archive(m);
}
