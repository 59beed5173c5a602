// SPDX-License-Identifier: Apache-2.0
// All that a SPARC V8 processor holds, as plain bytes: a snapshot is a copy of it. Names are those of "The SPARC
// Architecture Manual, Version 8", chapter 4.
#pragma once

#include <array>
#include <cstdint>

namespace fledge::emulator {

inline constexpr std::uint32_t window_count = 8; ///< register windows of a LEON3 as it is usually made

/// Bits of the PSR.
namespace psr {
inline constexpr std::uint32_t carry = 1u << 20, overflow = 1u << 21, zero = 1u << 22, negative = 1u << 23;
inline constexpr std::uint32_t icc = 0xFu << 20;
inline constexpr std::uint32_t enable_fpu = 1u << 12, pil = 0xFu << 8, supervisor = 1u << 7;
inline constexpr std::uint32_t previous_supervisor = 1u << 6, enable_traps = 1u << 5, cwp = 0x1Fu;
inline constexpr std::uint32_t version = 0xF3u << 24; ///< implementation 15, version 3: a LEON3
inline constexpr std::uint32_t writable =
    icc | enable_fpu | pil | supervisor | previous_supervisor | enable_traps | cwp;
} // namespace psr

/// Bits of the FSR.
namespace fsr {
/// Exceptions: in cexc, the current ones, where they stand here; also in aexc, the accrued ones, and in tem, which
/// enables their traps.
inline constexpr std::uint32_t inexact = 1, division_by_zero = 2, underflow = 4, overflow = 8, invalid = 16;
inline constexpr std::uint32_t cexc = 31, aexc_shift = 5, tem_shift = 23;
inline constexpr std::uint32_t fcc = 3u << 10, fcc_shift = 10, ftt = 7u << 14;
inline constexpr std::uint32_t ieee_exception = 1u << 14, unfinished = 2u << 14, unimplemented = 3u << 14;
inline constexpr std::uint32_t sequence_error = 4u << 14; ///< these four are values of ftt
inline constexpr std::uint32_t queue_not_empty = 1u << 13;
inline constexpr std::uint32_t version_shift = 17, nonstandard = 1u << 22;
inline constexpr std::uint32_t rounding_shift = 30; ///< 0 to nearest, 1 to zero, 2 up, 3 down
inline constexpr std::uint32_t writable = 0xCFC00FFF;
} // namespace fsr

/// Bits of ancillary state registers.
namespace asr {
inline constexpr std::uint32_t no_store_errors = 1u << 14; ///< %asr17: a store that fails does not trap
inline constexpr std::uint32_t single_vector = 1u << 13;   ///< %asr17: all traps go to the begin of the table
inline constexpr std::uint32_t asr17_writable = no_store_errors | single_vector;
inline constexpr std::uint32_t counter_off = 1u << 31; ///< %asr22: this processor does not need the counter
} // namespace asr

/// The deferred floating-point trap of a GRFPU: an operation that it could not complete, until STDFQ takes it.
struct FpQueue {
    std::uint32_t pc = 0, word = 0; ///< of the operation; word 0: the queue is empty
    std::uint32_t trapped = 0;      ///< its trap was taken
    bool operator==(const FpQueue &) const = default;
};

/// Where the processor stands.
enum class Mode : std::uint32_t {
    running,
    power_down, ///< %asr19 was written: waits for an interrupt
    error       ///< a trap while traps are disabled: waits for a reset
};

struct CpuState {
    std::array<std::uint32_t, 8> globals{}; ///< %g0 to %g7; [0] stays 0
    /// The windows: the outs of window w begin at 16 w, its locals at 16 w + 8; its ins are the outs of window w + 1.
    std::array<std::uint32_t, std::size_t{window_count} * 16> windows{};
    /// Pairs of floating-point registers: [k] is %f2k in its upper half and %f(2k+1) in its lower, so that a double is
    /// the host's.
    std::array<std::uint64_t, 16> floats{};

    std::uint32_t pc = 0, npc = 4; ///< an annulled instruction is skipped at once: no state says so
    std::uint32_t psr = psr::version | psr::supervisor;
    std::uint32_t wim = 0, tbr = 0, y = 0;
    std::uint32_t fsr = 0; ///< the version of the FPU, and qne, are added when a program reads it
    FpQueue fp_queue;
    /// The LEON3's configuration: its index, FPU (GRFPU), multiplier and divider, windows - 1.
    std::uint32_t asr17 = 1u << 10 | 1u << 8 | (window_count - 1);
    std::uint32_t asr22 = asr::counter_off; ///< its highest bit; the others, and %asr23, count
    std::uint32_t cache_control = 0;        ///< ASI 2, address 0: what was written; there are no caches
    Mode mode = Mode::running;
    std::uint32_t trap_type = 0; ///< of the last trap, also of that which led to the error mode

    std::uint64_t cycles = 0;       ///< of the processor's clock since the machine was made; goes on over resets
    std::uint64_t counts_from = 0;  ///< the cycle of the last reset: %asr22, %asr23 and the debug unit count from there
    std::uint64_t instructions = 0; ///< executed: neither annulled ones, nor those that trapped
    std::uint64_t traps = 0;        ///< taken, interrupts too

    bool operator==(const CpuState &) const = default;
};

inline std::uint32_t single(const CpuState &s, std::uint32_t r)
{
    return static_cast<std::uint32_t>((r & 1) != 0 ? s.floats[r / 2] : s.floats[r / 2] >> 32);
}

inline void set_single(CpuState &s, std::uint32_t r, std::uint32_t bits)
{
    std::uint64_t &pair = s.floats[r / 2];
    pair = (r & 1) != 0 ? (pair & ~std::uint64_t{0xFFFFFFFF}) | bits : (pair & 0xFFFFFFFF) | std::uint64_t{bits} << 32;
}

/// After a change from outside, a bit flip or a snapshot: bits that the processor does not have are 0.
inline void keep_possible(CpuState &s)
{
    s.globals[0] = 0;
    s.pc &= ~3u;
    s.npc &= ~3u;
    s.psr = psr::version | (s.psr & psr::writable & ~(psr::cwp & ~(window_count - 1)));
    s.wim &= (1u << window_count) - 1;
    s.tbr &= ~0xFu;
    s.fsr &= fsr::writable | fsr::ftt;
    s.mode = s.mode == Mode::running || s.mode == Mode::power_down ? s.mode : Mode::error;
}

/// The registers 0..31 of the present window, as four banks: globals, outs, locals, ins. Make them anew when CWP or the
/// state changed.
struct Banks {
    std::uint32_t *bank[4];

    explicit Banks(CpuState &s)
    {
        const std::uint32_t w = s.psr & psr::cwp;
        bank[0] = s.globals.data();
        bank[1] = s.windows.data() + std::size_t{w} * 16;
        bank[2] = bank[1] + 8;
        bank[3] = s.windows.data() + std::size_t{(w + 1) % window_count} * 16;
    }
    std::uint32_t &operator[](std::uint32_t r) { return bank[r >> 3][r & 7]; }
};

} // namespace fledge::emulator
