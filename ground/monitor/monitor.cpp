// SPDX-License-Identifier: Apache-2.0
#include "ground/monitor/monitor.h"

#include <algorithm>
#include <cmath>

namespace fledge::ground {

namespace {

constexpr std::size_t most_words = 1 << 22; // of a trigger's rows

bool is_bytes(Kind kind)
{
    return kind == Kind::text || kind == Kind::binary;
}

bool is_there(const Newest &newest)
{
    return newest.status == Status::good || newest.status == Status::unlabelled;
}

template <class Unsigned> void store(char *to, Unsigned number)
{
    for (std::size_t i = 0; i < sizeof number; i++) { // compilers emit a single store
        to[i] = static_cast<char>(number >> 8 * i & 0xFF);
    }
}

} // namespace

/// The state of a slot that only take() uses.
struct Monitor::Live {
    Newest newest;
    double low = -infinite, high = infinite; ///< a number between them needs neither limits nor triggers
};

struct Monitor::Trigger {
    std::vector<std::uint32_t> inputs;
    std::vector<std::uint64_t> pending, rows; ///< rows of the batch; rows of saved batches
};

/// A verifier of a command that was sent.
struct Monitor::Expected {
    const Verifier *verifier;
    Condition condition;
    std::vector<Id> parameters; ///< of the condition or the change
    std::optional<Number> before;
};

namespace {

/// Replace arguments in a condition by the values of the command that is sent. Throws Refusal for other values that are
/// not known here.
void compile(Condition &comparison, const std::map<std::string, std::string> &arguments, std::vector<Id> &parameters)
{
    for (Condition &part : comparison.parts) {
        compile(part, arguments, parameters);
    }
    if (comparison.kind != Condition::Kind::compare) {
        return;
    }
    for (const Reference *side : {&comparison.left, &comparison.right}) {
        if (side->of == Reference::Of::parameter) {
            parameters.push_back(side->parameter);
        } else if (side->of == Reference::Of::argument &&
                   (side == &comparison.left || !arguments.contains(side->name))) {
            throw Refusal("it compares " + side->name + ", which is not known here");
        }
    }
    if (comparison.right.of == Reference::Of::argument) {
        comparison.literal = Literal(arguments.at(comparison.right.name));
        comparison.right = {};
    }
}

} // namespace

Monitor::Monitor(const Database &database, Id root)
    : db_(database), root_(root), decoder_(db_), watched_(db_.containers.size()), slots_(db_),
      by_type_(db_.types.size())
{
    grow();
}

Monitor::~Monitor() = default;

/// Make room for new slots. The caller holds both locks.
void Monitor::grow()
{
    const std::size_t n = slots_.all().size();
    for (std::size_t slot = live_.size(); slot < n; slot++) {
        const Id type = slots_.all()[slot].type;
        live_.emplace_back();
        runs_.emplace_back();
        feeds_.emplace_back();
        auto &limits = limits_.emplace_back();
        if (type != no_id && !db_.types[type].alarms.empty()) {
            if (!by_type_[type]) {
                by_type_[type] = std::make_shared<Limits>(db_.types[type]);
            }
            limits = by_type_[type];
        }
        arm(static_cast<std::uint32_t>(slot));
    }
    newest_.resize(n);
}

/// Set the range of numbers that need neither limits nor triggers.
void Monitor::arm(std::uint32_t slot)
{
    Live &live = live_[slot];
    const Limits *limits = limits_[slot].get();
    const auto &runs = runs_[slot];
    const bool uneasy = live.newest.concern != Concern::normal || runs != decltype(runs_)::value_type{};
    const bool all = limits == nullptr || limits->none();
    const Slot &place = slots_.all()[slot];
    const bool bytes =
        is_bytes(place.kind) || (place.type != no_id && is_bytes(raw_kind(db_.types[place.type].encoding)));
    const bool labels = place.kind == Kind::label && !all; // limits judge their raw numbers
    live.low = uneasy || bytes || labels || !feeds_[slot].empty() ? infinite : all ? -infinite : limits->low();
    live.high = all ? infinite : limits->high();
}

void Monitor::sink(PacketSink *sink)
{
    const std::lock_guard taking(taking_);
    sink_ = sink;
    problem_.clear();
}

void Monitor::watch(std::span<const Id> containers)
{
    const std::lock_guard taking(taking_);
    std::fill(watched_.begin(), watched_.end(), false);
    std::vector<Id> all(containers.begin(), containers.end());
    while (!all.empty()) {
        const Id id = all.back();
        all.pop_back();
        if (!watched_[id]) {
            watched_[id] = true;
            all.insert(all.end(), db_.containers[id].heirs.begin(), db_.containers[id].heirs.end());
        }
    }
}

std::uint32_t Monitor::expect(Id command, std::size_t verifier, const std::map<std::string, std::string> &arguments)
{
    const auto all = db_.verifiers(command);
    if (verifier >= all.size() || !all[verifier]->algorithm.empty()) {
        throw Refusal(verifier >= all.size() ? "there is no such verifier"
                                             : "the algorithm " + all[verifier]->algorithm + " is not computed here");
    }
    Expected result{all[verifier], all[verifier]->condition, {}, {}};
    compile(result.condition, arguments, result.parameters);
    const std::lock_guard taking(taking_);
    if (result.verifier->changes.of != Reference::Of::nothing) {
        result.parameters.push_back(result.verifier->changes.parameter);
        result.before = decoder_.number(result.verifier->changes);
    }
    expected_.emplace(++expectations_, std::move(result));
    return expectations_;
}

std::vector<Monitor::Judged> Monitor::judge(Id command, const std::map<std::string, std::string> &arguments)
{
    std::vector<Judged> result;
    const std::lock_guard taking(taking_);
    for (const Constraint *constraint : db_.constraints(command)) {
        Judged &judged = result.emplace_back(Judged{constraint, std::nullopt, {}});
        if (!constraint->algorithm.empty()) {
            judged.text = "the algorithm " + constraint->algorithm + " (not known: it is not computed here)";
            continue;
        }
        Condition condition = constraint->condition;
        std::vector<Id> parameters;
        try {
            compile(condition, arguments, parameters);
        } catch (const Refusal &refusal) {
            judged.text = std::string("a condition (not known: ") + refusal.what() + ")";
            continue;
        }
        judged.holds = decoder_.judge(condition);
        judged.text = decoder_.failing(condition);
    }
    return result;
}

void Monitor::forget(std::uint32_t number)
{
    const std::lock_guard taking(taking_);
    expected_.erase(number);
}

/// Add a note for each verifier that the newest packet fulfils.
void Monitor::verify(const Decoded &packet, std::int64_t t, std::vector<Note> &notes)
{
    for (auto &[number, expected] : expected_) {
        const Verifier &verifier = *expected.verifier;
        Id container = packet.container;
        while (container != no_id && container != verifier.container) {
            container = db_.containers[container].base;
        }
        const bool brings =
            std::any_of(packet.fields.begin(), packet.fields.end(), [&parameters = expected.parameters](auto &field) {
                return std::find(parameters.begin(), parameters.end(), field.parameter) != parameters.end();
            });
        if (verifier.container != no_id ? container == no_id : !brings) {
            continue;
        }
        if (verifier.changes.of != Reference::Of::nothing) {
            const auto now = decoder_.number(verifier.changes);
            expected.before = expected.before ? expected.before : now;
            const Number change = now ? *now - *expected.before : 0;
            if (verifier.change > 0 ? !(change >= verifier.change) : !(change <= verifier.change && change != 0)) {
                continue;
            }
        }
        if (expected.condition.kind == Condition::Kind::always || decoder_.applies(expected.condition)) {
            notes.push_back(
                {.kind = Note::Kind::verified,
                 .slot = number,
                 .t = t,
                 .text = verifier.returns.of != Reference::Of::nothing ? decoder_.words(verifier.returns) : ""});
        }
    }
}

std::vector<Note> Monitor::take(std::span<const Arrival> batch)
{
    const std::lock_guard taking(taking_);
    std::vector<Note> notes;
    std::string problem;
    const auto keep = [&](const auto &action) {
        try {
            if (sink_ != nullptr) {
                action();
            }
        } catch (const std::exception &error) {
            problem = problem.empty() ? error.what() : problem;
        }
    };
    touched_.clear();
    for (std::size_t i = 0; i < batch.size(); i++) {
        const Arrival &arrival = batch[i];
        const Decoded &packet = decoder_.decode(arrival.bytes, root_);
        const bool whole = packet.container != no_id && packet.reason.empty();
        keep([&] { sink_->put(arrival, whole ? packet.container : no_id); });
        if (!whole) {
            notes.push_back({.kind = Note::Kind::undecoded, .t = arrival.t, .packet = i, .text = packet.reason});
            continue;
        }
        if (watched_[packet.container]) {
            notes.push_back({.kind = Note::Kind::watched, .t = arrival.t, .packet = i, .container = packet.container});
        }
        apply(packet, arrival, notes);
        verify(packet, arrival.t, notes);
    }
    keep([&] { sink_->save(); });
    if (problem != problem_) {
        notes.push_back({.kind = Note::Kind::archive, .text = problem});
        problem_ = problem;
    }
    if (!batch.empty()) {
        received_ = batch.back().received;
        publish(batch.back().t, notes);
    }
    return notes;
}

void Monitor::apply(const Decoded &packet, const Arrival &arrival, std::vector<Note> &notes)
{
    std::span<const std::uint32_t> slots;
    if (slots_.knows(packet)) {
        slots = slots_.of(packet);
    } else {
        const std::lock_guard shown(shown_);
        slots = slots_.of(packet);
        if (slots_.all().size() > live_.size()) {
            notes.push_back({.kind = Note::Kind::slots, .slot = static_cast<std::uint32_t>(live_.size())});
            grow();
        }
    }
    Newest next;
    next.t = arrival.t;
    next.received = arrival.received;
    next.version = version_ + 1;
    for (std::size_t i = 0; i < slots.size(); i++) {
        const std::uint32_t slot = slots[i];
        if (slot == no_id) {
            if (!full_) {
                full_ = true;
                notes.push_back({.kind = Note::Kind::full,
                                 .text = "there are " + std::to_string(Slots::most) +
                                         " values of the telemetry, and more are not shown; the first one is " +
                                         decoder_.name(packet, i)});
            }
            continue;
        }
        const Field &field = packet.fields[i];
        Live &live = live_[slot];
        const double x = real_of(field.value, packet.values[i]).value_or(0);
        if (x >= live.low && x <= live.high && live.newest.version == next.version) {
            live.newest.t = next.t;
            live.newest.received = next.received;
            live.newest.raw = packet.raw[i];
            live.newest.value = packet.values[i];
            live.newest.status = packet.status[i];
            live.newest.count++;
            continue;
        }
        next.raw = packet.raw[i];
        next.value = packet.values[i];
        next.raw_kind = field.raw;
        next.status = packet.status[i];
        keep(slot, live, field.value, next, &packet, notes);
    }
    write_rows(arrival.t);
}

/// Store the next value of a slot and check its limits.
void Monitor::keep(std::uint32_t slot, Live &live, Kind kind, Newest &next, const Decoded *packet,
                   std::vector<Note> &notes)
{
    next.concern = live.newest.concern;
    next.count = live.newest.count + 1;
    next.text = live.newest.text;
    const double x = real_of(kind, next.value).value_or(0);
    if (!(x >= live.low && x <= live.high)) {
        judge(slot, kind, next, packet, notes);
    }
    if (live.newest.version != next.version) {
        touched_.push_back(slot);
    }
    if (is_bytes(next.raw_kind)) {
        if (next.text == no_id) {
            next.text = static_cast<std::uint32_t>(live_texts_.size());
            live_texts_.emplace_back();
        }
        Texts &texts = live_texts_[next.text];
        texts.raw = packet->text(next.raw);
        texts.value = is_bytes(kind) ? packet->text(next.value) : "";
    }
    live.newest = next;
}

/// Judge a value, and fire the triggers that it feeds.
void Monitor::judge(std::uint32_t slot, Kind kind, Newest &next, const Decoded *packet, std::vector<Note> &notes)
{
    for (const std::uint32_t trigger : feeds_[slot]) {
        if (std::find(fired_.begin(), fired_.end(), trigger) == fired_.end()) {
            fired_.push_back(trigger);
        }
    }
    const Limits *limits = limits_[slot].get();
    if (limits == nullptr || limits->none() || !is_there(next)) {
        return;
    }
    const Newest &before = live_[slot].newest;
    const auto sample = [&](const Newest &newest) {
        return Limits::Sample{kind, newest.raw_kind, newest.status, newest.raw, newest.value, {}};
    };
    Limits::Sample sampled = sample(next), last{};
    if (kind == Kind::text) {
        sampled.text = packet != nullptr ? packet->text(next.value) : std::string_view(live_texts_[next.text].value);
    }
    const bool follows = before.count > 0 && before.count < next.count;
    if (follows) {
        last = sample(before);
    }
    const Concern now = limits->judge(decoder_, sampled, follows ? &last : nullptr, runs_[slot]);
    if (now != next.concern) {
        notes.push_back({.kind = Note::Kind::concern, .slot = slot, .t = next.t, .old = next.concern, .now = now});
    }
    next.concern = live_[slot].newest.concern = now;
    arm(slot);
}

void Monitor::write_rows(std::int64_t t)
{
    for (const std::uint32_t id : fired_) {
        Trigger &trigger = triggers_[id];
        if (!std::all_of(trigger.inputs.begin(), trigger.inputs.end(),
                         [&](std::uint32_t slot) { return live_[slot].newest.count > 0; })) {
            continue;
        }
        trigger.pending.push_back(static_cast<std::uint64_t>(t));
        for (const std::uint32_t slot : trigger.inputs) {
            const Newest &newest = live_[slot].newest;
            trigger.pending.push_back(std::bit_cast<std::uint64_t>(
                number(slots_.all()[slot].kind, newest.value, newest.raw_kind, newest.raw, newest.status)));
        }
    }
    fired_.clear();
}

/// Publish the values of this batch to readers.
void Monitor::publish(std::int64_t t, std::vector<Note> &notes)
{
    const std::lock_guard shown(shown_);
    texts_.resize(live_texts_.size());
    for (const std::uint32_t slot : touched_) {
        newest_[slot] = live_[slot].newest;
        if (newest_[slot].text != no_id) {
            texts_[newest_[slot].text] = live_texts_[newest_[slot].text];
        }
    }
    for (Trigger &trigger : triggers_) {
        if (!trigger.pending.empty()) {
            if (trigger.rows.size() > most_words) {
                trigger.rows.clear();
                notes.push_back(
                    {.kind = Note::Kind::full, .text = "rows of derived parameters were not collected in time"});
            }
            trigger.rows.insert(trigger.rows.end(), trigger.pending.begin(), trigger.pending.end());
            trigger.pending.clear();
        }
    }
    version_ += !touched_.empty();
    t_ = t;
}

// --- readers

void Monitor::check(std::uint32_t slot) const
{
    if (slot >= slots_.all().size()) {
        throw Refusal("there is no slot " + std::to_string(slot) + "; there are " +
                      std::to_string(slots_.all().size()));
    }
}

std::optional<Monitor::Shown> Monitor::newest(std::uint32_t slot) const
{
    const std::lock_guard shown(shown_);
    check(slot);
    const Newest &value = newest_[slot];
    if (value.count == 0) {
        return std::nullopt;
    }
    return value.text == no_id ? Shown{value, "", ""} : Shown{value, texts_[value.text].raw, texts_[value.text].value};
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> Monitor::missing() const
{
    std::vector<std::pair<std::uint32_t, std::uint32_t>> result;
    const std::lock_guard shown(shown_);
    for (std::uint32_t slot = 0; slot < newest_.size(); slot++) {
        if (newest_[slot].count > 0) {
            continue;
        }
        if (result.empty() || result.back().second + 1 != slot) {
            result.emplace_back(slot, slot);
        }
        result.back().second = slot;
    }
    return result;
}

Slot Monitor::slot(std::uint32_t slot) const
{
    const std::lock_guard shown(shown_);
    check(slot);
    return slots_.all()[slot];
}

void Monitor::lend(Decoder &decoder) const
{
    const std::lock_guard taking(taking_);
    decoder.remember(decoder_);
}

std::uint64_t Monitor::version() const
{
    const std::lock_guard shown(shown_);
    return version_;
}

Frame Monitor::changes(std::uint64_t since, std::optional<std::span<const std::uint32_t>> slots) const
{
    constexpr std::size_t head = 32, row = 24;
    const std::lock_guard shown(shown_);
    Frame result;
    result.version = version_;
    result.bytes.resize(head + row * (slots ? slots->size() : newest_.size()));
    std::string texts;
    char *to = result.bytes.data() + head;
    const auto add = [&](std::uint32_t slot) {
        const Newest &newest = newest_[slot];
        if (newest.version <= since) {
            return;
        }
        std::uint64_t word = newest.status == Status::unlabelled ? newest.raw : newest.value;
        if (newest.text != no_id && is_bytes(slots_.all()[slot].kind)) {
            const std::string &text = texts_[newest.text].value;
            word = slice(texts.size(), text.size());
            texts += text;
        }
        store(to, slot);
        store(to + 4, static_cast<std::uint32_t>(newest.concern) | static_cast<std::uint32_t>(newest.status) << 8);
        store(to + 8, static_cast<std::uint64_t>(newest.t));
        store(to + 16, word);
        to += row;
    };
    if (slots) {
        for (const std::uint32_t slot : *slots) {
            check(slot);
            add(slot);
        }
    } else {
        for (std::uint32_t slot = 0; slot < newest_.size(); slot++) {
            add(slot);
        }
    }
    const auto size = static_cast<std::size_t>(to - result.bytes.data());
    to = result.bytes.data();
    store(to, 0x31444C46U); // "FLD1"
    store(to + 8, version_);
    store(to + 16, static_cast<std::uint64_t>(t_));
    store(to + 24, static_cast<std::uint32_t>((size - head) / row));
    store(to + 28, static_cast<std::uint32_t>(texts.size()));
    result.bytes.resize(size);
    result.bytes += texts;
    return result;
}

std::uint32_t Monitor::find(const std::string &name) const
{
    const std::lock_guard shown(shown_);
    return slots_.find(name);
}

std::vector<Monitor::Described> Monitor::slots(std::uint32_t first, std::uint32_t most) const
{
    const std::lock_guard shown(shown_);
    std::vector<Described> result;
    for (std::size_t i = first; i < slots_.all().size() && i - first < most; i++) {
        const Limits *limits = limits_[i].get();
        const auto replaced = replaced_.find(static_cast<std::uint32_t>(i));
        result.push_back({slots_.all()[i], limits != nullptr ? limits->bands() : Bands(),
                          limits != nullptr ? limits->persistence() : 1, std::nullopt});
        if (replaced != replaced_.end()) {
            result.back().replaced = replaced->second ? replaced->second->bands() : Bands();
        }
    }
    return result;
}

// --- limits and derived slots

std::vector<Note> Monitor::set_limits(std::uint32_t slot, const std::optional<Bands> &bands, std::uint32_t persistence)
{
    const std::lock_guard taking(taking_);
    auto limits = bands ? std::make_shared<const Limits>(*bands, persistence) : nullptr;
    {
        const std::lock_guard shown(shown_);
        check(slot);
        if (bands) {
            replaced_.emplace(slot, limits_[slot]);
        } else if (const auto own = replaced_.extract(slot)) {
            limits = own.mapped();
        } else {
            return {};
        }
        limits_[slot] = std::move(limits);
    }
    std::vector<Note> notes;
    Newest next = live_[slot].newest;
    runs_[slot] = {};
    arm(slot);
    if (next.count == 0) {
        return notes;
    }
    touched_.assign(1, slot);
    next.version = version_ + 1;
    if ((!limits_[slot] || limits_[slot]->none()) && next.concern != Concern::normal) {
        notes.push_back({.kind = Note::Kind::concern, .slot = slot, .t = next.t, .old = next.concern});
        next.concern = Concern::normal;
    } else if (is_there(next)) {
        judge(slot, slots_.all()[slot].kind, next, nullptr, notes);
        fired_.clear();
    }
    live_[slot].newest = next;
    arm(slot);
    publish(t_, notes);
    return notes;
}

std::uint32_t Monitor::trigger(std::vector<std::uint32_t> inputs)
{
    const std::lock_guard taking(taking_);
    const std::lock_guard shown(shown_);
    const auto result = static_cast<std::uint32_t>(triggers_.size());
    std::for_each(inputs.begin(), inputs.end(), [&](std::uint32_t slot) { check(slot); });
    for (const std::uint32_t slot : inputs) {
        feeds_[slot].push_back(result);
        arm(slot);
    }
    triggers_.push_back({std::move(inputs), {}, {}});
    return result;
}

std::vector<std::uint64_t> Monitor::rows(std::uint32_t trigger)
{
    const std::lock_guard shown(shown_);
    if (trigger >= triggers_.size()) {
        throw Refusal("there is no trigger " + std::to_string(trigger) + "; there are " +
                      std::to_string(triggers_.size()));
    }
    return std::exchange(triggers_[trigger].rows, {});
}

std::uint32_t Monitor::derive(const std::string &name, const std::string &unit, const std::string &description,
                              const Bands &bands, std::uint32_t persistence)
{
    const std::lock_guard taking(taking_);
    auto limits = std::make_shared<const Limits>(bands, persistence);
    const std::lock_guard shown(shown_);
    const std::uint32_t slot = slots_.add({name, name, no_id, no_id, no_id, Kind::real, unit, description});
    grow();
    limits_[slot] = std::move(limits);
    arm(slot);
    return slot;
}

std::vector<Note> Monitor::put(std::uint32_t slot, std::span<const std::int64_t> t, std::span<const double> values)
{
    const std::lock_guard taking(taking_);
    check(slot);
    if (slots_.all()[slot].parameter != no_id || t.size() != values.size()) {
        throw Refusal(t.size() != values.size()
                          ? "as many times as values are needed; found " + std::to_string(t.size()) + " and " +
                                std::to_string(values.size())
                          : slots_.all()[slot].name + " comes in packets; only a derived parameter is put");
    }
    std::vector<Note> notes;
    touched_.clear();
    for (std::size_t i = 0; i < t.size(); i++) {
        Newest next;
        next.t = t[i];
        next.received = received_;
        next.version = version_ + 1;
        next.raw = next.value = std::bit_cast<std::uint64_t>(values[i]);
        next.raw_kind = Kind::real;
        next.status = values[i] == values[i] ? Status::good : Status::uncalibrated;
        keep(slot, live_[slot], Kind::real, next, nullptr, notes);
        write_rows(t[i]);
    }
    publish(t_, notes);
    return notes;
}

} // namespace fledge::ground
