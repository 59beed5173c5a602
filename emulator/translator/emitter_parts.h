// SPDX-License-Identifier: Apache-2.0
// What the files of the emitter share; callers include emitter.h.
//
//     emitter.cpp             blocks: registers of the host, ways out, which instructions there are
//     emitter_integers.cpp    arithmetic and logic, windows
//     emitter_memory.cpp      loads and stores
//     emitter_floating.cpp    the floating-point unit
#pragma once

#include "emulator/translator/emitter.h"

#include <cstddef>

namespace fledge::emulator {

using namespace Xbyak::util;

inline constexpr std::size_t state_globals = offsetof(CpuState, globals), state_windows = offsetof(CpuState, windows);

#define IN_STATE(member) (rbx + offsetof(CpuState, member))
#define IN_CONTEXT(member) (r14 + offsetof(Context, member))

inline constexpr Op exact = Op::fmovs; ///< stands for all operations that cause no exception

constexpr bool is_double_register(int r)
{
    return (r & 1) == 0;
}

constexpr bool sets_icc(Op op)
{
    return op >= Op::addcc && op <= Op::mulscc;
}

constexpr bool uses_fpu(Op op)
{
    return op == Op::fbfcc || op >= Op::ldf;
}

inline int log2_of(unsigned size)
{
    return size == 8 ? 3 : size == 4 ? 2 : size == 2 ? 1 : 0;
}

} // namespace fledge::emulator
