// SPDX-License-Identifier: Apache-2.0
// What the engine and its translated code share.
#pragma once

#include <cstdint>
#include <vector>

#include "emulator/bus/bus.h"
#include "emulator/cpu/instruction.h"

namespace fledge::emulator {

/// An entry of the table that finds the code of an indirect jump's target.
struct Target {
    std::uint64_t pc = 1; ///< 1 is the address of no instruction
    const std::uint8_t *code = nullptr;
};
inline constexpr std::uint32_t target_count = 1 << 15; ///< enough for the returns of a program of 128 KiB

/// State that translated code keeps in another form than CpuState, and constants that it reads.
struct Context {
    std::int64_t remaining = 0;               ///< cycles until the end of the run
    std::uint32_t *outs = nullptr;            ///< of the present window; its locals follow
    std::uint32_t *ins = nullptr;             ///< of the present window
    const std::uint8_t *page_flags = nullptr; ///< of the RAM
    const std::uint8_t *code_words = nullptr; ///< of the RAM: Memory::code
    std::uintptr_t ram = 0;                   ///< where address 0 would be
    const Target *targets = nullptr;
    std::uint32_t icc = 0;      ///< as `lahf; seto al` leave them: AH holds sign, zero and carry, AL overflow
    std::uint32_t fcc = 0;      ///< as in the FSR
    std::uint32_t fp_ready = 0; ///< the FPU is on, and its modes are those that translated code has
    std::uint32_t target = 0;   ///< of an indirect jump whose delay slot executes
    std::uint32_t guest_mxcsr = 0, host_mxcsr = 0;

    /// The last floating-point operation, from which the current exceptions follow; Op::illegal: the FSR has them.
    std::uint64_t last_a = 0, last_b = 0;
    std::uint32_t last_op = 0;

    std::uint64_t subnormal_limit = (std::uint64_t{1} << 53) - 1; ///< 2 x - 1 is below it: x is subnormal
    std::uint64_t smallest_normal = std::uint64_t{1} << 52;
    alignas(16) std::uint64_t swap[2] = {0x0001020304050607, 0x08090A0B0C0D0E0F}; ///< reverses the bytes of doubles
    alignas(16) std::uint64_t magnitude[2] = {~std::uint64_t{0} >> 1, ~std::uint64_t{0} >> 1};
    alignas(16) std::uint64_t sign[2] = {std::uint64_t{1} << 63, std::uint64_t{1} << 63};
    alignas(16) std::uint32_t single_magnitude[4] = {0x7FFFFFFF, 0x7FFFFFFF, 0x7FFFFFFF, 0x7FFFFFFF};
    std::uint32_t single_smallest_normal = 1u << 23;
};

/// An instruction that the reference executes in place of translated code: what its state is there.
struct Site {
    Instruction instruction;
    std::uint32_t pc = 0, npc = 0;
    bool npc_in_target = false;                 ///< npc is Context::target
    std::uint32_t cycles = 0, instructions = 0; ///< of the block from here to its end, which the block has counted
};

/// A jump from one block to the next.
struct Link {
    std::uint32_t pc = 0;     ///< where it goes
    std::size_t jump = 0;     ///< offset of the jump in the code memory
    std::size_t unlinked = 0; ///< offset of the exit where it goes until the target is translated
};

struct Block {
    std::uint32_t pc = 0;
    std::size_t entry = 0; ///< offset in the code memory
    bool valid = true;
    std::vector<std::uint32_t> words;    ///< addresses of its instructions
    std::vector<std::uint32_t> incoming; ///< indices of the links that lead here
};

/// Why translated code returned; its result has an index in its low half.
enum class Leave : std::uint32_t {
    time,      ///< the block with the index may not end before the run does
    not_ready, ///< the block with the index needs an FPU that is ready
    link,      ///< the link with the index has no block yet
    lookup,    ///< Context::target is not in the table
    site       ///< the reference executes the instruction of the site with the index
};

} // namespace fledge::emulator
