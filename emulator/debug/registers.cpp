// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/registers.h"

#include <charconv>

#include "emulator/error.h"

namespace fledge::emulator {

namespace {

constexpr std::string_view others[] = {"y", "psr", "wim", "tbr", "pc", "npc", "fsr", "csr"};

} // namespace

std::string register_name(unsigned number)
{
    if (number < 32) {
        return std::string(1, "goli"[number / 8]) + std::to_string(number % 8);
    }
    return number < 64 ? "f" + std::to_string(number - 32) : std::string(others[number - 64]);
}

unsigned register_number(std::string_view name)
{
    const std::string_view plain = name.starts_with("%") ? name.substr(1) : name;
    for (unsigned i = 0; i < named_registers; i++) {
        if (register_name(i) == plain) {
            return i;
        }
    }
    if (plain == "sp" || plain == "fp") {
        return plain == "sp" ? 14 : 30;
    }
    throw Error("there is no register " + std::string(name) +
                "; there are %g0 to %g7, %o, %l and %i likewise, %f0 to " +
                "%f31, %sp, %fp, %y, %psr, %wim, %tbr, %pc, %npc and %fsr");
}

std::uint32_t get_register(const CpuState &state, unsigned number)
{
    if (number < 32) {
        return Banks{const_cast<CpuState &>(state)}[number];
    }
    if (number < 64) {
        const std::uint64_t pair = state.floats[(number - 32) / 2];
        return static_cast<std::uint32_t>(number % 2 ? pair : pair >> 32);
    }
    const std::uint32_t rest[] = {state.y, state.psr, state.wim, state.tbr, state.pc, state.npc, state.fsr, 0};
    return rest[number - 64];
}

void set_register(CpuState &state, unsigned number, std::uint32_t value)
{
    if (number >= 1 && number < 32) {
        Banks{state}[number] = value;
    } else if (number >= 32 && number < 64) {
        std::uint64_t &pair = state.floats[(number - 32) / 2];
        const unsigned up = number % 2 ? 0 : 32;
        pair = (pair & ~(std::uint64_t{0xFFFFFFFF} << up)) | std::uint64_t{value} << up;
    } else if (number >= 64 && number < 71) {
        std::uint32_t *const rest[] = {&state.y, &state.psr, &state.wim, &state.tbr, &state.pc, &state.npc, &state.fsr};
        *rest[number - 64] = value;
        keep_possible(state);
    }
}

void flip_register(CpuState &state, std::string_view name, unsigned bit)
{
    if (bit > 31) {
        throw Error("flip: a register has the bits 0 to 31; found " + std::to_string(bit));
    }
    if (constexpr std::string_view window = "window "; name.starts_with(window)) {
        std::size_t word = state.windows.size();
        (void)std::from_chars(name.data() + window.size(), name.data() + name.size(), word);
        if (word >= state.windows.size()) {
            throw Error("flip: the windows have the words 0 to " + std::to_string(state.windows.size() - 1) +
                        "; found " + std::string(name));
        }
        state.windows[word] ^= 1u << bit;
        return;
    }
    const unsigned number = register_number(name);
    set_register(state, number, get_register(state, number) ^ 1u << bit);
}

} // namespace fledge::emulator
