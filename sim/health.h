// SPDX-License-Identifier: Apache-2.0
// The health of a run: what a user should know although the run went on. The kernel watches each output when its module
// has run, and each input that can become stale; the order of the modules and their periods follow from the structure.
#pragma once

#include "sim/structure.h"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace fledge::sim {

/// Something that a user should know. `path` is that of the output, input or instance.
struct Finding {
    enum class Kind {
        unwritten,  ///< a wired output that its module did not write, although the module ran
        held,       ///< an output that kept its last value, because an input was missing or the result not finite
        degraded,   ///< an output made from stale, missing or incomplete data
        stale,      ///< an input older than its wire allows
        saturated,  ///< a module at its limits
        not_finite, ///< an output with an infinity or NaN; of a model: at the end of the run
        late,       ///< an input that is read a step late, where another order of the modules would not
        uneven,     ///< a wire between tasks whose periods do not divide
    };
    Kind kind;
    std::string path;
    Ns first = -1;           ///< when first; -1: it follows from the structure
    std::uint64_t count = 0; ///< updates
    std::string text;        ///< all of it in words
};

/// "x[2] is nan" of the first double in a message that is not finite; "" if all are.
std::string not_finite(const FledgeStruct &type, const std::byte *message);

/// "unwritten", "held", ...
const char *kind_name(Finding::Kind kind);

/// Wires that read a step late or with a changing age, from the structure alone.
std::vector<Finding> structural_findings(const Structure &structure);

/// Counts what happens during a run. Does not allocate after the structure is laid out.
class Health {
public:
    explicit Health(const Structure &structure);

    /// Lay out: watch the outputs of an instance that a task advances, and its counter `saturated`.
    void watch(const Instance &instance, const Task &task, const Structure &structure);
    /// Lay out: all instances of a task are watched; returns its number.
    std::uint32_t end_task();
    /// Lay out: watch the age of an input; returns its number.
    std::uint32_t watch_age(const Port &input);

    void reset();

    /// A task has run at t. Throws RunError if a module of flight has put out a number that is not finite as GOOD.
    void task_ran(std::uint32_t number, Ns t)
    {
        Watched &task = tasks_[number];
        task.updates++;
        const bool finite = task.first_double == task.last_double || all_finite(task);
        std::uint32_t other = 0; // than good
        for (Seen *seen = seen_.data() + task.first_output, *const end = seen_.data() + task.last_output; seen != end;
             seen++) {
            // Each by itself: one load of both would wait for the two stores of the module.
            std::uint32_t quality, sequence;
            __builtin_memcpy(&quality, seen->message + offsetof(Head, quality), sizeof quality);
            __builtin_memcpy(&sequence, seen->message + offsetof(Head, sequence), sizeof sequence);
            seen->before = seen->sequence;
            seen->sequence = sequence;
            other |= quality ^ QUALITY_GOOD;
        }
        if (other || !finite) {
            note(task, finite, t);
        }
        for (std::uint32_t i = task.first_limit; i < task.last_limit; i++) {
            Limit &limit = limits_[i];
            if (*limit.counter > limit.seen) {
                limit.saturated.add(t);
            }
            limit.seen = *limit.counter; // a mode that begins resets it
        }
    }
    void was_stale(std::uint32_t input, Ns t) { ages_[input].stale.add(t); }

    std::vector<Finding> findings() const;

    /// As Runtime::visit_state.
    template <class Visit> void visit_state(const Visit &block)
    {
        for (Watched &task : tasks_) {
            block(&task.updates, sizeof task.updates);
        }
        for (Seen &seen : seen_) {
            block(&seen.sequence, sizeof seen.sequence);
        }
        for (Output &output : outputs_) {
            block(&output.tallies, sizeof output.tallies);
        }
        for (Limit &limit : limits_) {
            block(&limit.seen, sizeof limit.seen);
            block(&limit.saturated, sizeof limit.saturated);
        }
        for (Age &age : ages_) {
            block(&age.stale, sizeof age.stale);
        }
    }

private:
    struct Watched {
        std::uint32_t first_output, last_output, first_double, last_double, first_limit, last_limit;
        std::uint64_t updates;
    };
    /// What the loop looks at of an output. The rest is in outputs_, in the same place.
    struct Seen {
        const std::byte *message;
        std::uint32_t sequence; ///< of its last writing
        std::uint32_t before;   ///< the same, before the last update

        bool written() const { return sequence != before; } ///< by the last update
    };
    /// Doubles of a message that follow each other.
    struct Doubles {
        const std::byte *first;
        std::size_t n;
    };
    struct Output {
        std::uint64_t grace; ///< updates without a writing until the first exchange of wires with latency
        struct {
            Tally unwritten, held, degraded, not_finite;
        } tallies;
        const Instance *instance;
        const FledgeField *field;
        std::string reader; ///< the first input that it is wired to; "" if there is none
        std::uint32_t task;
    };
    struct Limit {
        const std::uint64_t *counter; ///< in the instance's memory
        std::uint64_t seen;
        Tally saturated;
        const Instance *instance;
        std::uint32_t task;
    };
    struct Age {
        std::string input;
        Tally stale;
    };

    /// Whether the doubles of a task are finite. The exponent of one that is not has no bit that is 0, so that adding
    /// 1 to it carries into the sign.
    bool all_finite(const Watched &task) const
    {
        using Pair [[gnu::vector_size(16), gnu::aligned(8), gnu::may_alias]] = std::uint64_t;
        constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000u, lowest = 0x0010'0000'0000'0000u;
        Pair carry{};
        std::uint64_t last = 0; // of those that are not in a pair
        for (std::uint32_t i = task.first_double; i < task.last_double; i++) {
            const std::byte *at = doubles_[i].first;
            for (std::size_t n = doubles_[i].n / 2; n > 0; n--, at += sizeof(Pair)) {
                carry |= (*reinterpret_cast<const Pair *>(at) & exponent) + lowest;
            }
            if (doubles_[i].n % 2) {
                std::uint64_t bits;
                __builtin_memcpy(&bits, at, sizeof bits);
                last |= (bits & exponent) + lowest;
            }
        }
        return !((carry[0] | carry[1] | last) >> 63);
    }
    void note(const Watched &task, bool finite, Ns t);

    Ns first_exchange_; ///< the latest time at which an output may wait for its first inputs; 0: no exchanges
    std::vector<Watched> tasks_;
    std::vector<Seen> seen_;
    /// Of flight's outputs. findings() looks at those of models.
    std::vector<Doubles> doubles_;
    std::vector<Output> outputs_;
    std::vector<Limit> limits_;
    std::vector<Age> ages_;
};

} // namespace fledge::sim
