// SPDX-License-Identifier: Apache-2.0
#include "emulator/report.h"

#include <array>
#include <cstdio>

#include "emulator/board.h"
#include "emulator/cpu/step.h"
#include "emulator/elf.h"
#include "emulator/machine.h"

namespace fledge::emulator {

namespace {

enum : std::uint32_t { stack_pointer = 14, return_address = 15, frame_pointer = 30, caller = 31 };

template <typename... T> std::string format(const char *text, T... values)
{
    char line[200];
    std::snprintf(line, sizeof line, text, values...);
    return line;
}

bool peek_word(const Machine &machine, std::uint32_t address, std::uint32_t &word)
{
    std::array<std::byte, 4> bytes;
    if (address % 4 != 0 || !machine.peek(address, bytes)) {
        return false;
    }
    word = 0;
    for (const std::byte b : bytes) {
        word = word << 8 | std::to_integer<std::uint32_t>(b);
    }
    return true;
}

std::string place_of(std::uint32_t address, const Program *program)
{
    const std::string name = program ? program->place(address) : "";
    return format("0x%08x", address) + (name.empty() ? "" : " " + name);
}

/// Whether the function of pc has not yet entered a window of its own: no `save` stands before pc.
bool without_window(const Machine &machine, const Program *program, std::uint32_t pc)
{
    const Program::Symbol *symbol = program ? program->at(pc) : nullptr;
    if (!symbol || !symbol->function) {
        return false;
    }
    std::uint32_t word;
    for (std::uint32_t at = symbol->address; at < pc && peek_word(machine, at, word); at += 4) {
        if ((word & 0xC1F80000) == 0x81E00000) {
            return false;
        }
    }
    return true;
}

} // namespace

std::vector<Frame> backtrace(const Machine &machine, const Program *program)
{
    constexpr std::size_t most = 64;
    CpuState s = machine.core().state;
    std::vector<Frame> frames{{s.pc, 0}};
    const std::uint32_t first = s.psr & psr::cwp;
    std::uint32_t window = first;
    bool in_registers = true;
    Banks present(s);
    frames[0].sp = present[stack_pointer];
    if (without_window(machine, program, s.pc)) {
        frames.push_back({present[return_address], present[stack_pointer]});
    }
    std::uint32_t sp = present[stack_pointer], fp = present[frame_pointer], pc = present[caller];
    while (frames.size() < most && pc != 0 && fp != 0) {
        frames.push_back({pc, fp});
        window = (window + 1) % window_count;
        in_registers = in_registers && (s.wim >> window & 1) == 0 && window != first;
        sp = fp;
        if (in_registers) {
            s.psr = (s.psr & ~psr::cwp) | window;
            Banks r(s);
            fp = r[frame_pointer];
            pc = r[caller];
        } else if (!peek_word(machine, sp + 56, fp) || !peek_word(machine, sp + 60, pc)) {
            break;
        }
        if (fp <= sp) {
            break;
        }
    }
    return frames;
}

std::string trap_name(std::uint32_t type)
{
    const char *name = "";
    switch (type) {
    case trap::none: name = "reset"; break;
    case trap::instruction_access_exception: name = "instruction_access_exception"; break;
    case trap::illegal_instruction: name = "illegal_instruction"; break;
    case trap::privileged_instruction: name = "privileged_instruction"; break;
    case trap::fp_disabled: name = "fp_disabled"; break;
    case trap::window_overflow: name = "window_overflow"; break;
    case trap::window_underflow: name = "window_underflow"; break;
    case trap::mem_address_not_aligned: name = "mem_address_not_aligned"; break;
    case trap::fp_exception: name = "fp_exception"; break;
    case trap::data_access_exception: name = "data_access_exception"; break;
    case trap::tag_overflow: name = "tag_overflow"; break;
    case trap::cp_disabled: name = "cp_disabled"; break;
    case trap::division_by_zero: name = "division_by_zero"; break;
    case trap::data_store_error: name = "data_store_error"; break;
    default:
        name = type >= trap::instruction                                ? "trap_instruction"
               : type > trap::interrupt && type <= trap::interrupt + 15 ? "interrupt"
                                                                        : "unknown trap";
    }
    return format("%s (0x%02x)", name, type);
}

std::vector<DeviceWords> device_words(const Machine &machine)
{
    std::vector<DeviceWords> all;
    for (std::size_t i = 0; i < machine.board().devices.size(); i++) {
        DeviceWords &device = all.emplace_back();
        device.name = machine.board().devices[i].name;
        for (const DeviceRegister &r : machine.devices()[i]->registers()) {
            const std::uint32_t address = machine.board().devices[i].address + r.offset;
            std::uint32_t value = 0;
            (void)peek_word(machine, address, value);
            device.words.push_back({r.name, address, value});
        }
    }
    std::erase_if(all, [](const DeviceWords &device) { return device.words.empty(); });
    return all;
}

bool program_ended(const Machine &machine, const Program *program, int &status, std::string &why)
{
    CpuState s = machine.core().state;
    Banks r(s);
    status = static_cast<int>(r[8]);
    if (s.mode != Mode::error || s.trap_type != trap::instruction) {
        return false;
    }
    const std::uint32_t handled = s.tbr >> 4 & 0xFF; // the trap whose handler ended the program, if one did
    // Its entry of the trap table is `ta 0`, or where the single vector leads, if it knows no handler.
    const bool in_table = s.pc - s.tbr < 16 || (s.asr17 & asr::single_vector) != 0;
    if (handled != trap::instruction && in_table) {
        why = "the program has no handler of " + trap_name(handled) + ", which came at " + place_of(r[17], program);
    } else if (in_table) {
        status = static_cast<int>(r[24]);                           // %o0 of the window that trapped
    } else if (handled == trap::instruction && s.globals[1] == 1) { // RTEMS: %g2 is the source, %g3 the code
        static constexpr const char *sources[] = {"the core",
                                                  "the classic API",
                                                  "POSIX",
                                                  "bdbuf",
                                                  "the application",
                                                  "exit",
                                                  "the BSP",
                                                  "an assertion",
                                                  "the stack checker",
                                                  "an exception",
                                                  "SMP",
                                                  "panic()",
                                                  "free() of a wrong address"};
        constexpr std::uint32_t by_exit = 5;
        const std::uint32_t source = s.globals[2], code = s.globals[3];
        if (source != by_exit) {
            why = format("RTEMS has stopped; the source is %u (%s), the code 0x%x", source,
                         source < std::size(sources) ? sources[source] : "unknown", code);
        }
        status = static_cast<int>(code);
    }
    return why.empty();
}

std::string describe(const Machine &machine, const Core &core, const Program *program)
{
    CpuState s = core.state;
    Banks r(s);
    const char *mode = s.mode == Mode::error        ? "the processor is in its error mode"
                       : s.mode == Mode::power_down ? "the processor waits for an interrupt"
                                                    : "the processor runs";
    std::string text = std::string(mode) + ", at " + place_of(s.pc, program) + "\n";
    if (s.mode == Mode::error) {
        text += "  " + trap_name(s.trap_type) + " while traps are disabled";
        std::uint32_t word;
        if (peek_word(machine, s.pc, word)) {
            text += format("; the instruction is 0x%08x", word);
        }
        text += "\n";
    } else if (s.traps > 0) {
        text += "  the last trap was " + trap_name(s.trap_type) + "\n";
    }
    text += format("  time %.9f s, %llu cycles, %llu instructions, %llu traps\n",
                   static_cast<double>(machine.now()) * 1e-9, static_cast<unsigned long long>(s.cycles),
                   static_cast<unsigned long long>(s.instructions), static_cast<unsigned long long>(s.traps));
    text += format("  pc %08x  npc %08x  psr %08x  wim %08x  tbr %08x  y %08x  fsr %08x\n", s.pc, s.npc, s.psr, s.wim,
                   s.tbr, s.y, s.fsr);
    static constexpr char banks[] = "goli";
    for (std::uint32_t bank = 0; bank < 4; bank++) {
        text += format("  %%%c0-7", banks[bank]);
        for (std::uint32_t i = 0; i < 8; i++) {
            text += format(" %08x", r[8 * bank + i]);
        }
        text += "\n";
    }
    for (std::uint32_t i = 0; i < 16; i++) {
        text += i % 4 == 0 ? format("  %%f%-3u", 2 * i) : "";
        text += format(" %016llx", static_cast<unsigned long long>(s.floats[i])) + (i % 4 == 3 ? "\n" : "");
    }
    text += "  backtrace\n";
    std::size_t n = 0;
    for (const Frame &frame : backtrace(machine, program)) {
        text += format("    #%-2zu ", n++) + place_of(frame.pc, program) + format("  sp 0x%08x\n", frame.sp);
    }
    return text;
}

} // namespace fledge::emulator
