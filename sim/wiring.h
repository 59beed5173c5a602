// SPDX-License-Identifier: Apache-2.0
// The wires of a run: which words are copied before an update, and what wires with latency and feeds hold.
// Private to the kernel.
#pragma once

#include "flight/exec/message.h"
#include "sim/health.h"
#include "sim/structure.h"

#include <cstring>
#include <deque>
#include <functional>

namespace fledge::sim {

/// Messages are copied as words; their structs hold no padding and are multiples of 8 bytes.
using Word [[gnu::may_alias]] = std::uint64_t;

inline Word *words(std::byte *p)
{
    return reinterpret_cast<Word *>(p);
}

struct Copy {
    const Word *from;
    Word *to;
    std::uint32_t words;
    Ns stale_after;    ///< 0: never
    std::uint32_t age; ///< its number in Health, if it ages
    ExecChoice by;     ///< EXEC_SOLE: it is carried, whatever the input holds
    std::int32_t mode; ///< EXEC_IN_MODE: it is carried in this one
};

Copy copy_of(const Wire &wire, const Word *from);

// Each file has its own: CMakeLists.txt compiles the loop's with options of its own.

/// By four pairs of words, and what is left by the bits of its number: for the few dozen bytes of a message it beats a
/// call of memcpy, which gcc would make of a loop but for an option in CMakeLists.txt.
static inline void copy_words(const Word *from, Word *to, std::uint32_t n)
{
    using Pair [[gnu::vector_size(16), gnu::aligned(8), gnu::may_alias]] = std::uint64_t;
    const auto copy_pairs = [&](std::uint32_t count) {
#pragma GCC unroll 4
        for (std::uint32_t i = 0; i < 2 * count; i += 2) {
            *reinterpret_cast<Pair *>(to + i) = *reinterpret_cast<const Pair *>(from + i);
        }
        from += 2 * count;
        to += 2 * count;
    };
    const Word *const end = from + (n & ~7u);
    while (from != end) {
        copy_pairs(4);
    }
    if (n & 4u) {
        copy_pairs(2);
    }
    if (n & 2u) {
        copy_pairs(1);
    }
    if (n & 1u) {
        *to = *from;
    }
}

/// Whether an input that holds this message takes the one of the copy.
static inline bool takes(const Copy &copy, const Word *held, std::int32_t mode, Ns t)
{
    if (copy.by == EXEC_IN_MODE) {
        return copy.mode == mode;
    }
    Head heads[2];
    std::memcpy(&heads[0], held, sizeof(Head));
    std::memcpy(&heads[1], copy.from, sizeof(Head));
    return exec_takes(copy.by, heads[0], heads[1], t, copy.stale_after);
}

/// Returns whether the message became stale.
static inline bool carry(const Copy &copy, std::int32_t mode, Ns t)
{
    if (copy.by == EXEC_SOLE || takes(copy, copy.to, mode, t)) {
        copy_words(copy.from, copy.to, copy.words);
    }
    if (copy.stale_after) {
        Head head;
        std::memcpy(&head, copy.to, sizeof head);
        const Quality before = head.quality;
        exec_age(&head, t, copy.stale_after);
        std::memcpy(copy.to, &head, sizeof head);
        return head.quality != before;
    }
    return false;
}

/// A wire with latency: the consumer reads `held`, the output at the end of the last exchange before.
struct Exchange {
    const Wire *wire;
    const Word *from;
    std::uint32_t words;
    Ns period;
    Ns done; ///< the last exchange's time; -1: none yet
    std::vector<std::uint64_t> held;
};

/// An input that is fed by hand: its reader gets `held`.
struct Fed {
    const Feed *feed;
    Ns due; ///< when `held` changes next
    std::vector<std::uint64_t> held;
};

class Wiring {
public:
    Wiring(const Structure &structure, const Roles &roles, Health &health);

    /// The wires into an instance: their copies are the next.
    void lay_out(const Instance &consumer);
    std::uint32_t size() const { return static_cast<std::uint32_t>(copies_.size()); }

    const Copy *copies() const { return copies_.data(); }

    /// Where the first wire into an input reads; the input itself if there is none.
    const Word *source(const Port &input) const;

    /// What an input will take, in this mode.
    const Word *incoming(const Port &input, std::int32_t mode, Ns t) const;

    /// Nothing was written yet into any input.
    void clear() const;

    /// At the start: each wire with latency holds the message of the reset.
    void hold_outputs();

    /// What feeds deliver has changed: look at it anew.
    void feed_again();

    /// What wires with latency, and feeds, deliver at t.
    void exchange(Ns t);
    bool feeds() const { return !fed_.empty(); }
    void feed(Ns t)
    {
        for (Fed &fed : fed_) {
            if (t >= fed.due) {
                deliver(fed, t);
            }
        }
    }

    /// Place a number into what comes to an input. Returns whether a wire leads to it; inserted: a copy was, there.
    bool override_input(const Port &input, std::uint32_t place, double value,
                        const std::function<void(std::uint32_t)> &inserted);

    std::vector<Exchange> exchanges; ///< of each wire with latency

private:
    void deliver(Fed &fed, Ns t);

    const Structure &structure_;
    const Roles &roles_;
    Health &health_;
    std::vector<Copy> copies_;
    std::vector<Fed> fed_;
    std::deque<std::uint64_t> overrides_; ///< numbers in place of those that come to inputs
};

} // namespace fledge::sim
