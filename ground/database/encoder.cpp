// SPDX-License-Identifier: Apache-2.0
#include "ground/database/encoder.h"

#include "ground/database/calibrate.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

namespace fledge::ground {

namespace {

using Sort = Type::Sort;

constexpr std::size_t most_bits = 8 * 65542; // of a packet

std::string shown(double x)
{
    char text[32];
    return {text, std::to_chars(text, text + sizeof text, x).ptr};
}

template <class Number> std::optional<Number> parsed(std::string_view text, int base = 10)
{
    Number value{};
    std::from_chars_result done{};
    if constexpr (std::is_integral_v<Number>) {
        const bool hex = text.starts_with("0x");
        text.remove_prefix(hex ? 2 : 0);
        done = std::from_chars(text.data(), text.data() + text.size(), value, hex ? 16 : base);
    } else {
        done = std::from_chars(text.data(), text.data() + text.size(), value);
    }
    return done.ec == std::errc() && done.ptr == text.data() + text.size() && !text.empty() ? std::optional(value)
                                                                                            : std::nullopt;
}

class Encoder {
public:
    Encoder(const Database &database, Id command, const std::map<std::string, Given> &given)
        : db_(database), command_(database.commands[command]), given_(given)
    {
        std::vector<const Command *> chain;
        Id container = no_id;
        for (Id at = command; at != no_id; at = db_.commands[at].base) {
            chain.push_back(&db_.commands[at]);
            container = container != no_id ? container : db_.commands[at].container;
        }
        if (command_.is_abstract || container == no_id) {
            throw Refusal(command_.path +
                          (command_.is_abstract ? " is abstract: give a command that extends it" : " has no packet"));
        }
        for (const Command *step : chain) {
            for (const auto &[name, value] : step->assignments) {
                if (given_.contains(name)) {
                    throw Refusal(step->path + " fixes the argument " + name + ": do not give it");
                }
                values_.try_emplace(name, text(value));
            }
        }
        std::string missing;
        for (const Command *step : chain) {
            for (const Argument &argument : step->arguments) {
                const auto &initial = argument.initial ? argument.initial : db_.types[argument.type].initial;
                types_[argument.name] = argument.type;
                if (const auto value = given_.find(argument.name); value != given_.end()) {
                    values_[argument.name] = value->second;
                    used_.push_back(argument.name);
                } else if (!values_.contains(argument.name) && initial) {
                    values_[argument.name] = text(*initial);
                } else if (!values_.contains(argument.name) && db_.types[argument.type].sort == Sort::aggregate) {
                    values_[argument.name].kind = Given::Kind::members; // whose members may have initial values
                } else if (!values_.contains(argument.name)) {
                    missing += (missing.empty() ? "" : ", ") + argument.name;
                }
            }
        }
        if (!missing.empty()) {
            throw Refusal(command_.path + " needs " + missing);
        }
        std::size_t at = 0;
        packet(container, at, false);
        for (const auto &[name, value] : given_) {
            if (std::find(used_.begin(), used_.end(), name) == used_.end()) {
                throw Refusal(command_.path + " has no argument " + name);
            }
        }
    }

    std::vector<std::uint8_t> bytes; ///< of the packet
    std::vector<Placed> places;

private:
    static Given text(const std::string &value)
    {
        Given result;
        result.kind = Given::Kind::text;
        result.text = value;
        return result;
    }

    // --- the packet

    /// Write the entries of a container. Entries that are placed from the end, with those that follow them, lie behind
    /// all others, and determine the length of the packet.
    void packet(Id container, std::size_t &at, bool included)
    {
        std::vector<const Container *> chain;
        for (Id id = container; id != no_id; id = db_.containers[id].base) {
            chain.push_back(&db_.containers[id]);
            fixed_by(chain.back()->restriction);
        }
        const std::size_t start = at;
        std::size_t most = at;
        std::vector<std::vector<const Entry *>> tails;
        for (std::size_t i = chain.size(); i-- > 0;) {
            bool back = false;
            for (const Entry &next : chain[i]->entries) {
                if (next.from == Entry::From::end && holds(next.include)) {
                    tails.emplace_back();
                }
                back = next.from == Entry::From::end ? back || holds(next.include)
                                                     : back && next.from == Entry::From::previous;
                if (back) {
                    tails.back().push_back(&next);
                } else {
                    entry(next, at, start);
                    most = std::max(most, at);
                }
            }
        }
        if (tails.empty()) {
            return;
        }
        if (included) {
            throw Refusal(db_.where(tails[0][0]->place) +
                          ": an entry at the end of a container that is in another is not encoded");
        }
        const auto front = bytes;
        const auto placed = places;
        std::vector<std::int64_t> behind; // how far before the packet's end each begins
        std::int64_t end = static_cast<std::int64_t>(most);
        for (const auto &tail : tails) {
            std::size_t to = most;
            entry(*tail[0], to, start);
            behind.push_back(static_cast<std::int64_t>(to - most) + number(tail[0]->offset));
            end = std::max(end, static_cast<std::int64_t>(most) + behind.back());
            bytes = front;
            places = placed;
        }
        end = (end + 7) / 8 * 8;
        for (std::size_t i = 0; i < tails.size(); i++) {
            std::size_t to = static_cast<std::size_t>(end - behind[i]);
            for (const Entry *next : tails[i]) {
                entry(*next, to, start);
            }
            if (to > static_cast<std::size_t>(end)) {
                throw Refusal(db_.where(tails[i][0]->place) + ": the entry ends behind the packet");
            }
        }
        bytes.resize(static_cast<std::size_t>(end) / 8);
        at = static_cast<std::size_t>(end);
    }

    /// A restriction to a value sets the parameter to this value; the most derived container's has priority.
    void fixed_by(const Condition &condition)
    {
        if (condition.kind == Condition::Kind::compare && condition.op == Operator::equal &&
            condition.right.of == Reference::Of::nothing && condition.left.of == Reference::Of::parameter) {
            restrictions_.try_emplace({condition.left.parameter, condition.left.steps}, text(condition.literal.text));
        } else if (condition.kind == Condition::Kind::all) {
            for (const Condition &part : condition.parts) {
                fixed_by(part);
            }
        }
    }

    void entry(const Entry &entry, std::size_t &at, std::size_t start)
    {
        if (!holds(entry.include)) {
            return;
        }
        const std::int64_t n = entry.repeats ? number(entry.count) : 1, gap = entry.repeats ? number(entry.gap) : 0;
        std::int64_t from = static_cast<std::int64_t>(entry.from == Entry::From::start ? start : at) +
                            (entry.from == Entry::From::end ? 0 : number(entry.offset)); // then `at` is its place
        for (std::int64_t i = 0; i < n; i++) {
            if (from < 0 || from > static_cast<std::int64_t>(most_bits) || ++entries_ > most_bits) {
                throw Refusal(db_.where(entry.place) + ": the entry is outside of a packet");
            }
            at = static_cast<std::size_t>(from);
            once(entry, at);
            from = static_cast<std::int64_t>(at) + gap;
        }
    }

    void once(const Entry &entry, std::size_t &at)
    {
        switch (entry.kind) {
        case Entry::Kind::container: packet(entry.id, at, true); break;
        case Entry::Kind::fixed:
            for (std::size_t i = 0; i < entry.bits; i++) { // the value ends with the last bit of its last byte
                const std::size_t bit = 8 * entry.bytes.size() - entry.bits + i;
                put(at, 1, entry.bytes[bit / 8] >> (7 - bit % 8) & 1u);
            }
            break;
        case Entry::Kind::argument: {
            const auto type = types_.find(entry.name);
            if (type == types_.end()) {
                throw Refusal(db_.where(entry.place) + ": " + command_.path + " has no argument " + entry.name);
            }
            const std::size_t from = at;
            value(type->second, values_.at(entry.name), entry.name, at, &entry.dimensions);
            places.push_back({entry.name, true, from, at - from});
            break;
        }
        case Entry::Kind::parameter: {
            const std::size_t from = at;
            parameter(entry, at);
            places.push_back({db_.parameters[entry.id].name, false, from, at - from});
            break;
        }
        case Entry::Kind::indirect: throw Refusal(db_.where(entry.place) + ": a command has no indirect parameters");
        }
    }

    void parameter(const Entry &entry, std::size_t &at)
    {
        const Parameter &parameter = db_.parameters[entry.id];
        parameter_ = entry.id;
        steps_.clear();
        if (const auto given = given_.find(parameter.name); given != given_.end()) {
            used_.push_back(parameter.name);
            value(parameter.type, given->second, parameter.name, at, &entry.dimensions);
        } else if (const Given *known = known_value(parameter); known != nullptr) {
            value(parameter.type, *known, parameter.name, at, &entry.dimensions);
        } else {
            throw Refusal(command_.path + " needs " + parameter.name + ", which has no initial value");
        }
        parameter_ = no_id;
    }

    const Given *known_value(const Parameter &parameter)
    {
        const Type &type = db_.types[parameter.type];
        const auto &initial = parameter.initial ? parameter.initial : type.initial;
        if (const auto fixed = restrictions_.find({static_cast<Id>(&parameter - db_.parameters.data()), {}});
            fixed != restrictions_.end()) {
            return &fixed->second;
        }
        if (initial || type.sort == Sort::aggregate) {
            Given result = initial ? text(*initial) : Given();
            result.kind = initial ? result.kind : Given::Kind::members;
            return &initials_.insert_or_assign(&parameter - db_.parameters.data(), result).first->second;
        }
        return nullptr;
    }

    void put(std::size_t &at, std::size_t bits, std::uint64_t value)
    {
        if (at + bits > most_bits) {
            throw Refusal(command_.path + " is longer than a packet");
        }
        if (bytes.size() < (at + bits + 7) / 8) {
            bytes.resize((at + bits + 7) / 8);
        }
        if (bits > 0) {
            store_bits(bytes.data(), at, static_cast<unsigned>(bits), value);
        }
        at += bits;
    }

    // --- values

    void value(Id id, const Given &given, const std::string &name, std::size_t &at,
               const std::vector<Dimension> *dimensions)
    {
        const Type &type = db_.types[id];
        if (type.sort == Sort::aggregate) {
            members(type, given, name, at);
        } else if (type.sort == Sort::array) {
            array(type, given, name, at, dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions);
        } else if (type.encoding.kind == Encoding::Kind::none || !type.encoding.algorithm.empty()) {
            throw Refusal(
                name + (type.encoding.algorithm.empty()
                            ? " has no encoding"
                            : " is encoded by the algorithm " + type.encoding.algorithm + ", which is not computed"));
        } else if (type.encoding.kind == Encoding::Kind::text || type.encoding.kind == Encoding::Kind::binary) {
            bytes_of(type, given, name, at);
        } else {
            number(type, given, name, at);
        }
    }

    void members(const Type &type, const Given &given, const std::string &name, std::size_t &at)
    {
        if (given.kind != Given::Kind::members) {
            throw Refusal(name + " has members: give a value for each");
        }
        std::size_t taken = 0;
        for (std::size_t i = 0; i < type.members.size(); i++) {
            const Member &member = type.members[i];
            const std::string path = name + "." + member.name;
            const auto own = std::find(given.names.begin(), given.names.end(), member.name);
            taken += own != given.names.end();
            steps_.push_back(static_cast<std::uint32_t>(i));
            const auto fixed = restrictions_.find({parameter_, steps_});
            const auto &initial = member.initial ? member.initial : db_.types[member.type].initial;
            if (own != given.names.end()) {
                value(member.type, given.list[static_cast<std::size_t>(own - given.names.begin())], path, at, nullptr);
            } else if (fixed != restrictions_.end() && parameter_ != no_id) {
                value(member.type, fixed->second, path, at, nullptr);
            } else if (initial) {
                value(member.type, text(*initial), path, at, nullptr);
            } else {
                throw Refusal(command_.path + " needs " + path);
            }
            steps_.pop_back();
        }
        if (taken != given.names.size()) {
            throw Refusal(name + " has other members than those given");
        }
    }

    void array(const Type &type, const Given &given, const std::string &name, std::size_t &at,
               const std::vector<Dimension> &dimensions)
    {
        Wide n = 1;
        for (const Dimension &dimension : dimensions) {
            n *= Wide(number(dimension.last)) - number(dimension.first) + 1;
            n = std::min(std::max(n, Wide(0)), Wide(most_bits));
        }
        if (given.kind != Given::Kind::list || given.list.size() != static_cast<std::size_t>(n)) {
            throw Refusal(name + " has " + std::to_string(static_cast<std::size_t>(n)) + " elements; found " +
                          (given.kind == Given::Kind::list ? std::to_string(given.list.size()) : "no list"));
        }
        for (std::size_t i = 0; i < given.list.size(); i++) {
            steps_.push_back(static_cast<std::uint32_t>(i));
            value(type.element, given.list[i], name + "[" + std::to_string(i) + "]", at, nullptr);
            steps_.pop_back();
        }
    }

    struct Number {
        std::optional<Wide> whole; ///< exact, if it is a whole number
        double real;
    };

    static std::optional<Number> plain(const Given &given)
    {
        switch (given.kind) {
        case Given::Kind::integer: return Number{given.integer, static_cast<double>(given.integer)};
        case Given::Kind::real: return Number{std::nullopt, given.real};
        case Given::Kind::text:
            if (const auto whole = parsed<std::int64_t>(given.text)) {
                return Number{*whole, static_cast<double>(*whole)};
            }
            if (const auto large = parsed<std::uint64_t>(given.text)) {
                return Number{*large, static_cast<double>(*large)};
            }
            if (const auto real = parsed<double>(given.text)) {
                return Number{std::nullopt, *real};
            }
            return std::nullopt;
        default: return std::nullopt;
        }
    }

    Number number_of(const Type &type, const Given &given, const std::string &name) const
    {
        const auto number = plain(given);
        if (type.sort == Sort::enumerated) {
            std::string all;
            std::vector<std::int64_t> endings; // of labels that end with the text, as FIELD_WMM with WMM
            for (const Enumerator &enumerator : type.enumerators) {
                if (given.kind == Given::Kind::text ? enumerator.label == given.text
                                                    : number && number->whole && *number->whole >= enumerator.low &&
                                                          *number->whole <= enumerator.high) {
                    return given.kind == Given::Kind::text ? Number{enumerator.low, static_cast<double>(enumerator.low)}
                                                           : *number;
                }
                if (given.kind == Given::Kind::text && enumerator.label.ends_with("_" + given.text)) {
                    endings.push_back(enumerator.low);
                }
                all += (all.empty() ? "" : ", ") + enumerator.label;
            }
            if (endings.size() == 1) {
                return Number{endings.front(), static_cast<double>(endings.front())};
            }
            if (!number || given.kind != Given::Kind::text) { // restrictions may have a label's raw value as text
                throw Refusal(name + " must be one of " + all);
            }
            Given raw;
            raw.integer = number->whole.value_or(0);
            return number_of(type, raw, name);
        }
        if (type.sort == Sort::boolean && given.kind == Given::Kind::text) {
            const bool is_true =
                given.text == type.one_label || given.text == "true" || given.text == "True" || given.text == "1";
            if (!is_true && given.text != type.zero_label && given.text != "false" && given.text != "False" &&
                given.text != "0") {
                throw Refusal(name + " must be " + type.zero_label + " or " + type.one_label + "; found " + given.text);
            }
            return {is_true, is_true ? 1. : 0.};
        }
        if (type.sort == Sort::boolean && number && (!number->whole || (*number->whole != 0 && *number->whole != 1))) {
            throw Refusal(name + " must be 0 or 1; found " + shown(number->real));
        }
        if (!number || (number->real != number->real && type.encoding.kind != Encoding::Kind::real)) {
            throw Refusal(name + " must be a number");
        }
        if (type.sort == Sort::integer && !number->whole) {
            if (number->real != std::trunc(number->real)) {
                throw Refusal(name + " must be a whole number; found " + shown(number->real));
            }
        }
        return *number;
    }

    void in_range(const Type &type, const std::string &name, double x, bool calibrated) const
    {
        bool any = false, holds = false;
        std::string ranges;
        for (const Range &range : type.valid) {
            if (range.calibrated == calibrated) {
                any = true;
                holds = holds || range.holds(x);
                ranges += (ranges.empty() ? "" : " or ") + std::string(range.low_open ? "above " : "from ") +
                          shown(range.low) + (range.high_open ? " to below " : " to ") + shown(range.high);
            }
        }
        if (any && !holds) {
            throw Refusal(name + " must be " + ranges + (calibrated ? "" : " as a raw number") + "; found " + shown(x));
        }
    }

    void number(const Type &type, const Given &given, const std::string &name, std::size_t &at)
    {
        const Encoding &encoding = type.encoding;
        Number raw = number_of(type, given, name);
        known_.emplace_back(name.substr(name.rfind('.') + 1), raw.real);
        in_range(type, name, raw.real, true);
        const Calibrator *calibrator = &encoding.calibrator;
        for (const auto &[condition, other] : encoding.contexts) {
            if (holds(condition)) {
                calibrator = &other;
                break;
            }
        }
        if (type.sort == Sort::absolute_time || type.sort == Sort::relative_time) {
            if (type.offset_from.of != Reference::Of::nothing) {
                throw Refusal(name + " is relative to another time: that is not encoded");
            }
            raw = {std::nullopt, (raw.real - type.offset) / type.scale};
            if (const auto whole = plain(given)->whole; whole && type.scale == std::trunc(type.scale) &&
                                                        std::abs(type.scale) < 1e15 && std::abs(type.offset) < 1e15 &&
                                                        type.offset == std::trunc(type.offset)) {
                const Wide excess = *whole - static_cast<Wide>(type.offset), by = static_cast<Wide>(type.scale);
                if (excess % by == 0) { // else a fraction, rounded below
                    raw.whole = excess / by;
                }
            }
        } else if (calibrator->kind != Calibrator::Kind::none) {
            const auto result =
                calibrated(*calibrator, raw.real, [&](const Reference &reference) { return real_of(reference); });
            if (!result) {
                throw Refusal(name + " has no raw number for " + shown(raw.real));
            }
            raw = {std::nullopt, *result};
        }
        in_range(type, name, raw.real, false);
        const auto bits = raw.whole && encoding.kind == Encoding::Kind::integer ? bits_of(encoding, *raw.whole)
                                                                                : bits_of(encoding, raw.real);
        if (!bits) {
            throw Refusal(name + " has " + std::to_string(encoding.bits) + " bits, too few for " + shown(raw.real));
        }
        put(at, encoding.bits, *bits);
    }

    void bytes_of(const Type &type, const Given &given, const std::string &name, std::size_t &at)
    {
        const Encoding &encoding = type.encoding;
        const bool is_text = encoding.kind == Encoding::Kind::text;
        std::vector<std::uint8_t> content = given.bytes;
        if (given.kind == Given::Kind::text && type.sort == Sort::binary) {
            for (std::size_t i = 0; i < given.text.size(); i += 2) {
                const auto byte = parsed<std::uint8_t>(std::string_view(given.text).substr(i, 2), 16);
                if (!byte || given.text.size() % 2 != 0) {
                    throw Refusal(name + " must be bytes, or text of two hexadecimal digits for each");
                }
                content.push_back(*byte);
            }
        } else if (given.kind == Given::Kind::text || given.kind == Given::Kind::integer ||
                   given.kind == Given::Kind::real) {
            if (type.sort != Sort::text) { // numbers as text
                number_of(type, given, name);
            }
            const std::string digits = given.kind == Given::Kind::text ? given.text
                                       : given.kind == Given::Kind::integer
                                           ? std::to_string(static_cast<std::int64_t>(given.integer))
                                           : shown(given.real);
            const auto result = type.sort == Sort::text && given.kind != Given::Kind::text
                                    ? std::nullopt
                                    : characters(is_text ? encoding.charset : Charset::utf8, digits);
            if (!result) {
                throw Refusal(name + " must be text of its character set; found " + digits);
            }
            content = *result;
        } else if (given.kind != Given::Kind::bytes) {
            throw Refusal(name + " must be text or bytes");
        }
        const std::size_t n = 8 * content.size();
        std::optional<std::size_t> room;
        if (encoding.sized) {
            const std::int64_t size = number(encoding.size);
            if (size < -1 || size > static_cast<std::int64_t>(most_bits)) {
                throw Refusal(name + " has a size of " + std::to_string(size) + " bits");
            }
            room = size < 0 ? n : static_cast<std::size_t>(size);
        }
        const auto complain = [&](const std::string &wanted) {
            throw Refusal(name + " must have " + wanted + " bytes; found " + std::to_string(content.size()));
        };
        if (!is_text || (encoding.terminator.empty() && encoding.size_tag == 0)) {
            if (n != (*room + 7) / 8 * 8) {
                complain(std::to_string((*room + 7) / 8));
            }
            for (std::size_t i = 0; i < content.size(); i++) { // the value ends with its last byte
                put(at, i == 0 && *room % 8 != 0 ? *room % 8 : 8, content[i]);
            }
            return;
        }
        const std::size_t unit = unit_of(encoding.charset), end = encoding.terminator.size();
        std::size_t most = encoding.most_bits != 0 ? std::min<std::size_t>(encoding.most_bits, room.value_or(most_bits))
                                                   : room.value_or(most_bits);
        const std::size_t begin = at;
        if (encoding.size_tag != 0) {
            most = std::min(most - std::min<std::size_t>(most, encoding.size_tag),
                            8 * ((std::size_t(1) << std::min(encoding.size_tag, 20u)) - 1));
            if (n > most) {
                complain("at most " + std::to_string(most / 8));
            }
            put(at, encoding.size_tag, content.size());
        } else {
            most -= room ? 0 : std::min(most, 8 * end);
            if (n > most) {
                complain("at most " + std::to_string(most / 8));
            }
            for (std::size_t i = 0; i + end <= content.size(); i += unit) {
                if (std::equal(encoding.terminator.begin(), encoding.terminator.end(),
                               content.begin() + static_cast<std::ptrdiff_t>(i))) {
                    throw Refusal(name + " contains the character that ends it");
                }
            }
            if (!room || n + 8 * end <= *room) {
                content.insert(content.end(), encoding.terminator.begin(), encoding.terminator.end());
            }
        }
        for (const std::uint8_t byte : content) {
            put(at, 8, byte);
        }
        while (room && at < begin + *room) {
            put(at, std::min<std::size_t>(8, begin + *room - at), 0);
        }
    }

    // --- references and conditions

    const Given *find(const Reference &reference)
    {
        if (reference.of == Reference::Of::argument) {
            const auto argument = values_.find(reference.name);
            return argument != values_.end() ? &argument->second : nullptr;
        }
        const Parameter &parameter = db_.parameters[reference.parameter];
        const auto given = given_.find(parameter.name);
        const Given *at = given != given_.end() ? &given->second : known_value(parameter);
        for (const std::uint32_t step : reference.steps) {
            if (at != nullptr && at->kind == Given::Kind::list && step < at->list.size()) {
                at = &at->list[step];
                continue;
            }
            at = nullptr;
        }
        return at;
    }

    std::optional<double> real_of(const Reference &reference)
    {
        if (reference.of == Reference::Of::argument) {
            for (std::size_t i = known_.size(); i-- > 0;) { // the nearest member or argument first
                if (known_[i].first == reference.name) {
                    return known_[i].second;
                }
            }
        }
        const Given *const given = find(reference);
        const auto number = given != nullptr ? plain(*given) : std::nullopt;
        return number ? std::optional(number->real) : std::nullopt;
    }

    std::int64_t number(const Quantity &quantity)
    {
        if (quantity.looked_up) {
            for (const auto &[condition, value] : quantity.cases) {
                if (holds(condition)) {
                    return value;
                }
            }
            throw Refusal(command_.path + ": no case of a lookup fits");
        }
        if (quantity.is_fixed()) {
            return quantity.fixed;
        }
        const auto found = real_of(quantity.from);
        return found ? nearest(*found * quantity.slope + quantity.intercept)
                     : throw Refusal(command_.path + " needs a number for " + quantity.from.name);
    }

    bool holds(const Condition &condition)
    {
        const auto part_holds = [&](const Condition &part) { return holds(part); };
        switch (condition.kind) {
        case Condition::Kind::always: return true;
        case Condition::Kind::all: return std::all_of(condition.parts.begin(), condition.parts.end(), part_holds);
        case Condition::Kind::any: return std::any_of(condition.parts.begin(), condition.parts.end(), part_holds);
        case Condition::Kind::compare: break;
        }
        const Given *const left = find(condition.left);
        const Given literal = text(condition.literal.text);
        const Given *const right = condition.right.of == Reference::Of::nothing ? &literal : find(condition.right);
        if (left == nullptr || right == nullptr) {
            return false;
        }
        const auto a = plain(*left), b = plain(*right);
        const int order = a && b ? (a->real > b->real) - (a->real < b->real) : left->text.compare(right->text);
        switch (condition.op) {
        case Operator::equal: return order == 0;
        case Operator::unequal: return order != 0;
        case Operator::less: return order < 0;
        case Operator::at_most: return order <= 0;
        case Operator::more: return order > 0;
        case Operator::at_least: return order >= 0;
        }
        return false;
    }

    const Database &db_;
    const Command &command_;
    const std::map<std::string, Given> &given_;
    std::map<std::string, Given> values_;
    std::map<std::string, Id> types_;
    std::map<std::pair<Id, std::vector<std::uint32_t>>, Given> restrictions_;
    std::map<std::ptrdiff_t, Given> initials_;
    std::vector<std::string> used_;
    std::vector<std::pair<std::string, double>> known_; ///< numbers that were written, in their order
    std::vector<std::uint32_t> steps_;                  ///< into the parameter that is being written
    Id parameter_ = no_id;
    std::size_t entries_ = 0;
};

} // namespace

std::vector<std::uint8_t> encode(const Database &database, Id command, const std::map<std::string, Given> &given,
                                 std::vector<Placed> *places)
{
    Encoder done(database, command, given);
    if (places != nullptr) {
        *places = std::move(done.places);
    }
    return std::move(done.bytes);
}

} // namespace fledge::ground
