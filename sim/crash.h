// SPDX-License-Identifier: Apache-2.0
// What each thread runs, so that a crash of a module names the module, its task, the time, and how to look into it.
#pragma once

#include "sim/instance.h"

#include <atomic>
#include <cstdint>
#include <string>

namespace fledge::sim {

struct Task;

/// Of a thread. The loop writes it; signal handlers read it, and the watchdog compares it.
struct Running {
    static constexpr Ns nothing = -2; ///< no simulation runs

    std::atomic<Ns> t{nothing};
    std::atomic<const Task *> task{nullptr};         ///< null: none, as in a reset
    std::atomic<const Instance *> instance{nullptr}; ///< whose function runs; null: none
    std::atomic<std::uint64_t> runs{0};              ///< how many have begun
    std::atomic<std::int64_t> of_campaign{-1};       ///< the index of the run; -1: of no campaign
    std::atomic<const char *> function{nullptr};     ///< of an FMU, that runs now; null: none
    std::atomic<const char *> fmu{nullptr};          ///< its file
};

/// That of the calling thread. Where somebody watches, the thread gets a stack for signal handlers with it.
Running &running();

/// In this block a function of the instance runs, or a simulation. After it, all is as it was before.
class Runs {
public:
    explicit Runs(const Instance *instance = nullptr);
    ~Runs();
    Running &now() const { return now_; } ///< of this thread
    Runs(const Runs &) = delete;
    Runs &operator=(const Runs &) = delete;

private:
    Running &now_;
    Ns t_;
    const Task *task_;
    const Instance *instance_;
    std::int64_t of_campaign_;
};

/// In this block a function of an FMU runs. Both texts outlive it.
class Inside {
public:
    Inside(const char *function, const char *fmu);
    ~Inside();
    Inside(const Inside &) = delete;
    Inside &operator=(const Inside &) = delete;

private:
    Running &now_;
};

/// From now on, a signal that ends the program while a thread runs a simulation first reports on stderr what runs, and
/// `command`, which shows the place in a debugger; `of_run` begins that for a run of a campaign, whose index follows.
/// What handled the signal before does so after that. Under the sanitizers, which report crashes themselves, nothing
/// changes.
void report_crashes(const std::string &command, const std::string &of_run);

/// An update that takes longer than this [ns of wall time] ends the program, with the same words; 0: none does.
void limit_updates(Ns limit);

} // namespace fledge::sim
