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
        for (const Command *one : chain) {
            for (const auto &[name, value] : one->assignments) {
                if (given_.contains(name)) {
                    throw Refusal(one->path + " fixes the argument " + name + ": do not give it");
                }
                values_.try_emplace(name, text(value));
            }
        }
        std::string missing;
        for (const Command *one : chain) {
            for (const Argument &argument : one->arguments) {
                const auto &initial = argument.initial ? argument.initial : db_.types[argument.type].initial;
                types_[argument.name] = argument.type;
                if (const auto value = given_.find(argument.name); value != given_.end()) {
                    values_[argument.name] = value->second;
                    used_.push_back(argument.name);
                } else if (!values_.contains(argument.name) && initial) {
                    values_[argument.name] = text(*initial);
                } else if (!values_.contains(argument.name) && db_.types[argument.type].sort == Sort::aggregate) {
                    values_[argument.name].what = Given::What::members; // whose members may have initial values
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
        Given made;
        made.what = Given::What::text;
        made.text = value;
        return made;
    }

    // --- the packet

    /// Those that are placed from the end, each with those that follow it, lie behind all others: the packet is as long
    /// as they need.
    void packet(Id container, std::size_t &at, bool included)
    {
        std::vector<const Container *> chain;
        for (Id one = container; one != no_id; one = db_.containers[one].base) {
            chain.push_back(&db_.containers[one]);
            fixed_by(chain.back()->restriction);
        }
        const std::size_t start = at;
        std::size_t most = at;
        std::vector<std::vector<const Entry *>> tails;
        for (std::size_t i = chain.size(); i-- > 0;) {
            bool back = false;
            for (const Entry &one : chain[i]->entries) {
                if (one.from == Entry::From::end && holds(one.include)) {
                    tails.emplace_back();
                }
                back = one.from == Entry::From::end ? back || holds(one.include)
                                                    : back && one.from == Entry::From::previous;
                if (back) {
                    tails.back().push_back(&one);
                } else {
                    entry(one, at, start);
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
        std::vector<std::int64_t> behind; // where each begins, in front of the packet's end
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
            for (const Entry *one : tails[i]) {
                entry(*one, to, start);
            }
            if (to > static_cast<std::size_t>(end)) {
                throw Refusal(db_.where(tails[i][0]->place) + ": the entry ends behind the packet");
            }
        }
        bytes.resize(static_cast<std::size_t>(end) / 8);
        at = static_cast<std::size_t>(end);
    }

    /// A restriction to a value gives a parameter this value; the one of an heir counts.
    void fixed_by(const Condition &condition)
    {
        if (condition.what == Condition::What::compare && condition.op == Operator::equal &&
            condition.right.of == Reference::Of::nothing && condition.left.of == Reference::Of::parameter) {
            restrictions_.try_emplace({condition.left.parameter, condition.left.steps}, text(condition.literal.text));
        } else if (condition.what == Condition::What::all) {
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
                            (entry.from == Entry::From::end ? 0 : number(entry.offset)); // `at` is its place already
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
        switch (entry.what) {
        case Entry::What::container: packet(entry.id, at, true); break;
        case Entry::What::fixed:
            for (std::size_t i = 0; i < entry.bits; i++) { // the last bit of the value is its last byte's
                const std::size_t bit = 8 * entry.bytes.size() - entry.bits + i;
                put(at, 1, entry.bytes[bit / 8] >> (7 - bit % 8) & 1u);
            }
            break;
        case Entry::What::argument: {
            const auto type = types_.find(entry.name);
            if (type == types_.end()) {
                throw Refusal(db_.where(entry.place) + ": " + command_.path + " has no argument " + entry.name);
            }
            const std::size_t from = at;
            value(type->second, values_.at(entry.name), entry.name, at, &entry.dimensions);
            places.push_back({entry.name, true, from, at - from});
            break;
        }
        case Entry::What::parameter: {
            const std::size_t from = at;
            parameter(entry, at);
            places.push_back({db_.parameters[entry.id].name, false, from, at - from});
            break;
        }
        case Entry::What::indirect: throw Refusal(db_.where(entry.place) + ": a command has no indirect parameters");
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
            Given made = initial ? text(*initial) : Given();
            made.what = initial ? made.what : Given::What::members;
            return &initials_.insert_or_assign(&parameter - db_.parameters.data(), made).first->second;
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
        } else if (type.encoding.what == Encoding::What::none || !type.encoding.algorithm.empty()) {
            throw Refusal(
                name + (type.encoding.algorithm.empty()
                            ? " has no encoding"
                            : " is encoded by the algorithm " + type.encoding.algorithm + ", which is not computed"));
        } else if (type.encoding.what == Encoding::What::text || type.encoding.what == Encoding::What::binary) {
            bytes_of(type, given, name, at);
        } else {
            number(type, given, name, at);
        }
    }

    void members(const Type &type, const Given &given, const std::string &name, std::size_t &at)
    {
        if (given.what != Given::What::members) {
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
        if (given.what != Given::What::list || given.list.size() != static_cast<std::size_t>(n)) {
            throw Refusal(name + " has " + std::to_string(static_cast<std::size_t>(n)) + " elements; found " +
                          (given.what == Given::What::list ? std::to_string(given.list.size()) : "no list"));
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
        switch (given.what) {
        case Given::What::integer: return Number{given.integer, static_cast<double>(given.integer)};
        case Given::What::real: return Number{std::nullopt, given.real};
        case Given::What::text:
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
        const auto found = plain(given);
        if (type.sort == Sort::enumerated) {
            std::string all;
            std::vector<std::int64_t> endings; // of labels that end with the text, as FIELD_WMM with WMM
            for (const Enumerator &enumerator : type.enumerators) {
                if (given.what == Given::What::text ? enumerator.label == given.text
                                                    : found && found->whole && *found->whole >= enumerator.low &&
                                                          *found->whole <= enumerator.high) {
                    return given.what == Given::What::text ? Number{enumerator.low, static_cast<double>(enumerator.low)}
                                                           : *found;
                }
                if (given.what == Given::What::text && enumerator.label.ends_with("_" + given.text)) {
                    endings.push_back(enumerator.low);
                }
                all += (all.empty() ? "" : ", ") + enumerator.label;
            }
            if (endings.size() == 1) {
                return Number{endings.front(), static_cast<double>(endings.front())};
            }
            if (!found || given.what != Given::What::text) { // restrictions may give a label's raw value as text
                throw Refusal(name + " must be one of " + all);
            }
            Given raw;
            raw.integer = found->whole.value_or(0);
            return number_of(type, raw, name);
        }
        if (type.sort == Sort::boolean && given.what == Given::What::text) {
            const bool one =
                given.text == type.one || given.text == "true" || given.text == "True" || given.text == "1";
            if (!one && given.text != type.zero && given.text != "false" && given.text != "False" &&
                given.text != "0") {
                throw Refusal(name + " must be " + type.zero + " or " + type.one + "; found " + given.text);
            }
            return {one, one ? 1. : 0.};
        }
        if (type.sort == Sort::boolean && found && (!found->whole || (*found->whole != 0 && *found->whole != 1))) {
            throw Refusal(name + " must be 0 or 1; found " + shown(found->real));
        }
        if (!found || (found->real != found->real && type.encoding.what != Encoding::What::real)) {
            throw Refusal(name + " must be a number");
        }
        if (type.sort == Sort::integer && !found->whole) {
            if (found->real != std::trunc(found->real)) {
                throw Refusal(name + " must be a whole number; found " + shown(found->real));
            }
        }
        return *found;
    }

    void in_range(const Type &type, const std::string &name, double x, bool calibrated) const
    {
        bool any = false, holds = false;
        std::string ranges;
        for (const Range &one : type.valid) {
            if (one.calibrated == calibrated) {
                any = true;
                holds = holds || one.holds(x);
                ranges += (ranges.empty() ? "" : " or ") + std::string(one.low_open ? "above " : "from ") +
                          shown(one.low) + (one.high_open ? " to below " : " to ") + shown(one.high);
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
        } else if (calibrator->what != Calibrator::What::none) {
            const auto made = calibrated(*calibrator, raw.real, [&](const Reference &one) { return real_of(one); });
            if (!made) {
                throw Refusal(name + " has no raw number for " + shown(raw.real));
            }
            raw = {std::nullopt, *made};
        }
        in_range(type, name, raw.real, false);
        const auto bits = raw.whole && encoding.what == Encoding::What::integer ? bits_of(encoding, *raw.whole)
                                                                                : bits_of(encoding, raw.real);
        if (!bits) {
            throw Refusal(name + " has " + std::to_string(encoding.bits) + " bits, too few for " + shown(raw.real));
        }
        put(at, encoding.bits, *bits);
    }

    void bytes_of(const Type &type, const Given &given, const std::string &name, std::size_t &at)
    {
        const Encoding &encoding = type.encoding;
        const bool is_text = encoding.what == Encoding::What::text;
        std::vector<std::uint8_t> content = given.bytes;
        if (given.what == Given::What::text && type.sort == Sort::binary) {
            for (std::size_t i = 0; i < given.text.size(); i += 2) {
                const auto byte = parsed<std::uint8_t>(std::string_view(given.text).substr(i, 2), 16);
                if (!byte || given.text.size() % 2 != 0) {
                    throw Refusal(name + " must be bytes, or text of two hexadecimal digits for each");
                }
                content.push_back(*byte);
            }
        } else if (given.what == Given::What::text || given.what == Given::What::integer ||
                   given.what == Given::What::real) {
            if (type.sort != Sort::text) { // numbers as text
                number_of(type, given, name);
            }
            const std::string digits = given.what == Given::What::text ? given.text
                                       : given.what == Given::What::integer
                                           ? std::to_string(static_cast<std::int64_t>(given.integer))
                                           : shown(given.real);
            const auto made = type.sort == Sort::text && given.what != Given::What::text
                                  ? std::nullopt
                                  : characters(is_text ? encoding.charset : Charset::utf8, digits);
            if (!made) {
                throw Refusal(name + " must be text of its character set; found " + digits);
            }
            content = *made;
        } else if (given.what != Given::What::bytes) {
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
            for (std::size_t i = 0; i < content.size(); i++) { // the last bit is the last byte's
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

    // --- what others refer to

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
            if (at != nullptr && at->what == Given::What::list && step < at->list.size()) {
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
            for (std::size_t i = known_.size(); i-- > 0;) { // a member beside it first
                if (known_[i].first == reference.name) {
                    return known_[i].second;
                }
            }
        }
        const Given *const found = find(reference);
        const auto number = found != nullptr ? plain(*found) : std::nullopt;
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
        const auto holds_one = [&](const Condition &one) { return holds(one); };
        switch (condition.what) {
        case Condition::What::always: return true;
        case Condition::What::all: return std::all_of(condition.parts.begin(), condition.parts.end(), holds_one);
        case Condition::What::any: return std::any_of(condition.parts.begin(), condition.parts.end(), holds_one);
        case Condition::What::compare: break;
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
    std::vector<std::pair<std::string, double>> known_; ///< numbers that were written, the last one last
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
