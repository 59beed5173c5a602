// SPDX-License-Identifier: Apache-2.0
#include "emulator/loop.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "emulator/devices/register_space.h"
#include "emulator/error.h"
#include "emulator/report.h"

namespace fledge::emulator {

namespace {

constexpr Ns second = 1'000'000'000;

/// What stands in front of the registers of the boards, and these in front of the machine's snapshot.
struct Header {
    char magic[16] = "FLEDGE FLIGHT 1"; // the number is the version
    FlightLoop::State state;
    std::uint64_t boards = 0; ///< of the hashes of their files
};

/// The boards as one number.
std::uint64_t identity_of(std::span<const RegisterWindow> windows)
{
    std::uint64_t identity = 0;
    for (const RegisterWindow &w : windows) {
        identity = identity * 31 + w.board->hash;
    }
    return identity;
}

RegisterSpace &space_of(Machine &machine)
{
    RegisterSpace *space = machine.device_of<RegisterSpace>();
    if (!space || !space->clock()) {
        throw Error(space ? "no board in the register space has a clock"
                          : "the board has no device of the kind `registers`");
    }
    return *space;
}

} // namespace

FlightLoop::FlightLoop(Machine &machine) : machine_(machine), space_(space_of(machine)), clock_(*space_.clock())
{
    space_.done = [this] {
        if (waits_ && register_clock_is_done(&clock_)) {
            machine_.stop();
        }
    };
}

FlightLoop::~FlightLoop()
{
    space_.done = nullptr;
}

/// False: the processor will not do anything any more.
bool FlightLoop::run_until(Ns t)
{
    StopReason reason;
    do {
        reason = run ? run(t) : machine_.run_until(t);
    } while (reason == StopReason::breakpoint || reason == StopReason::watchpoint);
    return reason != StopReason::error;
}

Ns FlightLoop::next_instant(const Tick &tick) const
{
    return next ? next(tick.t) : tick.t + (tick.dt > 0 ? tick.dt : second);
}

bool FlightLoop::exchange()
{
    Tick tick;
    if (!register_clock_due(&clock_, &tick)) {
        return true;
    }
    Ns end;
    const std::uint32_t resets = register_clock_resets(&clock_);
    if (tick.t < 0) {
        state.epoch = end = machine_.now() + boot_time;
    } else {
        const Ns begin = state.epoch + tick.t;
        end = state.epoch + next_instant(tick);
        if (resets != state.resets_seen) {
            finish_tick(begin);
            machine_.reset_until(begin);
        } else if (!run_until(begin)) {
            return false;
        }
    }
    state.resets_seen = resets;
    const std::uint64_t begun = machine_.core().state.cycles;
    if (state.lose > 0) {
        state.lose--;
    } else {
        space_.announce();
        space_.tick();
    }
    if (on_tick) {
        on_tick();
    }
    waits_ = true;
    const bool lives = run_until(end);
    waits_ = false;
    const bool done = register_clock_is_done(&clock_);
    if (tick.t >= 0) {
        const std::uint64_t cycles = machine_.core().state.cycles - begun;
        state.ticks++;
        state.missed += done ? 0 : 1;
        state.cycles += cycles;
        state.cycles_most = std::max(state.cycles_most, cycles);
    }
    if (!done) {
        register_clock_finish(&clock_);
        space_.settle();
    } else if (clock_.ring) {
        clock_.ring(clock_.user, clock_.board->n_interrupts);
    }
    return lives;
}

/// What flight does behind its answer, as sending its record, comes before a reset.
void FlightLoop::finish_tick(Ns limit)
{
    while (machine_.core().state.mode == Mode::running && machine_.now() < limit &&
           run_until(std::min(limit, machine_.now() + second / 10000))) {
    }
}

std::vector<std::byte> FlightLoop::save()
{
    Header header;
    header.state = state;
    header.boards = identity_of(space_.windows());
    std::vector<std::byte> bytes(sizeof header);
    std::memcpy(bytes.data(), &header, sizeof header);
    for (const RegisterWindow &w : space_.windows()) {
        for (std::uint32_t i = 0; i < w.board->size / 4; i++) {
            const std::uint32_t word = w.words[i];
            const auto *at = reinterpret_cast<const std::byte *>(&word);
            bytes.insert(bytes.end(), at, at + sizeof word);
        }
    }
    const std::vector<std::byte> machine = machine_.save();
    bytes.insert(bytes.end(), machine.begin(), machine.end());
    return bytes;
}

void FlightLoop::restore(std::span<const std::byte> bytes)
{
    const Header expected;
    Header header;
    std::uint64_t size = 0;
    for (const RegisterWindow &w : space_.windows()) {
        size += w.board->size;
    }
    if (bytes.size() < sizeof header + size) {
        throw Error("the snapshot is truncated");
    }
    std::memcpy(&header, bytes.data(), sizeof header);
    bytes = bytes.subspan(sizeof header);
    if (std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0) {
        throw Error("this is no snapshot of flight, or one of another version");
    }
    if (header.boards != identity_of(space_.windows())) {
        throw Error("the snapshot is of other boards than those in the register space");
    }
    machine_.load_snapshot(bytes.subspan(size));
    state = header.state;
    for (const RegisterWindow &w : space_.windows()) {
        for (std::uint32_t i = 0; i < w.board->size / 4; i++) {
            std::uint32_t word;
            std::memcpy(&word, bytes.data() + 4 * i, sizeof word);
            w.words[i] = word;
        }
        bytes = bytes.subspan(w.board->size);
    }
}

bool FlightLoop::finish()
{
    int status = 0;
    std::string why;
    // The watchdog must not start a program again that has ended.
    const auto on_error = std::exchange(machine_.on_error, [this] { machine_.stop(); });
    space_.tick();
    run_until(machine_.now() + 60 * second);
    machine_.on_error = on_error;
    return program_ended(machine_, nullptr, status, why) && status == 0;
}

} // namespace fledge::emulator
