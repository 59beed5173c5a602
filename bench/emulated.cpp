// SPDX-License-Identifier: Apache-2.0
// Runs a program on an emulated board to its end, which is the error mode, and prints what it wrote and what that cost.
//
//   fledge_bench_emulated interpreter|threaded|translator BOARD.toml PROGRAM.elf
#include <cstdio>
#include <cstring>
#include <ctime>
#include <exception>
#include <limits>

#include "emulator/board.h"
#include "emulator/devices/apbuart.h"
#include "emulator/elf.h"
#include "emulator/machine.h"

namespace {

using namespace fledge::emulator;

double cpu_seconds()
{
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

} // namespace

int main(int count, char **arguments)
try {
    if (count != 4) {
        std::fprintf(stderr, "usage: %s interpreter|threaded|translator BOARD.toml PROGRAM.elf\n", arguments[0]);
        return 2;
    }
    const EngineKind engine = std::strcmp(arguments[1], "interpreter") == 0 ? EngineKind::interpreter
                              : std::strcmp(arguments[1], "threaded") == 0  ? EngineKind::threaded
                                                                            : EngineKind::translator;
    Machine machine(BoardDescription::read(arguments[2]), engine);
    machine.load(Program::read(arguments[3]));
    dynamic_cast<Apbuart &>(*machine.device("console")).transmit = [](std::uint8_t byte) { std::putchar(byte); };
    const double start = cpu_seconds();
    const StopReason reason = machine.run_until(std::numeric_limits<Ns>::max());
    const double seconds = cpu_seconds() - start;
    std::printf("instructions %llu\nseconds %.6f\n", static_cast<unsigned long long>(machine.instructions()), seconds);
    return reason == StopReason::error ? 0 : 1;
} catch (const std::exception &e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
}
