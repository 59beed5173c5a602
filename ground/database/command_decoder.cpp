// SPDX-License-Identifier: Apache-2.0
#include "ground/database/command_decoder.h"

#include <algorithm>

namespace fledge::ground {

namespace {

using Sort = Type::Sort;
using Size = std::optional<std::size_t>; // [bits], if it is the same in all packets

/// The calibrator that converts raw numbers back to units; without an inverse, a calibrator that has no result.
Calibrator inverse(const Calibrator &calibrator)
{
    Calibrator result;
    if (calibrator.kind == Calibrator::Kind::none) {
        return result;
    }
    result.kind = Calibrator::Kind::polynomial; // without coefficients
    if (calibrator.kind == Calibrator::Kind::polynomial && calibrator.coefficients.size() == 2 &&
        calibrator.coefficients[1] != 0) {
        result.coefficients = {-calibrator.coefficients[0] / calibrator.coefficients[1],
                               1 / calibrator.coefficients[1]};
    } else if (calibrator.kind == Calibrator::Kind::spline && calibrator.order == 1) {
        std::vector<Calibrator::Point> points;
        for (const Calibrator::Point &point : calibrator.points) {
            points.push_back({point.calibrated, point.raw});
        }
        if (points.size() > 1 && points.front().raw > points.back().raw) {
            std::reverse(points.begin(), points.end());
        }
        const auto falls = [](const Calibrator::Point &a, const Calibrator::Point &b) { return a.raw >= b.raw; };
        if (std::adjacent_find(points.begin(), points.end(), falls) == points.end()) {
            result.kind = calibrator.kind;
            result.points = std::move(points);
            result.extrapolate = calibrator.extrapolate;
        }
    }
    return result;
}

Condition all_of(std::vector<Condition> parts)
{
    Condition result;
    if (!parts.empty()) {
        result.kind = Condition::Kind::all;
        result.parts = std::move(parts);
    }
    return result;
}

} // namespace

class CommandDecoder::Builder {
public:
    Builder(const Database &from, Header header) : from_(from), header_(header)
    {
        Database &db = built_.database;
        db.files = from.files;
        db.types = from.types;
        db.parameters = from.parameters;
        db.containers = from.containers;
        for (Type &type : db.types) {
            type.alarms.clear();
            const bool time = type.sort == Sort::absolute_time || type.sort == Sort::relative_time;
            type.encoding.calibrator = time ? Calibrator() : inverse(type.encoding.calibrator);
            for (auto &[condition, calibrator] : type.encoding.contexts) {
                calibrator = inverse(calibrator);
            }
        }
        db.arguments = built_.first_argument = static_cast<Id>(db.parameters.size());
        for (Id i = 0; i < from.commands.size(); i++) {
            if (from.commands[i].container != no_id) {
                owners_.try_emplace(from.commands[i].container, i);
            }
        }
        Container root;
        root.path = root.name = "a command";
        root.is_abstract = true;
        built_.root = add(root, no_id);
        for (Id i = 0; i < from.commands.size(); i++) { // before the commands, so that derived commands are tried first
            if (const Id container = container_of(i); container != no_id) {
                node(container);
            }
        }
        for (Container &container : db.containers) { // an unrestricted heir would fit others' packets, too
            std::stable_partition(container.heirs.begin(), container.heirs.end(),
                                  [&](Id heir) { return restricted_.contains(heir); });
        }
        for (Id i = 0; i < from.commands.size(); i++) {
            if (const Id container = container_of(i); container != no_id && !from.commands[i].is_abstract) {
                command(i, container);
            }
        }
    }

    Built take() { return std::move(built_); }

private:
    /// A command's container with the containers that it extends.
    struct Node {
        Id container = no_id;            ///< in the new database
        std::map<std::string, Id> names; ///< of its arguments, own and inherited
        std::vector<Condition> fixed;    ///< values that its own entries have in every packet
        Size end;                        ///< [bits] behind its last entry
    };

    Id add(Container container, Id base)
    {
        const auto id = static_cast<Id>(built_.database.containers.size());
        container.base = base;
        container.of_command = true;
        container.heirs.clear();
        built_.database.containers.push_back(std::move(container));
        if (base != no_id) {
            built_.database.containers[base].heirs.push_back(id);
        }
        return id;
    }

    Id container_of(Id command) const
    {
        for (; command != no_id; command = from_.commands[command].base) {
            if (from_.commands[command].container != no_id) {
                return from_.commands[command].container;
            }
        }
        return no_id;
    }

    const Node &node(Id id)
    {
        if (const auto known = nodes_.find(id); known != nodes_.end()) {
            return known->second;
        }
        const Container &container = from_.containers[id];
        Node result;
        result.end = 0;
        if (container.base != no_id) {
            result = node(container.base);
        }
        std::vector<Condition> parts = std::move(result.fixed);
        result.fixed.clear();
        const std::size_t inherited = parts.size();
        const auto owner = owners_.find(id);
        if (container.restriction.kind != Condition::Kind::always) {
            parts.push_back(container.restriction);
        }
        if (owner != owners_.end()) {
            assignments(owner->second, result, parts);
        }
        const bool restricted = parts.size() > inherited;
        Container copy = container;
        copy.path = copy.name = owner != owners_.end() ? from_.commands[owner->second].path : container.path;
        copy.is_abstract = true;
        copy.restriction = all_of(std::move(parts));
        copy.entries.clear();
        const Id command = owner != owners_.end() ? owner->second : no_id;
        std::vector<std::size_t> behind(container.entries.size() + 1); // [bits] each, as far as they are known
        for (std::size_t i = container.entries.size(); i-- > 0;) {
            behind[i] = behind[i + 1] + bits_of_entry(container.entries[i], command).value_or(0);
        }
        for (std::size_t i = 0; i < container.entries.size(); i++) {
            entry(container.entries[i], behind[i + 1], command, result, copy.entries);
        }
        result.container =
            add(std::move(copy), container.base != no_id ? nodes_.at(container.base).container : built_.root);
        if (restricted) {
            restricted_.insert(result.container);
        }
        return nodes_.emplace(id, std::move(result)).first->second;
    }

    void command(Id id, Id container)
    {
        const Node &at = nodes_.at(container);
        Container leaf;
        std::vector<Condition> parts = at.fixed;
        for (Id ancestor = id; ancestor != no_id && from_.commands[ancestor].container != container;
             ancestor = from_.commands[ancestor].base) {
            assignments(ancestor, at, parts);
        }
        leaf.path = leaf.name = from_.commands[id].path;
        leaf.restriction = all_of(std::move(parts));
        const Id result = add(std::move(leaf), at.container);
        for (Id ancestor = id; ancestor != no_id; ancestor = from_.commands[ancestor].base) {
            for (const auto &[name, value] : from_.commands[ancestor].assignments) {
                built_.assigned[result].insert(name);
            }
        }
    }

    void assignments(Id command, const Node &at, std::vector<Condition> &parts)
    {
        for (const auto &[name, value] : from_.commands[command].assignments) {
            if (const auto parameter = at.names.find(name); parameter != at.names.end()) {
                equals(parameter->second, value, parts);
            }
        }
    }

    /// Require that a parameter has the value that the encoder makes of a text.
    void equals(Id parameter, std::string text, std::vector<Condition> &parts) const
    {
        const Type &type = built_.database.types[built_.database.parameters[parameter].type];
        const Encoding &encoding = type.encoding;
        if (encoding.kind == Encoding::Kind::none || encoding.kind == Encoding::Kind::binary ||
            encoding.calibrator.kind != Calibrator::Kind::none || !encoding.contexts.empty()) {
            return;
        }
        if (std::none_of(type.enumerators.begin(), type.enumerators.end(),
                         [&](const Enumerator &enumerator) { return enumerator.label == text; })) {
            std::vector<std::string> endings;
            for (const Enumerator &enumerator : type.enumerators) {
                if (enumerator.label.ends_with("_" + text)) {
                    endings.push_back(enumerator.label);
                }
            }
            text = endings.size() == 1 ? endings.front() : text;
        }
        Condition result;
        result.kind = Condition::Kind::compare;
        result.left.of = Reference::Of::parameter;
        result.left.parameter = parameter;
        result.literal = Literal(text);
        result.text = built_.database.parameters[parameter].name + " == " + text;
        parts.push_back(std::move(result));
    }

    // --- entries

    /// behind: [bits] of the entries that follow.
    void entry(Entry entry, std::size_t behind, Id owner, Node &at, std::vector<Entry> &result)
    {
        const bool plain = entry.include.kind == Condition::Kind::always && !entry.repeats;
        Size begin = plain && entry.offset.is_fixed() && entry.from == Entry::From::start ? Size(0) : at.end;
        begin = begin && plain && entry.offset.is_fixed() && entry.from != Entry::From::end
                    ? Size(*begin + static_cast<std::size_t>(entry.offset.fixed))
                    : std::nullopt;
        const Size bits = bits_of_entry(entry, owner);
        if (entry.from != Entry::From::end) {
            at.end = begin && bits ? Size(*begin + *bits) : std::nullopt;
        }
        if (entry.kind == Entry::Kind::fixed && plain && (entry.from != Entry::From::end || entry.bits <= 64)) {
            fixed(entry, at, result);
            return;
        }
        if (entry.kind == Entry::Kind::argument) {
            if (const Id type = type_of(entry.name, owner); type != no_id) {
                entry.kind = Entry::Kind::parameter;
                entry.id = argument(entry.name, type, behind, at);
                at.names[entry.name] = entry.id;
            }
        } else if (entry.kind == Entry::Kind::parameter && plain) {
            const Parameter &parameter = from_.parameters[entry.id];
            const auto &initial = parameter.initial ? parameter.initial : from_.types[parameter.type].initial;
            if (parameter.source == "constant" && initial && !is_set_by_the_sender(begin, bits)) {
                equals(entry.id, *initial, at.fixed);
            }
        }
        result.push_back(std::move(entry));
    }

    bool is_set_by_the_sender(Size begin, Size bits) const
    {
        const auto within = [&](std::size_t first, std::size_t end) {
            return begin && bits && *begin >= first && *begin + *bits <= end;
        };
        return (header_ != Header::none && (within(18, 32) || within(32, 48))) ||
               (header_ == Header::cfs && within(56, 64));
    }

    /// Replace a fixed value by unnamed numbers of up to 64 bits.
    void fixed(const Entry &whole, Node &at, std::vector<Entry> &result)
    {
        std::vector<std::uint8_t> bytes = whole.bytes;
        const std::size_t skip = 8 * bytes.size() - whole.bits;
        bytes.resize(bytes.size() + 16);
        for (std::size_t done = 0; done < whole.bits || done == 0;) {
            const auto n = static_cast<unsigned>(std::min<std::size_t>(64, whole.bits - done));
            Entry entry = done == 0 ? whole : Entry();
            if (n > 0) {
                Type type;
                type.is_signed = false;
                type.encoding.kind = Encoding::Kind::integer;
                type.encoding.bits = n;
                entry.kind = Entry::Kind::parameter;
                entry.id = parameter("", add_type(std::move(type)));
                entry.place = whole.place;
                equals(entry.id, std::to_string(load_bits(bytes.data(), skip + done, n)), at.fixed);
                at.fixed.back().text = "a fixed value of " + std::to_string(n) + " bits";
            }
            result.push_back(std::move(entry));
            done += std::max(n, 1u);
        }
    }

    /// The parameter of an argument.
    Id argument(const std::string &name, Id type_id, std::size_t behind, const Node &at)
    {
        Type type = built_.database.types[type_id];
        const Quantity size = type.encoding.size;
        const bool counted = size.from.of == Reference::Of::argument && !at.names.contains(size.from.name);
        const bool open = type.encoding.sized && !size.looked_up && (counted || (size.is_fixed() && size.fixed < 0));
        if (!open) {
            return parameter(name, type_id);
        }
        type.encoding.size = Quantity();
        type.encoding.size.from.of = Reference::Of::rest;
        type.encoding.size.intercept = -static_cast<double>(behind);
        const Id result = parameter(name, add_type(std::move(type)));
        if (counted && size.slope != 0) {
            built_.counters[result] = {size.from.name, size.slope, size.intercept};
        }
        return result;
    }

    Id parameter(const std::string &name, Id type)
    {
        Parameter result;
        result.name = result.path = name;
        result.type = type;
        built_.database.parameters.push_back(std::move(result));
        return static_cast<Id>(built_.database.parameters.size() - 1);
    }

    Id add_type(Type type)
    {
        built_.database.types.push_back(std::move(type));
        return static_cast<Id>(built_.database.types.size() - 1);
    }

    /// The type of an argument of a command or of a command that it extends.
    Id type_of(const std::string &name, Id command)
    {
        Id type_id = no_id;
        for (; command != no_id; command = from_.commands[command].base) {
            auto [own, fresh] = types_.try_emplace(command);
            for (const Argument &argument : fresh ? from_.commands[command].arguments : std::vector<Argument>()) {
                own->second[argument.name] = argument.type;
            }
            const auto type = own->second.find(name);
            type_id = type != own->second.end() ? type->second : type_id;
        }
        return type_id;
    }

    Size bits_of_entry(const Entry &entry, Id owner)
    {
        if (entry.include.kind != Condition::Kind::always || entry.repeats) {
            return std::nullopt;
        }
        switch (entry.kind) {
        case Entry::Kind::fixed: return entry.bits;
        case Entry::Kind::parameter: return bits_of_type(from_.parameters[entry.id].type, &entry.dimensions);
        case Entry::Kind::argument: {
            const Id type = type_of(entry.name, owner);
            return type != no_id ? bits_of_type(type, &entry.dimensions) : std::nullopt;
        }
        default: return std::nullopt;
        }
    }

    /// The bits of a type that is a part of others, which is computed once.
    Size bits_of_part(Id id)
    {
        const auto [known, fresh] = sizes_.try_emplace(id);
        if (fresh) {
            known->second = bits_of_type(id, nullptr);
        }
        return known->second;
    }

    Size bits_of_type(Id id, const std::vector<Dimension> *dimensions)
    {
        const Type &type = from_.types[id];
        if (type.sort == Sort::aggregate) {
            Size all = 0;
            for (const Member &member : type.members) {
                const Size bits = bits_of_part(member.type);
                all = all && bits ? Size(*all + *bits) : std::nullopt;
            }
            return all;
        }
        if (type.sort == Sort::array) {
            Size all = bits_of_part(type.element);
            for (const Dimension &dimension :
                 dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions) {
                const bool is_fixed = dimension.first.is_fixed() && dimension.last.is_fixed();
                all = all && is_fixed
                          ? Size(*all * static_cast<std::size_t>(dimension.last.fixed - dimension.first.fixed + 1))
                          : std::nullopt;
            }
            return all;
        }
        const Encoding &encoding = type.encoding;
        return encoding.bits != 0 ? Size(encoding.bits)
               : encoding.sized && encoding.size.is_fixed() && encoding.size.fixed >= 0
                   ? Size(static_cast<std::size_t>(encoding.size.fixed))
                   : std::nullopt;
    }

    const Database &from_;
    const Header header_;
    Built built_;
    std::map<Id, Id> owners_; ///< of containers: the command whose own it is
    std::map<Id, Node> nodes_;
    std::map<Id, Size> sizes_;                      ///< of types
    std::map<Id, std::map<std::string, Id>> types_; ///< of the arguments of each command
    std::set<Id> restricted_; ///< containers with own restrictions, beyond the constants that they inherit
};

CommandDecoder::CommandDecoder(const Database &database, Header header)
    : built_(Builder(database, header).take()), decoder_(built_.database)
{
}

CommandDecoder::Role CommandDecoder::role(const Decoded &packet, Id id) const
{
    const std::string &name = built_.database.parameters[id].name;
    if (id < built_.first_argument) {
        return Role::header;
    }
    const auto assigned = built_.assigned.find(packet.container);
    const bool given = !name.empty() && (assigned == built_.assigned.end() || !assigned->second.contains(name));
    return given ? Role::given : Role::assigned;
}

std::optional<std::pair<std::string, double>> CommandDecoder::counter(const Decoded &packet, std::size_t field) const
{
    const auto found = built_.counters.find(packet.fields[field].parameter);
    if (found == built_.counters.end()) {
        return std::nullopt;
    }
    const auto bits = static_cast<double>(8 * (packet.raw[field] & 0xFFFFFFFF));
    return std::pair(found->second.name, (bits - found->second.intercept) / found->second.slope);
}

} // namespace fledge::ground
