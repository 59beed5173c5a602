// SPDX-License-Identifier: Apache-2.0
// Random programs on every engine and in stock QEMU, one seed after the other, until one of them differs.
#include <chrono>
#include <cstdio>
#include <exception>

#include "emulator/testing/determinism.h"
#include "emulator/testing/differential.h"
#include "emulator/testing/fuzz.h"
#include "emulator/testing/qemu.h"
#include "options/options.h"

namespace {

using namespace fledge::emulator::testing;

std::string compare(std::uint64_t seed, std::uint32_t blocks, bool qemu)
{
    std::string what = compare_seed(seed, blocks, qemu);
    if (what.empty())
        what = compare_times(seed);
    return what.empty() ? compare_snapshots(seed, 4) : what;
}

std::string try_input(std::uint64_t seed)
{
    std::string what = fuzz_decoder(seed);
    if (what.empty())
        what = fuzz_processor(seed);
    return what.empty() ? fuzz_files(seed) : what;
}

} // namespace

int main(int argc, char **argv)
{
    using Clock = std::chrono::steady_clock;

    fledge::Options options(
        "emulator_differential",
        "Compare the engines of the emulator with one another and with stock QEMU, by random programs.",
        "example: emulator_differential --seed 7 --minutes 10");
    std::uint64_t seed = 1;
    std::uint32_t blocks = 1000;
    double minutes = 1;
    bool engines_alone = false, fuzz = false;
    options.whole("--seed", seed, std::uint64_t{0}, ~std::uint64_t{0}, "N",
                  "of the first program; each further one has the next; default 1");
    options.whole("--blocks", blocks, 1u, 100000u, "N", "of random instructions in each program; default 1000");
    options.number("--minutes", minutes, 0, 1e9, "X", "how long; 0: one program; default 1");
    options.flag("--without-qemu", engines_alone, "compare only the engines");
    options.flag("--fuzz", fuzz, "no programs, but any memory, and damaged files; for a build with sanitizers");
    options.parse(argc, argv);
    if (const std::string without = without_qemu(); !fuzz && !engines_alone && !without.empty()) {
        std::fprintf(stderr, "%s: install QEMU 7 or 8, or add --without-qemu\n", without.c_str());
        return 1;
    }

    const Clock::time_point end =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(minutes * 60));
    std::uint64_t programs = 0;
    try {
        do {
            const std::string what =
                fuzz ? try_input(seed + programs) : compare(seed + programs, blocks, !engines_alone);
            if (!what.empty()) {
                std::printf("seed %llu: %s", static_cast<unsigned long long>(seed + programs), what.c_str());
                return 1;
            }
            ++programs;
        } while (Clock::now() < end);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "seed %llu: %s\n", static_cast<unsigned long long>(seed + programs), error.what());
        return 1;
    }
    std::printf("%s %llu\ndifferences 0\n", fuzz ? "inputs" : "programs", static_cast<unsigned long long>(programs));
}
