// SPDX-License-Identifier: Apache-2.0
#include "ground/database/decoder_parts.h"

#include <algorithm>

namespace fledge::ground {

namespace {

constexpr std::size_t most_bytes = 1 << 26; // of a packet and its texts
constexpr std::size_t most_reasons = 1000;  // characters about conditions that do not hold
constexpr std::size_t padding = 16;         // so that every word can be read

using Sort = Type::Sort;
using std::bit_cast;

} // namespace

Decoder::Decoder(const Database &database, bool plans)
    : db_(database), plans_on_(plans), plans_(database.containers.size()), labels_(database.types.size())
{
    hold_references();
    find_roots();
    for (Id i = 0; i < db_.types.size(); i++) {
        if (!db_.types[i].enumerators.empty()) {
            labels_[i] = std::make_unique<Labels>(labels_of(db_.types[i]));
        }
    }
}

/// Find the references whose last values must outlive their packets.
void Decoder::hold_references()
{
    for (const Container &container : db_.containers) {
        for (const Entry &entry : container.entries) {
            hold(entry.offset), hold(entry.count), hold(entry.gap), hold(entry.include), hold(entry.selector);
            for (const Dimension &dimension : entry.dimensions) {
                hold(dimension.first), hold(dimension.last);
            }
        }
    }
    for (const Command &command : db_.commands) {
        for (const Verifier &verifier : command.verifiers) {
            hold(verifier.condition), hold(verifier.changes), hold(verifier.returns);
        }
        for (const Constraint &constraint : command.constraints) {
            hold(constraint.condition);
        }
    }
    for (Id i = 0; i < db_.types.size(); i++) {
        const Type &type = db_.types[i];
        hold(type.offset_from), hold(type.encoding.size);
        for (const Dimension &dimension : type.dimensions) {
            hold(dimension.first), hold(dimension.last);
        }
        for (const MathStep &step : type.encoding.calibrator.steps) {
            hold(step.value);
        }
        for (const Alarm &alarm : type.alarms) {
            hold(alarm.when);
        }
        for (const auto &[condition, calibrator] : type.encoding.contexts) {
            hold(condition);
            for (const MathStep &step : calibrator.steps) {
                hold(step.value);
            }
        }
    }
}

void Decoder::find_roots()
{
    std::vector<bool> contained(db_.containers.size());
    for (const Container &container : db_.containers) {
        for (const Entry &entry : container.entries) {
            if (entry.kind == Entry::Kind::container) {
                contained[entry.id] = true;
            }
        }
    }
    for (const bool extended : {true, false}) {
        for (Id i = 0; i < db_.containers.size(); i++) {
            const Container &container = db_.containers[i];
            if (container.base == no_id && !container.of_command &&
                (extended ? !container.heirs.empty() : !contained[i])) {
                roots_.push_back(i);
            }
        }
        if (!roots_.empty()) {
            break;
        }
    }
}

/// The places of a type's enumerators, for the search of a raw value.
Decoder::Labels Decoder::labels_of(const Type &type)
{
    Labels result;
    for (std::uint32_t j = 0; j < type.enumerators.size(); j++) {
        result.sorted.emplace_back(type.enumerators[j].low, j);
    }
    std::sort(result.sorted.begin(), result.sorted.end());
    result.low = result.sorted.front().first;
    const Wide span = Wide(type.enumerators[result.sorted.back().second].high) - result.low;
    if (span < 1024) {
        result.table.assign(static_cast<std::size_t>(span) + 1, no_id);
        for (const auto &[low, place] : result.sorted) {
            for (std::int64_t value = low; value <= type.enumerators[place].high; value++) {
                result.table[static_cast<std::size_t>(value - result.low)] = place;
            }
        }
    }
    return result;
}

Decoder::~Decoder() = default;

// --- entry by entry

bool Decoder::broken(std::string reason)
{
    if (!broken_) {
        packet_.reason = std::move(reason);
        broken_ = true;
    }
    return false;
}

bool Decoder::spend(std::size_t effort)
{
    effort_ += effort;
    return effort_ <= most_effort && fields_.size() < most_fields && used_ < most_bytes
               ? true
               : broken("the packet has more values or repetitions than a decoder takes");
}

/// Copy bits that begin within a byte to whole bytes behind the packet; the last bit ends a byte.
std::uint64_t Decoder::copy(std::size_t bit, std::size_t bits)
{
    const std::size_t n = (bits + 7) / 8, to = used_;
    bytes_.resize(std::max(bytes_.size(), used_ + n + padding));
    used_ += n;
    for (std::size_t i = 0, first = bits - 8 * (n - (n > 0)); i < n; i++) {
        const std::size_t from = i == 0 ? bit : bit + first + 8 * (i - 1);
        bytes_[to + i] =
            static_cast<std::uint8_t>(load_bits(bytes_.data(), from, i == 0 ? static_cast<unsigned>(first) : 8));
    }
    return slice(to, n);
}

bool Decoder::take_binary(const Type &type, Walk &walk, std::uint64_t &raw, std::uint64_t &value)
{
    const auto bits = size_at(type.encoding.size, walk.at);
    if (!bits || *bits < 0 || walk.at + static_cast<std::size_t>(*bits) > n_bits_) {
        return broken(
            !type.encoding.algorithm.empty() && bits && *bits < 0
                ? type.name + " is encoded by the algorithm " + type.encoding.algorithm + ", which is not computed"
            : !bits || *bits < 0
                ? "the size of " + type.name + " is not known"
                : "the packet ends within " + type.name + ", a binary value of " + std::to_string(*bits) + " bits");
    }
    const auto n = static_cast<std::size_t>(*bits);
    value = raw = walk.at % 8 == 0 && n % 8 == 0 ? slice(walk.at / 8, n / 8) : copy(walk.at, n);
    if (type.sort == Sort::text && type.encoding.size.is_fixed()) {
        value -= text_of(raw).size() - (text_of(raw).find_last_not_of('\0') + 1); // its padding
    }
    walk.at += n;
    return spend(n / 64);
}

bool Decoder::take_text(const Type &type, Walk &walk, std::uint64_t &raw, std::uint64_t &value, Status &status)
{
    const Encoding &encoding = type.encoding;
    std::size_t room = n_bits_ - walk.at, tag = 0, content = 0, behind = 0;
    if (encoding.sized) {
        const auto bits = size_at(encoding.size, walk.at);
        if (!bits || *bits < 0 || static_cast<std::size_t>(*bits) > room) {
            return broken(!bits || *bits < 0 ? "the size of " + type.name + " is not known"
                                             : "the packet ends within " + type.name + ", a text of " +
                                                   std::to_string(*bits) + " bits");
        }
        room = static_cast<std::size_t>(*bits);
    }
    const std::size_t most = encoding.most_bits != 0 ? std::min<std::size_t>(encoding.most_bits, room) : room;
    if (encoding.sized && most < room) {
        status = Status::malformed;
    }
    const std::size_t unit = 8 * unit_of(encoding.charset);
    if (encoding.size_tag != 0) {
        tag = encoding.size_tag;
        if (tag > most) {
            return broken("the packet ends within the size of " + type.name);
        }
        content = 8 * load_bits(bytes_.data(), walk.at, static_cast<unsigned>(tag));
        if (content > most - tag) {
            if (!encoding.sized) {
                return broken(type.name + " has a size of " + std::to_string(content / 8) +
                              " bytes; there is room for " + std::to_string((most - tag) / 8));
            }
            status = Status::malformed;
            content = (most - tag) / 8 * 8;
        }
    } else {
        const auto is_zero = [&](std::size_t at, std::size_t bits) {
            return load_bits(bytes_.data(), at, static_cast<unsigned>(bits)) == 0;
        };
        content = most / unit * unit;
        const std::size_t end = 8 * encoding.terminator.size();
        for (std::size_t i = 0; end != 0 && i + end <= most; i += unit) {
            std::size_t same = 0;
            while (same < end / 8 && load_bits(bytes_.data(), walk.at + i + 8 * same, 8) == encoding.terminator[same]) {
                same++;
            }
            if (same == end / 8) {
                content = i;
                behind = end;
                break;
            }
        }
        while (end == 0 && encoding.size.is_fixed() && content >= unit && is_zero(walk.at + content - unit, unit)) {
            content -= unit; // padding
        }
        if (!encoding.sized && behind == 0) {
            return broken("no " + std::to_string(encoding.terminator.size()) + "-byte character ends " + type.name);
        }
    }
    const std::size_t from = walk.at + tag;
    raw = from % 8 == 0 ? slice(from / 8, content / 8) : copy(from, content);
    value = raw;
    if (encoding.charset != Charset::utf8) {
        const auto text = utf8(encoding.charset, {bytes_.data() + (raw >> 32), raw & 0xFFFFFFFF});
        bytes_.resize(std::max(bytes_.size(), used_ + text.size() + padding));
        std::copy(text.begin(), text.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(used_));
        value = slice(used_, text.size());
        used_ += text.size();
    }
    walk.at += encoding.sized ? room : tag + content + behind;
    return spend(content / 16);
}

/// How many elements an array has; beyond 2^20 the number is not exact.
std::optional<std::size_t> Decoder::elements(const std::vector<Dimension> &dimensions)
{
    std::size_t n = 1;
    for (const Dimension &dimension : dimensions) {
        const auto first = number(dimension.first), last = number(dimension.last);
        if (!first || !last || *last - *first < -1 || *last - *first >= std::int64_t(most_fields)) {
            return std::nullopt;
        }
        n = std::min((most_fields + 1), n * static_cast<std::size_t>(*last - *first + 1));
    }
    return n;
}

/// [bits] of a type, if they are known before it is decoded.
std::optional<std::int64_t> Decoder::size(Id id, const std::vector<Dimension> &dimensions)
{
    const Type &type = db_.types[id];
    std::optional<std::int64_t> bits;
    if (!spend(1)) {
        return std::nullopt;
    }
    if (type.sort == Sort::aggregate) {
        bits = 0;
        for (const Member &member : type.members) {
            const auto element_bits = size(member.type, {});
            bits = bits && element_bits ? std::optional(*bits + *element_bits) : std::nullopt;
        }
    } else if (type.sort == Sort::array) {
        const auto n = elements(dimensions.empty() ? type.dimensions : dimensions);
        const auto element_bits = size(type.element, {});
        bits = n && element_bits ? std::optional(static_cast<std::int64_t>(*n) * *element_bits) : std::nullopt;
    } else if (type.encoding.bits != 0) {
        bits = type.encoding.bits;
    } else if (type.encoding.sized) {
        bits = number(type.encoding.size);
    }
    return bits && *bits >= 0 && *bits <= static_cast<std::int64_t>(n_bits_) ? bits : std::nullopt;
}

bool Decoder::take(Id parameter, Id id, std::uint32_t node, Walk &walk, const std::vector<Dimension> *dimensions)
{
    const Type &type = db_.types[id];
    if (!spend(1)) {
        return false;
    }
    if (type.sort == Sort::aggregate) {
        for (std::uint32_t i = 0; i < type.members.size(); i++) {
            nodes_.push_back({node, i, id});
            if (!take(parameter, type.members[i].type, static_cast<std::uint32_t>(nodes_.size() - 1), walk, nullptr)) {
                return false;
            }
        }
        return true;
    }
    if (type.sort == Sort::array) {
        const auto n = elements(dimensions != nullptr && !dimensions->empty() ? *dimensions : type.dimensions);
        if (!n || *n > most_fields) {
            return broken("the " + std::string(n ? "" : "size of the ") + "array " + db_.parameters[parameter].name +
                          (n ? " has more than 2^20 elements" : " is not known"));
        }
        if (*n == 0) {
            empty_.push_back({fields_.size(), parameter, node});
        }
        for (std::uint32_t i = 0; i < *n; i++) { // of several dimensions, the last counts fastest
            nodes_.push_back({node, i, id});
            if (!take(parameter, type.element, static_cast<std::uint32_t>(nodes_.size() - 1), walk, nullptr)) {
                return false;
            }
        }
        return true;
    }
    const Encoding &encoding = type.encoding;
    const std::size_t from = walk.at;
    Kind kind = raw_kind(encoding);
    std::uint64_t raw = 0, value = 0;
    Status status = Status::good;
    if (kind == Kind::text) {
        if (!take_text(type, walk, raw, value, status)) {
            return false;
        }
        if (type.sort != Sort::text) {
            const Status result = convert(type, kind, value, value);
            status = status == Status::good ? result : status;
        }
    } else if (kind == Kind::binary) {
        if (!take_binary(type, walk, raw, value)) {
            return false;
        }
    } else {
        if (walk.at + encoding.bits > n_bits_) {
            return broken("the packet ends within " + db_.parameters[parameter].name);
        }
        if (number_of(encoding, load_bits(bytes_.data(), walk.at, encoding.bits), raw)) {
            status = convert(type, kind, raw, value);
        } else {
            status = Status::malformed;
        }
        walk.at += encoding.bits;
    }
    if (!encoding.algorithm.empty()) {
        status = Status::uncalibrated;
    }
    if (!plans_on_) {
        places_.push_back({from, walk.at - from});
    }
    fields_.push_back({parameter, id, node, kind, value_kind(type)});
    raw_.push_back(raw);
    values_.push_back(value);
    status_.push_back(status);
    return true;
}

bool Decoder::once(const Entry &entry, Walk &walk)
{
    if (entry.kind == Entry::Kind::container) {
        if (++depth_ > 256) {
            return broken("containers are nested deeper than 256");
        }
        std::vector<Id> chain; // up to the container that extends none
        for (Id at = entry.id; at != no_id; at = db_.containers[at].base) {
            chain.push_back(at);
        }
        Walk inner{walk.at, walk.at, true};
        for (std::size_t i = chain.size(); i-- > 1;) {
            if (!entries(chain[i], inner)) {
                return false;
            }
        }
        const Outcome outcome = attempt(entry.id, inner, 0, true);
        depth_--;
        walk.at = end_;
        return outcome == Outcome::matched;
    }
    if (entry.kind == Entry::Kind::parameter) {
        return take(entry.id, db_.parameters[entry.id].type, 0, walk, &entry.dimensions);
    }
    if (entry.kind == Entry::Kind::indirect) {
        const auto found = find(entry.selector, true);
        const std::string wanted = found ? shown(*found) : "";
        for (Id i = 0; i < db_.parameters.size(); i++) {
            for (const auto &[space, alias] : db_.parameters[i].aliases) {
                if (space == entry.name && alias == wanted) {
                    const Id type = db_.parameters[i].type;
                    return db_.types[type].encoding.kind != Encoding::Kind::none
                               ? spend(i) && take(i, type, 0, walk, nullptr)
                               : broken(db_.parameters[i].path + " has no encoding");
                }
            }
        }
        return broken("no parameter has the alias " + wanted + " in the name space " + entry.name);
    }
    if (entry.kind == Entry::Kind::fixed) {
        walk.at += entry.bits;
        return walk.at <= n_bits_ || broken("the packet ends within a fixed value");
    }
    return broken("an argument of a command is no telemetry"); // a command's container as root
}

bool Decoder::entry(const Entry &entry, Walk &walk)
{
    if (!holds(entry.include, true)) {
        return spend(1);
    }
    const auto offset = number(entry.offset), n = entry.repeats ? number(entry.count) : std::optional<std::int64_t>(1);
    const auto gap = entry.repeats ? number(entry.gap) : std::optional<std::int64_t>(0);
    if (!offset || !n || !gap || *n < 0) {
        return broken("the place or the number of an entry is not known (" + db_.where(entry.place) + ")");
    }
    std::int64_t at = *offset + static_cast<std::int64_t>(entry.from == Entry::From::start ? walk.start : walk.at);
    if (entry.from == Entry::From::end) { // the offset is from the entry's end to the packet's end
        const auto bits = entry.kind == Entry::Kind::fixed       ? std::optional<std::int64_t>(entry.bits)
                          : entry.kind == Entry::Kind::parameter ? size(db_.parameters[entry.id].type, entry.dimensions)
                                                                 : std::nullopt;
        if (walk.included || !bits) {
            return broken((walk.included ? "an entry at the end of a container that is in another is not decoded ("
                                         : "an entry at the end of a container needs a size (") +
                          db_.where(entry.place) + ")");
        }
        const Wide from = Wide(n_bits_) - *offset - Wide(*n) * *bits - std::max<Wide>(*n - 1, 0) * *gap;
        at = static_cast<std::int64_t>(std::clamp<Wide>(from, -1, Wide(n_bits_) + 1));
        walk.tail = std::min(walk.tail, static_cast<std::size_t>(std::max<std::int64_t>(at, 0)));
        walk.front = walk.back ? walk.front : walk.at;
    }
    walk.back = entry.from == Entry::From::end || (walk.back && entry.from == Entry::From::previous);
    for (std::int64_t i = 0; i < *n; i++) {
        if (at < 0 || at > static_cast<std::int64_t>(n_bits_)) {
            return broken("an entry begins at bit " + std::to_string(at) + ", and the packet has " +
                          std::to_string(n_bits_) + " (" + db_.where(entry.place) + ")");
        }
        walk.at = static_cast<std::size_t>(at);
        if (!spend(1) || !once(entry, walk)) {
            return false;
        }
        at = static_cast<std::int64_t>(walk.at) + *gap;
    }
    std::size_t &furthest = walk.back ? walk.end : walk.most;
    furthest = std::max(furthest, walk.at);
    return true;
}

/// Entries that are placed from the end lie behind the entries of heirs, which begin before them.
bool Decoder::entries(Id container, Walk &walk)
{
    const auto &all = db_.containers[container].entries;
    const bool whole = std::all_of(all.begin(), all.end(), [&](const Entry &next) { return entry(next, walk); });
    if (!whole && !packet_.stopped) {
        packet_.stopped = walk.at;
    }
    walk.at = walk.back ? walk.front : walk.at;
    walk.back = false;
    return whole;
}

Decoder::Outcome Decoder::attempt(Id id, Walk walk, std::size_t depth, bool included)
{
    const Container &container = db_.containers[id];
    const std::size_t fields = fields_.size(), nodes = nodes_.size(), empty = empty_.size();
    const bool whole = entries(id, walk);
    if (!included) {
        found_ = id; // even if the packet ends within it
    }
    if (!whole) {
        return Outcome::broken;
    }
    for (const Id heir : container.heirs) {
        if (!spend(1)) {
            return Outcome::broken;
        }
        if (holds(db_.containers[heir].restriction, false)) {
            const Outcome outcome = attempt(heir, walk, depth + 1, included);
            if (outcome != Outcome::unmatched) {
                return outcome;
            }
        }
    }
    if (!container.is_abstract || included) {
        if (!included) {
            found_ = id;
        }
        end_ = std::max(walk.at, walk.end);
        if (walk.most > walk.tail) {
            packet_.stopped = walk.tail;
            broken("the packet is " + std::to_string(walk.most - walk.tail) + " bits too short for " + container.path +
                   " and what stands at its end");
            return Outcome::broken;
        }
        return Outcome::matched;
    }
    explain(id, depth);
    found_ = no_id;
    fields_.resize(fields);
    nodes_.resize(nodes);
    empty_.resize(empty);
    places_.resize(std::min(places_.size(), fields));
    raw_.resize(fields);
    values_.resize(fields);
    status_.resize(fields);
    return Outcome::unmatched;
}

// --- reasons

/// The comparisons of a condition that do not hold, with the actual values. at: the place of the first value in the
/// packet; earlier: values of earlier packets count, too.
std::string Decoder::failing(const Condition &condition, std::optional<std::size_t> &at, bool earlier)
{
    if (holds(condition, earlier)) {
        return "";
    }
    if (condition.kind == Condition::Kind::compare) {
        const auto found = find(condition.left, earlier);
        at = at || !found ? at : found->at;
        return condition.text + (found     ? " (found " + shown(*found) + ")"
                                 : earlier ? " (not known: no packet had it)"
                                           : " (not in this packet)");
    }
    std::string all;
    for (const Condition &part : condition.parts) {
        if (all.size() > most_reasons) {
            return all + (condition.kind == Condition::Kind::any ? " or more" : " and more");
        }
        const std::string reason = failing(part, at, earlier);
        all += (all.empty() || reason.empty()            ? ""
                : condition.kind == Condition::Kind::any ? " or "
                                                         : " and ") +
               reason;
    }
    return all;
}

std::optional<Number> Decoder::number(const Reference &reference)
{
    const auto found = find(reference, true);
    return found ? number_of(*found) : std::nullopt;
}

std::string Decoder::failing(const Condition &condition)
{
    std::optional<std::size_t> at;
    effort_ = 0;
    return failing(condition, at, true);
}

bool Decoder::applies(const Condition &condition)
{
    effort_ = 0; // a packet may have used up its own
    return holds(condition, true);
}

std::optional<bool> Decoder::judge(const Condition &condition)
{
    const bool any = condition.kind == Condition::Kind::any;
    effort_ = 0;
    if (condition.kind == Condition::Kind::compare) {
        const bool known =
            find(condition.left, true) && (condition.right.of == Reference::Of::nothing || find(condition.right, true));
        return known ? std::optional(holds(condition, true)) : std::nullopt;
    }
    std::optional<bool> result = !any;
    for (const Condition &part : condition.parts) {
        const auto judged = judge(part);
        if (judged == any) {
            return any; // whatever the others are
        }
        result = judged ? result : judged;
    }
    return result;
}

std::string Decoder::words(const Reference &reference)
{
    const auto found = find(reference, true);
    return found ? shown(*found) : "";
}

void Decoder::explain(Id id, std::size_t depth)
{
    if (depth < best_) {
        return; // another container came nearer
    }
    best_ = depth + 1;
    const Container &container = db_.containers[id];
    packet_.nearest = id;
    packet_.stopped.reset();
    packet_.reason = container.path + " is abstract, and no container extends it";
    std::size_t fewest = ~std::size_t(0);
    for (const Id heir : container.heirs) {
        std::optional<std::size_t> at;
        const std::string needs = failing(db_.containers[heir].restriction, at, false);
        const auto n = static_cast<std::size_t>(std::count(needs.begin(), needs.end(), '('));
        if (!needs.empty() && n < fewest) {
            fewest = n;
            packet_.nearest = heir;
            packet_.stopped = at;
            packet_.reason = "no container that extends " + container.path + " fits; the nearest, " +
                             db_.containers[heir].path + ", needs " + needs;
        }
    }
}

// --- a packet

/// Keep the values to which later packets refer.
void Decoder::keep_held()
{
    for (std::size_t i = 0; i < fields_.size() && !slots_.empty(); i++) {
        if (const auto slots = slots_.find(fields_[i].parameter); slots != slots_.end()) {
            for (const std::uint32_t slot : slots->second) {
                if (leads(held_[slot].reference, nodes_, fields_[i].node)) {
                    keep(i, slot);
                }
            }
        }
    }
}

/// Returns the number of fields.
std::size_t Decoder::decode_planned(const Plan &plan)
{
    run(plan);
    packet_.planned = true;
    packet_.nearest = no_id;
    packet_.reason.clear(); // of earlier roots
    packet_.stopped.reset();
    packet_.fields = plan.fields;
    packet_.nodes = plan.nodes;
    packet_.empty = plan.empty;
    end_ = plan.end;
    for (const auto &[field, slot] : plan.held) {
        keep(field, slot);
    }
    return plan.fields.size();
}

const Decoded &Decoder::decode(std::span<const std::uint8_t> packet, Id root)
{
    packet_ = Decoded();
    fields_.clear();
    used_ = packet.size() + padding;
    n_bits_ = 8 * packet.size();
    effort_ = depth_ = best_ = end_ = 0;
    broken_ = false;
    found_ = no_id;
    const std::span<const Id> roots = root != no_id ? std::span<const Id>(&root, 1) : roots_;
    if (packet.size() > most_bytes / 2 || roots.empty()) {
        packet_.reason = roots.empty() ? "the database has no container" : "the packet has more than 32 MB";
        return packet_;
    }
    bytes_.resize(std::max(bytes_.size(), used_));
    std::copy(packet.begin(), packet.end(), bytes_.begin());
    std::memset(bytes_.data() + packet.size(), 0, padding);
    std::size_t n = 0;
    for (const Id from : roots) {
        found_ = plans_on_ ? planned(from, n_bits_) : no_id;
        if (found_ != no_id) {
            n = decode_planned(*plans_[found_]);
            break;
        }
        nodes_.assign(1, {0, 0, no_id});
        empty_.clear();
        places_.clear();
        raw_.clear();
        values_.clear();
        status_.clear();
        const Outcome outcome = attempt(from, {0, 0}, 0, false);
        if (outcome == Outcome::unmatched) {
            continue;
        }
        packet_.fields = fields_;
        packet_.nodes = nodes_;
        packet_.empty = empty_;
        n = fields_.size();
        if (outcome == Outcome::matched) {
            packet_.reason.clear(); // of earlier roots
            packet_.stopped.reset();
        }
        packet_.nearest = no_id;
        keep_held();
        break;
    }
    packet_.container = found_;
    packet_.raw = {raw_.data(), n};
    packet_.values = {values_.data(), n};
    packet_.status = {status_.data(), n};
    packet_.bytes = {bytes_.data(), used_};
    packet_.places = places_;
    packet_.bits = end_;
    return packet_;
}

std::string suffix(const Database &database, const Decoded &packet, std::size_t field)
{
    std::string path;
    for (std::uint32_t node = packet.fields[field].node; node != 0; node = packet.nodes[node].parent) {
        const auto &[parent, place, id] = packet.nodes[node];
        const Type &type = database.types[id];
        path = (type.sort == Sort::array ? "[" + std::to_string(place) + "]" : "." + type.members[place].name) + path;
    }
    return path;
}

} // namespace fledge::ground
