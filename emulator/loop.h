// SPDX-License-Identifier: Apache-2.0
// A machine in the loop: flight on it is paced by the clock of its register space.
//
// The first tick, with t < 0, finds a computer that was just switched on. Simulated time 0 is `boot_time` later; from
// then on the time of the machine follows simulated time. At a tick the machine first runs up to the tick's time:
// flight finishes its record, and idles. Then it sees the tick, and runs until flight has stored that it is done. If
// flight is not done before its next instant, the tick is answered for it, and counts as missed: the world never waits.
#pragma once

#include <cstdint>
#include <functional>

#include "emulator/machine.h"
#include "registers/clock.h"

namespace fledge::emulator {

class RegisterSpace;

class FlightLoop {
public:
    static constexpr Ns boot_time = 1'000'000'000;

    /// What it knows, and what happened; part of what a campaign restores, beside a snapshot.
    struct State {
        Ns epoch = boot_time; ///< the machine's time at simulated time 0
        std::uint32_t resets_seen = 0;
        std::uint64_t ticks = 0; ///< with t >= 0
        std::uint64_t missed = 0;
        std::uint64_t cycles = 0; ///< of the processor, from tick to answer, of all ticks
        std::uint64_t cycles_most = 0;
        std::uint64_t lose = 0; ///< a fault: so many ticks do not reach the processor
    };

    /// The machine has a register space with boards, of which one has a clock; else throws Error.
    explicit FlightLoop(Machine &machine);
    ~FlightLoop();
    FlightLoop(const FlightLoop &) = delete;
    FlightLoop &operator=(const FlightLoop &) = delete;

    /// Fly the tick that the outside has started, and answer it. False: the processor is in its error mode, for good.
    bool exchange();
    /// The outside has ended the run: let the program end. False: it did not, in a minute of its time, or it failed.
    bool finish();

    /// The machine, its registers and this loop between two ticks, for a file.
    std::vector<std::byte> save();
    /// Go on from there. Throws Error if the bytes are damaged, or of another version, board, program or registers.
    void restore(std::span<const std::byte> bytes);

    /// Flight's first instant after t; without it, as far away as the tick before.
    std::function<Ns(Ns t)> next;
    /// In place of the machine's run_until, and called when a tick has reached the processor: for a debugger.
    std::function<StopReason(Ns t)> run;
    std::function<void()> on_tick;

    State state;

private:
    Ns next_instant(const Tick &tick) const;
    bool run_until(Ns t);
    void finish_tick(Ns limit);

    Machine &machine_;
    RegisterSpace &space_;
    const RegisterWindow &clock_;
    bool waits_ = false; ///< for flight's answer
};

} // namespace fledge::emulator
