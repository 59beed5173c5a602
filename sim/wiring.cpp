// SPDX-License-Identifier: Apache-2.0
#include "sim/wiring.h"

#include "flight/exec/task.h"

#include <algorithm>
#include <limits>

namespace fledge::sim {

Copy copy_of(const Wire &wire, const Word *from)
{
    return {from, words(wire.to.bytes()), wire.to.field->size / 8, wire.options.stale_after, 0, EXEC_SOLE, -1};
}

Wiring::Wiring(const Structure &structure, const Roles &roles, Health &health)
    : structure_(structure), roles_(roles), health_(health)
{
    // Pointers go into both, so that their elements must not move.
    exchanges.reserve(structure.wires.size());
    fed_.reserve(structure.feeds.size());
}

void Wiring::lay_out(const Instance &consumer)
{
    for (const Wire &wire : structure_.wires) {
        if (wire.to.instance.get() != &consumer || roles_.at(wire.from.instance.get()).configuration) {
            continue; // the output of a configuration module is copied when it changes
        }
        const Process &reader = *roles_.at(&consumer).process;
        const auto *from =
            reinterpret_cast<const Word *>(roles_.at(wire.from.instance.get()).process->given(wire.from, reader));
        if (wire.options.latency) {
            const std::uint32_t n = wire.from.field->size / 8;
            const Ns period = std::max(longest_period(*roles_.at(wire.from.instance.get()).process),
                                       longest_period(*roles_.at(&consumer).process));
            exchanges.push_back({&wire, from, n, period, -1, std::vector<std::uint64_t>(n)});
            from = exchanges.back().held.data();
        }
        Copy copy = copy_of(wire, from);
        const auto first =
            std::find_if(copies_.begin(), copies_.end(), [&](const Copy &other) { return other.to == copy.to; });
        if (wire.options.by == EXEC_IN_MODE) {
            copy.by = EXEC_IN_MODE;
            copy.mode = reader.mode_index(wire.options.mode);
        } else if (first != copies_.end()) {
            copy.by = wire.options.by;
        }
        if (wire.options.stale_after) {
            copy.age = first == copies_.end() ? health_.watch_age(wire.to) : first->age;
        }
        copies_.push_back(copy);
    }
    for (const Feed &feed : structure_.feeds) {
        if (feed.to.instance.get() == &consumer && feed.messages) {
            const std::uint32_t n = feed.to.field->size / 8;
            fed_.push_back({&feed, 0, std::vector<std::uint64_t>(n)});
            copies_.push_back({fed_.back().held.data(), words(feed.to.bytes()), n, feed.stale_after, 0, EXEC_SOLE, -1});
            if (feed.stale_after) {
                copies_.back().age = health_.watch_age(feed.to);
            }
        }
    }
}

const Word *Wiring::source(const Port &input) const
{
    const Word *const own = words(input.bytes());
    const auto found = std::find_if(copies_.begin(), copies_.end(), [&](const Copy &copy) { return copy.to == own; });
    return found == copies_.end() ? own : found->from;
}

const Word *Wiring::incoming(const Port &input, std::int32_t mode, Ns t) const
{
    // If nothing is carried: of configuration, which is there already; without a wire; or not in this mode.
    const Word *const own = words(input.bytes()), *source = own;
    for (const Copy &copy : copies_) {
        if (copy.to == own && (copy.by == EXEC_SOLE || takes(copy, source, mode, t))) {
            source = copy.from;
        }
    }
    return source;
}

void Wiring::clear() const
{
    for (const Wire &wire : structure_.wires) {
        std::memset(wire.to.bytes(), 0, wire.to.field->size);
    }
    for (const Feed &feed : structure_.feeds) {
        std::memset(feed.to.bytes(), 0, feed.to.field->size);
    }
}

void Wiring::hold_outputs()
{
    for (Exchange &exchange : exchanges) {
        copy_words(exchange.from, exchange.held.data(), exchange.words);
        exchange.done = -1;
    }
}

void Wiring::feed_again()
{
    for (Fed &fed : fed_) {
        fed.due = 0;
    }
}

void Wiring::exchange(Ns t)
{
    for (Exchange &exchange : exchanges) {
        // Hold the message of the last multiple of the period before t.
        const Ns due = t > 0 ? (t - 1) / exchange.period * exchange.period : -1;
        if (due > exchange.done) {
            exchange.done = due;
            copy_words(exchange.from, exchange.held.data(), exchange.words);
        }
    }
}

/// What an input that is fed gets at t, and when that changes next.
void Wiring::deliver(Fed &fed, Ns t)
{
    const Messages &messages = *fed.feed->messages;
    const std::size_t n = messages.until(t);
    std::byte *held = reinterpret_cast<std::byte *>(fed.held.data());
    fed.due = n < messages.times.size() ? messages.times[n] : std::numeric_limits<Ns>::max();
    if (n == 0) {
        std::fill(fed.held.begin(), fed.held.end(), 0); // nothing was written yet
        return;
    }
    const std::byte *last = messages.message(n - 1);
    std::memcpy(held, last, fed.held.size() * sizeof(Word));
    const bool between = !fed.feed->linear.empty() && n < messages.times.size();
    if (!between && !fed.feed->always) {
        return;
    }
    fed.due = exec_later(t, 1);
    // A writing for each instant. The reader's own memory has the last one, so that a snapshot has it.
    Head head, seen;
    std::memcpy(&head, held, sizeof head);
    std::memcpy(&seen, fed.feed->to.bytes(), sizeof seen);
    if (between) {
        const std::byte *coming = messages.message(n);
        const double share = static_cast<double>(t - messages.times[n - 1]) /
                             static_cast<double>(messages.times[n] - messages.times[n - 1]);
        for (const std::uint32_t at : fed.feed->linear) {
            double a, b;
            std::memcpy(&a, last + at, sizeof a);
            std::memcpy(&b, coming + at, sizeof b);
            a += share * (b - a);
            std::memcpy(held + at, &a, sizeof a);
        }
        Head later;
        std::memcpy(&later, coming, sizeof later);
        head.quality = quality_min(head.quality, later.quality);
    }
    head = head_next(seen, t, head.quality);
    std::memcpy(held, &head, sizeof head);
}

bool Wiring::override_input(const Port &input, std::uint32_t place, double value,
                            const std::function<void(std::uint32_t)> &inserted)
{
    const Word *message = words(input.bytes());
    Word *to = words(input.bytes() + place);
    const auto is = [&](const Word *end) { return [=](const Copy &copy) { return copy.to == end; }; };
    const auto last = std::find_if(copies_.rbegin(), copies_.rend(), is(message)); // of several, behind all
    if (last == copies_.rend()) {
        return false;
    }
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (std::uint64_t &number : overrides_) {
        const auto from = [&](const Copy &copy) { return copy.from == &number && copy.to == to; };
        if (std::any_of(copies_.begin(), copies_.end(), from)) {
            number = bits;
            return true;
        }
    }
    // One more copy, of a word, behind that of the message.
    const auto at = static_cast<std::uint32_t>(copies_.rend() - last);
    copies_.insert(copies_.begin() + at, {&overrides_.emplace_back(bits), to, 1, 0, 0, EXEC_SOLE, -1});
    inserted(at);
    return true;
}

} // namespace fledge::sim
