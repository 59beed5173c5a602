// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/determinism.h"

#include <random>

#include "emulator/board.h"
#include "emulator/elf.h"
#include "emulator/machine.h"
#include "emulator/snapshot.h"
#include "emulator/testing/differential.h"
#include "emulator/testing/make_elf.h"

namespace fledge::emulator::testing {
namespace {

constexpr Ns cycle = 1000; // of the board's 1 MHz

BoardDescription board(const Stream &stream)
{
    return BoardDescription::parse("name = \"test\"\nclock = 1_000_000\ntiming = \"leon3\"\n"
                                   "[ram]\nbase = 0x40000000\nsize = " +
                                       std::to_string(stream.size) +
                                       "\n"
                                       "[[device]]\nkind = \"irqmp\"\naddress = 0x80000200\n"
                                       "[[device]]\nkind = \"gptimer\"\naddress = 0x80000300\n"
                                       "interrupt = 13\ntimers = 3\n",
                                   "test.toml");
}

Program program(const Stream &stream)
{
    std::vector<std::uint32_t> words(stream.size / 4);
    std::memcpy(words.data(), stream.image.data(), stream.size);
    for (std::uint32_t &w : words)
        w = __builtin_bswap32(w);
    std::vector<std::byte> file = make_elf(ram_base, words);
    for (int i = 0; i < 4; ++i)
        file[24 + i] = static_cast<std::byte>(stream.entry >> (24 - 8 * i));
    return Program(file, "stream");
}

/// A machine with three timers that interrupt, at periods without a common divisor. The program notes each interrupt
/// as a trap, so that one at another instruction changes what it leaves in memory.
struct Timed {
    Timed(const Stream &stream, EngineKind kind) : machine(board(stream), kind)
    {
        machine.load(program(stream));
        const std::uint32_t reload[] = {96, 210, 1022}; // timer 3 interrupts whatever PIL is
        for (std::uint32_t i = 0; i < 3; ++i) {
            machine.bus().write(0x80000314 + 16 * i, 4, reload[i]);
            machine.bus().write(0x80000318 + 16 * i, 4, 0xF); // enable, restart, load, interrupt
        }
        machine.bus().write(0x80000304, 4, 2); // the scaler
        machine.bus().write(0x80000240, 4, 0xE000);
    }
    std::vector<std::byte> memory()
    {
        const Memory &ram = machine.bus().ram();
        return {ram.bytes, ram.bytes + ram.size};
    }
    Machine machine;
};

constexpr EngineKind engines[] = {EngineKind::interpreter, EngineKind::threaded, EngineKind::translator};
constexpr Ns enough = cycle * 4'000'000; // a program that has not ended by then never will

// What differs between two machines: their states, or their memories.
std::string differences_of(Timed &expected, Timed &found)
{
    const std::string what = differences(expected.machine.core().state, found.machine.core().state);
    return !what.empty() || expected.memory() == found.memory() ? what : "  memory\n";
}

Stream stream_of(std::uint64_t seed)
{
    return make_stream({.seed = seed, .blocks = 60, .loop = 20, .sleep = true, .for_qemu = false});
}

} // namespace

std::string compare_times(std::uint64_t seed)
{
    const Stream stream = stream_of(seed);
    std::mt19937_64 random(seed);
    Timed reference(stream, engines[0]), threaded(stream, engines[1]), translator(stream, engines[2]);
    StopReason stopped = StopReason::time;
    for (Ns t = 0; stopped == StopReason::time && t < enough;) {
        t += 1 + static_cast<Ns>(random() % cycle) + cycle * static_cast<Ns>(random() >> (50 + random() % 14));
        stopped = reference.machine.run_until(t);
        for (Timed *other : {&threaded, &translator}) {
            const bool same = other->machine.run_until(t) == stopped;
            const std::string what =
                differences(reference.machine.core().state, other->machine.core().state) + (same ? "" : "  stop\n");
            if (!what.empty())
                return "engine " + std::to_string(other == &threaded ? 1 : 2) + ", in a slice up to " +
                       std::to_string(t) + " ns:\n" + what;
        }
    }
    if (stopped != StopReason::error || reference.machine.core().state.traps < 200)
        return "the program has not ended, or was not interrupted\n";
    Timed whole(stream, engines[2]);
    whole.machine.run_until(enough);
    for (Timed *other : {&threaded, &translator, &whole})
        if (const std::string what = differences_of(reference, *other); !what.empty())
            return (other == &whole ? "in one slice:\n" : "at the end:\n") + what;
    return "";
}

std::string compare_snapshots(std::uint64_t seed, int count)
{
    const Stream stream = stream_of(seed);
    Timed reference(stream, engines[0]);
    reference.machine.run_until(enough);
    const std::uint64_t end = reference.machine.core().state.cycles;

    std::mt19937_64 random(seed);
    for (int i = 0; i < count; ++i) {
        const std::uint64_t at = random() % end, elsewhere = random() % end;
        Timed first(stream, engines[random() % 3]), second(stream, engines[random() % 3]);
        first.machine.run_until(cycle * static_cast<Ns>(at));
        second.machine.run_until(cycle * static_cast<Ns>(elsewhere));
        if (i % 2 == 0)
            second.machine.restore(*first.machine.snapshot());
        else
            second.machine.load_snapshot(first.machine.save());
        for (Timed *machine : {&first, &second}) {
            machine->machine.run_until(enough);
            if (const std::string what = differences_of(reference, *machine); !what.empty())
                return (machine == &first ? "interrupted by a snapshot" : "from the snapshot") +
                       std::string(" at cycle ") + std::to_string(at) + ":\n" + what;
        }
    }
    return "";
}

} // namespace fledge::emulator::testing
