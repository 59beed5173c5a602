// SPDX-License-Identifier: Apache-2.0
#include "ground/monitor/monitor.h"

#include <algorithm>
#include <cmath>
#include <regex>

namespace fledge::ground {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr std::size_t most_words = 1 << 22; // of a trigger's rows
constexpr std::size_t most_pattern = 1000;  // characters of a pattern
constexpr std::size_t most_matched = 4096;  // bytes of a text that a pattern is compared with

bool is_bytes(Kind kind)
{
    return kind == Kind::text || kind == Kind::binary;
}

bool is_there(const Newest &one)
{
    return one.status == Status::good || one.status == Status::unlabelled;
}

template <class Unsigned> void store(char *to, Unsigned number)
{
    for (std::size_t i = 0; i < sizeof number; i++) { // which a compiler makes one store
        to[i] = static_cast<char>(number >> 8 * i & 0xFF);
    }
}

} // namespace

/// An alarm, compiled.
struct Monitor::Check {
    const Condition *when; ///< nullptr: always
    std::uint32_t violations;
    bool on_change;
    std::vector<Alarm::Limits> limits;
    std::vector<Concern> of_label; ///< of each enumerator
    std::vector<std::pair<std::regex, Concern>> patterns;
    Concern otherwise; ///< than labels and patterns
};

struct Monitor::Limits {
    std::vector<Check> checks;               ///< the first whose condition holds counts
    double low = infinite, high = -infinite; ///< all is well for a number from low to high, whatever else there is
    bool persists = false;                   ///< some need several violations

    Limits(const Type &type) // NOLINT(google-explicit-constructor): made in place
    {
        for (const Alarm &alarm : type.alarms) {
            Check made{alarm.when.what != Condition::What::always ? &alarm.when : nullptr,
                       alarm.violations,
                       alarm.on_change,
                       alarm.limits,
                       {},
                       {},
                       alarm.otherwise};
            if (type.sort == Type::Sort::enumerated && (!alarm.labels.empty() || alarm.otherwise != Concern::normal)) {
                made.of_label.assign(type.enumerators.size(), alarm.otherwise);
                for (const auto &[label, concern] : alarm.labels) {
                    for (std::size_t i = 0; i < type.enumerators.size(); i++) {
                        made.of_label[i] = type.enumerators[i].label == label ? concern : made.of_label[i];
                    }
                }
            } else {
                for (const auto &[pattern, concern] : alarm.labels) {
                    made.patterns.emplace_back(compiled(type, pattern), concern);
                }
            }
            checks.push_back(std::move(made));
        }
        finish();
    }

    Limits(const Bands &bands, std::uint32_t persistence)
    {
        if (bands.empty()) {
            return;
        }
        Check made{nullptr, std::max(persistence, 1U), false, {}, {}, {}, Concern::normal};
        for (const auto &[level, band] : bands) {
            if (!(band.first <= band.second)) {
                throw Refusal("a band of limits is from the lower to the higher number; found " +
                              std::to_string(band.first) + " to " + std::to_string(band.second));
            }
            made.limits.push_back({level, Range{band.first, band.second}, false});
        }
        checks.push_back(std::move(made));
        finish();
    }

    Bands bands() const
    {
        Bands made;
        if (!checks.empty() && checks.back().when == nullptr && !checks.back().on_change) {
            for (const Alarm::Limits &one : checks.back().limits) {
                if (!one.inside && one.range.calibrated) {
                    made.emplace(one.level, std::pair(one.range.low, one.range.high));
                }
            }
        }
        return made;
    }

private:
    static std::regex compiled(const Type &type, const std::string &pattern)
    {
        try {
            if (pattern.size() > most_pattern) {
                throw std::regex_error(std::regex_constants::error_complexity);
            }
            return std::regex(pattern, std::regex_constants::ECMAScript | std::regex_constants::__polynomial);
        } catch (const std::regex_error &error) {
            throw Refusal("an alarm of " + type.path + " has a pattern that is no regular expression, or too long: " +
                          pattern.substr(0, 60) + " (" + error.what() + ")");
        }
    }

    void finish()
    {
        bool simple = checks.size() == 1;
        for (const Check &check : checks) {
            persists = persists || check.violations > 1;
            simple =
                simple && check.when == nullptr && !check.on_change && check.of_label.empty() && check.patterns.empty();
            for (const Alarm::Limits &one : check.limits) {
                simple = simple && !one.inside && one.range.calibrated;
            }
        }
        if (simple) {
            low = -infinite, high = infinite;
            for (const Alarm::Limits &one : checks[0].limits) {
                const Range &range = one.range;
                low = std::max(low, range.low_open ? std::nextafter(range.low, infinite) : range.low);
                high = std::min(high, range.high_open ? std::nextafter(range.high, -infinite) : range.high);
            }
        }
    }
};

/// What the taker knows of a slot.
struct Monitor::Live {
    Newest newest;
    double low = -infinite, high = infinite; ///< a number between them needs no other care
};

struct Monitor::Trigger {
    std::vector<std::uint32_t> inputs;
    std::vector<std::uint64_t> pending, rows; ///< until they are saved, and then
};

Monitor::Monitor(const Database &database, Id root)
    : db_(database), root_(root), decoder_(db_), watched_(db_.containers.size()), slots_(db_),
      by_type_(db_.types.size())
{
    grow();
}

Monitor::~Monitor() = default;

/// Places for the slots that are new. Under both locks.
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

/// Set what numbers of a slot need no care.
void Monitor::arm(std::uint32_t slot)
{
    Live &live = live_[slot];
    const Limits *limits = limits_[slot].get();
    const auto &runs = runs_[slot];
    const bool uneasy = live.newest.concern != Concern::normal || runs != decltype(runs_)::value_type{};
    const bool all = limits == nullptr || limits->checks.empty();
    const Slot &what = slots_.all()[slot];
    const bool bytes = is_bytes(what.kind) || (what.type != no_id && is_bytes(raw_kind(db_.types[what.type].encoding)));
    live.low = uneasy || bytes || !feeds_[slot].empty() ? infinite : all ? -infinite : limits->low;
    live.high = all ? infinite : limits->high;
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
        const Id one = all.back();
        all.pop_back();
        if (!watched_[one]) {
            watched_[one] = true;
            all.insert(all.end(), db_.containers[one].heirs.begin(), db_.containers[one].heirs.end());
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
            notes.push_back({.what = Note::What::undecoded, .t = arrival.t, .packet = i, .text = packet.reason});
            continue;
        }
        if (watched_[packet.container]) {
            notes.push_back({.what = Note::What::watched, .t = arrival.t, .packet = i, .container = packet.container});
        }
        apply(packet, arrival, notes);
    }
    keep([&] { sink_->save(); });
    if (problem != problem_) {
        notes.push_back({.what = Note::What::archive, .text = problem});
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
            notes.push_back({.what = Note::What::slots, .slot = static_cast<std::uint32_t>(live_.size())});
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
                notes.push_back({.what = Note::What::full,
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

/// The next value of a slot, with all care.
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

/// The concern of a value, and the triggers that it feeds.
void Monitor::judge(std::uint32_t slot, Kind kind, Newest &next, const Decoded *packet, std::vector<Note> &notes)
{
    for (const std::uint32_t trigger : feeds_[slot]) {
        if (std::find(fired_.begin(), fired_.end(), trigger) == fired_.end()) {
            fired_.push_back(trigger);
        }
    }
    const Limits *limits = limits_[slot].get();
    if (limits == nullptr || limits->checks.empty() || !is_there(next)) {
        return;
    }
    const auto [level, violations] = level_of(*limits, kind, next, live_[slot].newest, packet);
    Concern now = level;
    auto &runs = runs_[slot];
    if (limits->persists) {
        now = Concern::normal;
        for (std::size_t i = 0; i < runs.size(); i++) {
            const auto one = static_cast<Concern>(i + 1);
            runs[i] = level < one ? 0 : runs[i] + (runs[i] != ~0U);
            now = runs[i] >= violations ? one : now;
        }
    }
    if (now != next.concern) {
        notes.push_back({.what = Note::What::concern, .slot = slot, .t = next.t, .old = next.concern, .now = now});
    }
    next.concern = live_[slot].newest.concern = now;
    arm(slot);
}

/// The level of a value, and how many in a row it takes.
std::pair<Concern, std::uint32_t> Monitor::level_of(const Limits &limits, Kind kind, const Newest &next,
                                                    const Newest &before, const Decoded *packet)
{
    const auto chosen = std::find_if(limits.checks.begin(), limits.checks.end(), [&](const Check &one) {
        return one.when == nullptr || decoder_.applies(*one.when);
    });
    if (chosen == limits.checks.end()) {
        return {Concern::normal, 1};
    }
    Concern level = Concern::normal;
    const auto number_of = [&](const Newest &one, bool calibrated) {
        const auto raw = real_of(one.raw_kind, one.raw);
        return calibrated && kind != Kind::label ? real_of(kind, one.value) : raw;
    };
    for (const Alarm::Limits &one : chosen->limits) {
        auto x = number_of(next, one.range.calibrated);
        if (chosen->on_change) {
            const auto last =
                before.count > 0 && is_there(before) ? number_of(before, one.range.calibrated) : std::nullopt;
            x = x && last ? std::optional(*x - *last) : std::nullopt;
        }
        if (x && one.range.holds(*x) == one.inside) {
            level = std::max(level, one.level);
        }
    }
    if (!chosen->of_label.empty()) {
        level =
            std::max(level, next.value < chosen->of_label.size() ? chosen->of_label[next.value] : chosen->otherwise);
    } else if (!chosen->patterns.empty() && kind == Kind::text) {
        const std::string_view text = packet->text(next.value);
        const auto found = std::find_if(chosen->patterns.begin(), chosen->patterns.end(), [&](const auto &one) {
            return text.size() <= most_matched && std::regex_match(text.begin(), text.end(), one.first);
        });
        level = std::max(level, found != chosen->patterns.end() ? found->second : chosen->otherwise);
    }
    return {level, chosen->violations};
}

void Monitor::write_rows(std::int64_t t)
{
    for (const std::uint32_t one : fired_) {
        Trigger &trigger = triggers_[one];
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

/// Show what was touched.
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
                    {.what = Note::What::full, .text = "rows of derived parameters were not collected in time"});
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
    const Newest &one = newest_[slot];
    if (one.count == 0) {
        return std::nullopt;
    }
    return one.text == no_id ? Shown{one, "", ""} : Shown{one, texts_[one.text].raw, texts_[one.text].value};
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
    Frame made;
    made.version = version_;
    made.bytes.resize(head + row * (slots ? slots->size() : newest_.size()));
    std::string texts;
    char *to = made.bytes.data() + head;
    const auto add = [&](std::uint32_t slot) {
        const Newest &one = newest_[slot];
        if (one.version <= since) {
            return;
        }
        std::uint64_t word = one.status == Status::unlabelled ? one.raw : one.value;
        if (one.text != no_id && is_bytes(slots_.all()[slot].kind)) {
            const std::string &text = texts_[one.text].value;
            word = slice(texts.size(), text.size());
            texts += text;
        }
        store(to, slot);
        store(to + 4, static_cast<std::uint32_t>(one.concern) | static_cast<std::uint32_t>(one.status) << 8);
        store(to + 8, static_cast<std::uint64_t>(one.t));
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
    const auto size = static_cast<std::size_t>(to - made.bytes.data());
    to = made.bytes.data();
    store(to, 0x31444C46U); // "FLD1"
    store(to + 8, version_);
    store(to + 16, static_cast<std::uint64_t>(t_));
    store(to + 24, static_cast<std::uint32_t>((size - head) / row));
    store(to + 28, static_cast<std::uint32_t>(texts.size()));
    made.bytes.resize(size);
    made.bytes += texts;
    return made;
}

std::uint32_t Monitor::find(const std::string &name) const
{
    const std::lock_guard shown(shown_);
    return slots_.find(name);
}

std::vector<Monitor::Described> Monitor::slots(std::uint32_t first) const
{
    const std::lock_guard shown(shown_);
    std::vector<Described> made;
    for (std::size_t i = first; i < slots_.all().size(); i++) {
        const Limits *limits = limits_[i].get();
        const bool any = limits != nullptr && !limits->checks.empty();
        made.push_back({slots_.all()[i], any ? limits->bands() : Bands(), any ? limits->checks.back().violations : 1});
    }
    return made;
}

// --- limits and derived slots

std::vector<Note> Monitor::set_limits(std::uint32_t slot, const Bands &bands, std::uint32_t persistence)
{
    const std::lock_guard taking(taking_);
    auto limits = std::make_shared<const Limits>(bands, persistence);
    {
        const std::lock_guard shown(shown_);
        check(slot);
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
    if (bands.empty() && next.concern != Concern::normal) {
        notes.push_back({.what = Note::What::concern, .slot = slot, .t = next.t, .old = next.concern});
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
    const auto made = static_cast<std::uint32_t>(triggers_.size());
    std::for_each(inputs.begin(), inputs.end(), [&](std::uint32_t slot) { check(slot); });
    for (const std::uint32_t slot : inputs) {
        feeds_[slot].push_back(made);
        arm(slot);
    }
    triggers_.push_back({std::move(inputs), {}, {}});
    return made;
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
