// SPDX-License-Identifier: Apache-2.0
#include "ground/database/encoder.h"

#include "ground/database/calibrate.h"
#include "ground/database/decoder.h"
#include "ground/database/operand.h"
#include "ground/database/times.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>
#include <vector>

namespace fledge::ground {

namespace {

using Sort = Type::Sort;

constexpr std::size_t most_bits = 8 * 65542; // of a packet

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
    /// A text of the database.
    static Given text(const std::string &value)
    {
        Given result;
        result.kind = Given::Kind::text;
        result.text = value;
        result.of_database = true;
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

    /// An argument, and the members by which a condition may name a part of it.
    void leave_out(const std::string &name, Id type)
    {
        if (left_out_.insert(name).second) {
            for (const Member &member : db_.types[type].members) {
                if (!types_.contains(member.name)) { // an argument of that name is another value
                    leave_out(member.name, member.type);
                }
            }
        }
    }

    void entry(const Entry &entry, std::size_t &at, std::size_t start)
    {
        if (!holds(entry.include)) {
            if (const auto type = types_.find(entry.name);
                entry.kind == Entry::Kind::argument && type != types_.end()) {
                leave_out(entry.name, type->second);
            }
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
            root_ = entry.name.size();
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
        root_ = parameter.name.size();
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
        if (type.sort == Sort::aggregate && !initial) {
            return &members_;
        }
        return initial ? constant(*initial) : nullptr;
    }

    /// A text of the database as a value.
    const Given *constant(const std::string &written)
    {
        return &constants_.try_emplace(&written, text(written)).first->second;
    }

    /// The given, fixed or initial value of a member; nullptr: it has none.
    const Given *member_of(const Given &given, const Member &member,
                           const std::pair<Id, std::vector<std::uint32_t>> &place)
    {
        const auto own = std::find(given.names.begin(), given.names.end(), member.name);
        const auto fixed = restrictions_.find(place);
        const auto &initial = member.initial ? member.initial : db_.types[member.type].initial;
        return own != given.names.end() ? &given.list[static_cast<std::size_t>(own - given.names.begin())]
               : fixed != restrictions_.end() && place.first != no_id ? &fixed->second
               : initial                                              ? constant(*initial)
                                                                      : nullptr;
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
        } else {
            Known &known = known_.emplace_back();
            known.root = root_;
            make(known, type, given, name);
            if (type.encoding.kind == Encoding::Kind::text || type.encoding.kind == Encoding::Kind::binary) {
                put_bytes(type, known.content, name, at);
            } else {
                put(at, type.encoding.bits, known.bits);
            }
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
            taken += std::find(given.names.begin(), given.names.end(), member.name) != given.names.end();
            steps_.push_back(static_cast<std::uint32_t>(i));
            const Given *const own = member_of(given, member, {parameter_, steps_});
            if (own == nullptr) {
                throw Refusal(command_.path + " needs " + path);
            }
            value(member.type, *own, path, at, nullptr);
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

    /// A value that the packet has, in units and raw, as conditions, sizes and calibrators see it.
    struct Known {
        std::string name, text;
        std::vector<std::uint8_t> content; ///< of text and binary
        std::uint64_t bits = 0;            ///< of others
        Operand value{}, raw{};            ///< raw: of no kind while the value is made
        std::size_t root = 0;              ///< characters of the argument's or the parameter's own name

        /// Whether a name means it: its path, or the end of that behind its root.
        bool is(const std::string &reference) const
        {
            return name == reference || (name.ends_with("." + reference) && name.size() - reference.size() > root);
        }
    };

    static std::optional<Number> plain(const Given &given)
    {
        switch (given.kind) {
        case Given::Kind::integer: return given.integer;
        case Given::Kind::real: return given.real;
        case Given::Kind::text: return number_in(given.text);
        default: return std::nullopt;
        }
    }

    /// The number of a value in units: of a label its raw number, of a time [ns].
    Number number_of(const Type &type, const Given &given, const std::string &name) const
    {
        const bool is_text = given.kind == Given::Kind::text;
        auto number = plain(given);
        if (number && type.sort != Sort::real && !is_time(type)) {
            number = number->is_whole() ? number : exactly(number->real());
        }
        if (type.sort == Sort::enumerated) {
            std::string all;
            std::vector<std::int64_t> endings; // of labels that end with the text, as FIELD_WMM with WMM
            for (const Enumerator &enumerator : type.enumerators) {
                if (is_text && enumerator.label == given.text) {
                    return enumerator.low;
                }
                if (is_text && enumerator.label.ends_with("_" + given.text)) {
                    endings.push_back(enumerator.low);
                }
                all += (all.empty() ? "" : ", ") + enumerator.label;
            }
            if (endings.size() == 1) {
                return endings.front();
            }
            return number && number->is_whole() && operand_of(type, *number).word != no_id
                       ? *number
                       : throw Refusal(name + " must be one of " + all);
        }
        if (type.sort == Sort::boolean) {
            const auto is_true = is_text ? truth(type, given.text) : std::nullopt;
            if (is_text && !is_true) {
                throw Refusal(name + " must be " + type.zero_label + " or " + type.one_label + "; found " + given.text);
            }
            if (!is_text && number && *number != 0 && *number != 1) {
                throw Refusal(name + " must be 0 or 1; found " + text_of(*number));
            }
            number = is_true ? std::optional<Number>(*is_true) : number;
        }
        if (is_text && is_time(type)) {
            const std::string_view words = trimmed(given.text);
            const auto ns = time_of(type, words);
            const bool in_ns = words.find_first_not_of("+-0123456789") == std::string::npos;
            if (!ns && (!number || !(in_ns || given.of_database))) {
                throw Refusal(name +
                              (value_kind(type) == Kind::time
                                   ? " must be a date, as 2026-03-01T12:00:00.5Z, or [ns] since 1970 UTC"
                                   : " must be a duration, as 1.5 s or PT1.5S, or [ns]") +
                              "; found " + given.text);
            }
            number = ns ? Number(*ns) : given.of_database ? *number * one_second : *number;
        } else if (is_time(type) && number && std::isfinite(number->real()) &&
                   number->real() != std::trunc(number->real())) {
            throw Refusal(name + " must be whole ns; found " + text_of(*number));
        }
        if (!number || (*number != *number && type.encoding.kind != Encoding::Kind::real)) {
            throw Refusal(name + " must be a number");
        }
        if (type.sort == Sort::integer && !number->is_whole()) {
            throw Refusal(name + " must be a whole number; found " + text_of(*number));
        }
        if (type.sort == Sort::integer && !type.is_signed && type.encoding.kind == Encoding::Kind::text &&
            *number < 0) {
            throw Refusal(name + " must not be negative; found " + text_of(*number));
        }
        return *number;
    }

    void in_range(const Type &type, const std::string &name, const Number &x, bool calibrated) const
    {
        bool any = false, holds = false;
        std::string ranges;
        for (const Range &range : type.valid) {
            if (range.calibrated == calibrated) {
                any = true;
                holds = holds || range.holds(x);
                ranges += (ranges.empty() ? "" : " or ") + std::string(range.low_open ? "above " : "from ") +
                          text_of(range.low) + (range.high_open ? " to below " : " to ") + text_of(range.high);
            }
        }
        if (any && !holds) {
            throw Refusal(name + " must be " + ranges + (calibrated ? "" : " as a raw number") + "; found " +
                          text_of(x));
        }
    }

    static bool is_time(const Type &type)
    {
        return type.sort == Sort::absolute_time || type.sort == Sort::relative_time;
    }

    /// The raw number of a time or a duration [ns]. early: [ns] of a time within a leap second.
    static Number raw_time(const Type &type, const Number &number, const std::string &name, std::int64_t early)
    {
        if (type.offset_from.of != Reference::Of::nothing) {
            throw Refusal(name + " is relative to another time: that is not encoded");
        }
        const auto utc = number.nearest();
        if (!utc) {
            throw Refusal(name + " must be a time; found " + text_of(number));
        }
        const Number since =
            type.epoch ? Number((type.epoch->leap_seconds ? tai_of_utc(*utc) - early : *utc) - type.epoch->ns) : number;
        const Number excess = since - exactly(type.offset), scale = exactly(type.scale);
        if (excess.is_whole() && scale.is_whole() && scale != 0 && excess.whole() % scale.whole() == 0) {
            return excess.whole() / scale.whole();
        }
        const long double raw = (since.extended() - type.offset) / type.scale; // a double has too few digits
        return type.encoding.kind == Encoding::Kind::integer && std::abs(raw) < 1.8e19L
                   ? Number(static_cast<Wide>(std::round(raw)))
                   : Number(static_cast<double>(raw));
    }

    /// The raw number of a number in units.
    Number raw_of(const Type &type, const Number &number, const Given &given, const std::string &name)
    {
        if (is_time(type)) {
            const bool leaps = given.kind == Given::Kind::text && is_leap_second(trimmed(given.text));
            return raw_time(type, number, name, leaps ? one_second : 0);
        }
        const Calibrator *calibrator = &type.encoding.calibrator;
        for (const auto &[condition, other] : type.encoding.contexts) {
            if (holds(condition)) {
                calibrator = &other;
                break;
            }
        }
        const auto raw = calibrated(*calibrator, number, [&](const Reference &reference) {
            const Operand *const found = find(reference);
            return found != nullptr ? ground::number_of(*found) : std::nullopt;
        });
        return raw ? *raw : throw Refusal(name + " has no raw number for " + text_of(number));
    }

    /// Make a value's bits or bytes, and what conditions may compare.
    void make(Known &known, const Type &type, const Given &given, const std::string &name)
    {
        known.name = name;
        const Encoding &encoding = type.encoding;
        const bool is_number = encoding.kind == Encoding::Kind::integer || encoding.kind == Encoding::Kind::real;
        if (!is_number && (type.sort == Sort::text || type.sort == Sort::binary)) {
            make_bytes(known, type, given);
            return;
        }
        const Number number = number_of(type, given, name);
        known.value = operand_of(type, number);
        in_range(type, name, number, true);
        const Number raw =
            is_number || type.sort == Sort::real || is_time(type) ? raw_of(type, number, given, name) : number;
        in_range(type, name, raw, false);
        if (!is_number) {
            known.text = known.value.kind == Kind::label || known.value.kind == Kind::boolean ? shown(known.value)
                                                                                              : text_of(raw);
            known.content = characters_of(type, known.text, name);
            known.raw = {.kind = Kind::text, .word = 0, .type = &type, .text = known.text};
            return;
        }
        const auto bits = bits_of(encoding, raw);
        if (!bits) {
            throw Refusal(name + " has " + std::to_string(encoding.bits) + " bits, too few for " + text_of(raw));
        }
        known.bits = *bits;
        known.raw = {raw_kind(encoding), 0, &type};
        ground::number_of(encoding, *bits, known.raw.word);
        if (raw == number && known.value.kind <= Kind::real) {
            known.value = known.raw; // as the encoding rounds it
        }
        known.value.raw_kind = known.raw.kind;
        known.value.raw = known.raw.word;
    }

    static Charset charset_of(const Type &type)
    {
        return type.encoding.kind == Encoding::Kind::text ? type.encoding.charset : Charset::utf8;
    }

    static std::vector<std::uint8_t> characters_of(const Type &type, const std::string &text, const std::string &name)
    {
        const auto result = characters(charset_of(type), text);
        return result ? *result : throw Refusal(name + " must be text of its character set; found " + text);
    }

    /// The bytes of a type of text or binary.
    static void make_bytes(Known &known, const Type &type, const Given &given)
    {
        known.content = given.bytes;
        if (given.kind == Given::Kind::text && type.sort == Sort::binary) {
            const auto bytes = given.text.size() % 2 == 0 ? bytes_in(given.text) : std::nullopt;
            if (!bytes) {
                throw Refusal(known.name + " must be bytes, or text of two hexadecimal digits for each");
            }
            known.content.assign(bytes->begin(), bytes->end());
        } else if (given.kind == Given::Kind::text) {
            known.content = characters_of(type, given.text, known.name);
        } else if (given.kind != Given::Kind::bytes) {
            throw Refusal(known.name + " must be text or bytes");
        }
        const bool is_text = type.sort == Sort::text;
        known.text =
            is_text ? utf8(charset_of(type), known.content) : std::string(known.content.begin(), known.content.end());
        known.value =
            known.raw = {.kind = is_text ? Kind::text : Kind::binary, .word = 0, .type = &type, .text = known.text};
    }

    void put_bytes(const Type &type, std::vector<std::uint8_t> content, const std::string &name, std::size_t &at)
    {
        const Encoding &encoding = type.encoding;
        const bool is_text = encoding.kind == Encoding::Kind::text;
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
            const std::size_t wanted = (*room + 7) / 8;
            const bool pads = encoding.size.is_fixed() && *room % 8 == 0 && (is_text || type.sort == Sort::text);
            if (pads && content.size() < wanted) {
                content.resize(wanted);
            }
            if (content.size() != wanted) {
                complain((pads ? "at most " : "") + std::to_string(wanted));
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

    /// A member or an element of a parameter, and its type.
    std::pair<const Given *, Id> part_of(const Reference &reference)
    {
        const Parameter &parameter = db_.parameters[reference.parameter];
        const auto own = given_.find(parameter.name);
        if (own != given_.end()) {
            used_.push_back(parameter.name);
        }
        const Given *at = own != given_.end() ? &own->second : known_value(parameter);
        Id type = parameter.type;
        std::vector<std::uint32_t> steps;
        for (const std::uint32_t step : reference.steps) {
            const Type &outer = db_.types[type];
            steps.push_back(step);
            if (at != nullptr && outer.sort == Sort::aggregate) {
                at = member_of(*at, outer.members[step], {reference.parameter, steps});
            } else {
                at = at != nullptr && at->kind == Given::Kind::list && step < at->list.size() ? &at->list[step]
                                                                                              : nullptr;
            }
            type = outer.sort == Sort::aggregate ? outer.members[step].type : outer.element;
        }
        return {at, type};
    }

    /// A value that the command has, also if its entry follows; nullptr: it has none. An argument's name means the
    /// nearest argument or member before, then an argument that follows.
    const Operand *find(const Reference &reference)
    {
        const auto seen = [&](const Known &known) {
            const Operand &operand = reference.calibrated ? known.value : known.raw;
            return operand.kind != Kind::none ? &operand : nullptr;
        };
        std::pair<const Given *, Id> found{nullptr, no_id};
        if (reference.of == Reference::Of::argument) {
            for (std::size_t i = known_.size(); i-- > 0;) {
                if (known_[i].is(reference.name)) {
                    return seen(known_[i]);
                }
            }
            if (left_out_.contains(reference.name)) {
                return nullptr;
            }
            if (const auto argument = values_.find(reference.name); argument != values_.end()) {
                found = {&argument->second, types_.at(reference.name)};
            }
        } else {
            found = part_of(reference);
        }
        if (found.first == nullptr || db_.types[found.second].sort >= Sort::aggregate) {
            return nullptr;
        }
        const auto [known, fresh] = ahead_.try_emplace(found.first);
        if (fresh) {
            make(known->second, db_.types[found.second], *found.first, reference.name);
        }
        return seen(known->second);
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
        const Operand *const operand = find(quantity.from);
        const auto found = operand != nullptr ? ground::number_of(*operand) : std::nullopt;
        return found ? nearest(found->real() * quantity.slope + quantity.intercept)
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
        for (const Reference *reference : {&condition.left, &condition.right}) { // as a decoder finds it
            if (reference->of == Reference::Of::argument && left_out_.contains(reference->name) &&
                find(*reference) == nullptr) {
                return false;
            }
        }
        const Operand &left = needed(condition.left, condition);
        return condition.right.of == Reference::Of::nothing
                   ? compare(condition.op, left, condition.literal)
                   : compare(condition.op, left, needed(condition.right, condition));
    }

    const Operand &needed(const Reference &reference, const Condition &condition)
    {
        const Operand *const found = find(reference);
        return found != nullptr
                   ? *found
                   : throw Refusal(command_.path + " needs " + reference.name +
                                   ", whose value decides about an entry or a calibrator: " + condition.text);
    }

    const Database &db_;
    const Command &command_;
    const std::map<std::string, Given> &given_;
    std::map<std::string, Given> values_;
    std::map<std::string, Id> types_;
    std::map<std::pair<Id, std::vector<std::uint32_t>>, Given> restrictions_;
    std::map<const std::string *, Given> constants_; ///< texts of the database
    std::vector<std::string> used_;
    const Given members_{Given::Kind::members, {}, {}, {}, {}, {}, {}, {}}; ///< none: they may have initial values
    std::deque<Known> known_;              ///< values that were written, in their order
    std::map<const Given *, Known> ahead_; ///< values to which others refer
    std::vector<std::uint32_t> steps_;     ///< into the parameter that is being written
    Id parameter_ = no_id;
    std::size_t root_ = 0;           ///< characters of the name of the entry that is being written
    std::set<std::string> left_out_; ///< arguments whose entries are not included, and members of these
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
