// SPDX-License-Identifier: Apache-2.0
// The schedule as the loop walks it: flat arrays, no names, nothing that allocates.
// Private to the kernel.
#pragma once

#include "sim/simulation.h"

#include <limits>

namespace fledge::sim {

/// Messages are copied as words; their structs hold no padding and are multiples of 8 bytes.
using Word [[gnu::may_alias]] = std::uint64_t;

struct Copy {
    const Word *from;
    Word *to;
    std::uint32_t words;
    Ns stale_after; ///< 0: never
};

struct Step {
    void (*update)(void *, Tick);
    void *self;
    std::uint32_t first_copy, last_copy; ///< the wires into it, in Runtime::copies
};

struct RunTask {
    const Task *task;
    Process *process;
    std::uint32_t first_step, last_step;
    Ns period, offset;
    Ns next = 0;
    Ns last = -1; ///< when it last ran; -1: not since its reset
    bool active = true;
};

/// A wire with latency: the consumer reads `held`, the output at the end of the last exchange before.
struct Exchange {
    const Word *from;
    std::uint32_t words;
    Ns period;
    Ns done; ///< the last exchange's time; -1: none yet
    std::vector<std::uint64_t> held;
};

/// A module in no task: its parameters are published at the start and whenever they were changed.
struct Configuration {
    Instance *instance;
    std::vector<Copy> copies; ///< the wires from it
};

struct Simulation::Runtime {
    explicit Runtime(Simulation &owner);

    void reset(Ns after = -1); ///< the first instant comes after this time
    void instant();            ///< run one
    bool run_until(Ns t, const RunControl &control);
    Ns next_instant() const;

    /// Take over what the user changed between two runs: checked, derived and published anew.
    void take_parameters();
    bool parameters_changed() const;

    /// What comes before a run until t: the parameters are taken over, and the models asked whether
    /// they can go so far. Throws SetupError with all that cannot, RunError if the run has failed.
    void ready_for(Ns t);

    std::vector<std::byte> save() const;
    void restore(std::span<const std::byte> bytes);

    static constexpr Ns never = std::numeric_limits<Ns>::max();

    Simulation &simulation;
    std::vector<Copy> copies;
    std::vector<Step> steps;
    std::vector<RunTask> tasks; ///< in the order of equal times
    std::vector<Exchange> exchanges;
    std::vector<Configuration> configuration;
    std::vector<std::pair<Instance *, std::vector<std::byte>>> known; ///< parameters as last seen
    Ns now = -1;
    Ns next = 0;
    std::string failure; ///< why the run cannot go on; "" if it can
    PaceReport pace;

private:
    void lay_out_wires(const Instance &consumer);
    Ns next_of(const RunTask &task) const;
    void enter_mode(Process &process, Ns t);
    void run_task(RunTask &task, Ns t);
    void run_events(Ns t);
    void publish(const Configuration &module, Ns t);
    void shape(const std::function<void(void *, std::size_t)> &block) const;
    std::uint64_t shape_hash() const;
};

} // namespace fledge::sim
