// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/differential.h"

#include <array>
#include <cstdio>
#include <random>

#include "emulator/testing/computer.h"
#include "emulator/testing/qemu.h"

namespace fledge::emulator::testing {
namespace {

using Make = std::unique_ptr<Engine> (*)();

// Until one of them differs, or both have ended: at every boundary of instructions.
std::string first_difference(const Stream &stream, FpuPersonality fpu, Make make, std::uint64_t agreed,
                             std::uint64_t differed)
{
    Computer reference(stream, make_interpreter(), fpu), other(stream, make(), fpu);
    reference.run(agreed);
    other.run(agreed);
    while (reference.core.state.cycles < differed) {
        const CpuState before = reference.core.state;
        const Exit a = reference.run(before.cycles + 1), b = other.run(before.cycles + 1);
        const std::string what = differences(reference.core.state, other.core.state);
        if (a == b && what.empty())
            continue;
        const std::uint32_t word = before.pc - ram_base < stream.size ? reference.bus.load(before.pc) : 0;
        char text[160];
        std::snprintf(text, sizeof text, "after the instruction %08x at %08x (cycle %llu; exits %d and %d):\n", word,
                      before.pc, static_cast<unsigned long long>(before.cycles), static_cast<int>(a),
                      static_cast<int>(b));
        return text + what;
    }
    return "(step by step, they agree up to this cycle)\n";
}

} // namespace

std::string compare_engines(const Stream &stream, FpuPersonality fpu, std::uint64_t seed,
                            std::vector<std::uint8_t> *memory)
{
    constexpr std::uint64_t enough = 400'000'000; // cycles; a program that has not ended by then never will
    std::mt19937_64 random(seed);
    Computer reference(stream, make_interpreter(), fpu);
    struct Other {
        Make make;
        Computer computer;
    };
    std::array<Other, 2> others{
        {{make_threaded, {stream, make_threaded(), fpu}}, {make_translator, {stream, make_translator(), fpu}}}};
    for (;;) {
        const std::uint64_t agreed = reference.core.state.cycles;
        const std::uint64_t until = agreed + 1 + (random() >> (47 + random() % 17)); // 1 to 131072, mostly short
        const Exit expected = reference.run(until);
        for (Other &o : others) {
            const Exit found = o.computer.run(until);
            const std::string what = differences(reference.core.state, o.computer.core.state);
            if (found == expected && what.empty())
                continue;
            return std::string(o.computer.engine->name()) + ", in a slice up to cycle " + std::to_string(until) +
                   ", exits " + std::to_string(int(expected)) + " and " + std::to_string(int(found)) + ":\n" + what +
                   first_difference(stream, fpu, o.make, agreed, until);
        }
        if (expected == Exit::error)
            break;
        if (expected != Exit::time || until > enough)
            return "the program did not end: exit " + std::to_string(int(expected)) + "\n";
    }
    for (Other &o : others)
        if (const std::string what = compare(stream, reference.memory(), o.computer.memory()); !what.empty())
            return std::string(o.computer.engine->name()) + ": " + what + "\n";
    if (memory != nullptr)
        *memory = reference.memory();
    return "";
}

std::string compare_seed(std::uint64_t seed, std::uint32_t blocks, bool qemu)
{
    const Stream plain = make_stream({.seed = seed, .blocks = blocks});
    std::vector<std::uint8_t> memory;
    std::string what = compare_engines(plain, FpuPersonality::qemu, seed, &memory);
    if (!what.empty())
        return "as QEMU: " + what;
    if (qemu)
        if (what = compare(plain, run_in_qemu(plain), memory); !what.empty())
            return "QEMU expects otherwise: " + what + "\n";
    if (what = compare_engines(plain, FpuPersonality::grfpu, seed); !what.empty())
        return "as GRFPU: " + what;
    const Stream special = make_stream({.seed = seed, .blocks = blocks, .loop = 40, .for_qemu = false});
    if (what = compare_engines(special, FpuPersonality::grfpu, seed); !what.empty())
        return "with all that QEMU does otherwise: " + what;
    return "";
}

} // namespace fledge::emulator::testing
