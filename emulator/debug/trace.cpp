// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/trace.h"

#include "emulator/cpu/instruction.h"
#include "emulator/debug/registers.h"
#include "emulator/error.h"
#include "emulator/report.h"

#include <array>
#include <capstone/capstone.h>
#include <cerrno>
#include <cinttypes>
#include <cstring>

namespace fledge::emulator {

namespace {

/// A disassembler of this thread: it is slow to make.
struct Capstone {
    csh handle = 0;
    cs_insn *instruction = nullptr;
    Capstone()
    {
        if (cs_open(CS_ARCH_SPARC, CS_MODE_BIG_ENDIAN, &handle) == CS_ERR_OK) {
            instruction = cs_malloc(handle);
        }
    }
    ~Capstone()
    {
        if (instruction) {
            cs_free(instruction, 1);
        }
        cs_close(&handle);
    }
    Capstone(const Capstone &) = delete;
    Capstone &operator=(const Capstone &) = delete;
};

bool is_memory(Op op)
{
    return op >= Op::ld && op <= Op::stdf;
}

bool is_store(Op op)
{
    return (op >= Op::st && op <= Op::std_) || (op >= Op::sta && op <= Op::stda) || (op >= Op::stf && op <= Op::stdf);
}

bool is_alternate(Op op)
{
    return op >= Op::lda && op <= Op::casa;
}

std::string hexadecimal(const char *format, std::uint64_t value)
{
    char text[40];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

/// What capstone does not know and the LEON3 does, as ancillary registers and alternate spaces: with all its fields.
std::string plainly(std::uint32_t word)
{
    const Instruction i = decode(word);
    if (i.op == Op::illegal || i.op == Op::cpop || i.op == Op::cbccc || i.op == Op::fpop_unimplemented) {
        return hexadecimal(".word 0x%08" PRIx64, word);
    }
    const auto r = [](std::uint32_t n) { return "%" + register_name(n); };
    const auto f = [](std::uint32_t n) { return "%f" + std::to_string(n); };
    const std::string operand2 = i.immediate ? std::to_string(i.imm) : r(i.rs2);
    std::string name(name_of(i.op));
    if (is_memory(i.op)) {
        const std::string space = is_alternate(i.op) ? hexadecimal(" 0x%02" PRIx64, i.asi) : "";
        const std::string place = "[" + r(i.rs1) + (i.op == Op::casa ? "" : " + " + operand2) + "]" + space;
        const std::string rd = i.op == Op::stdfq                        ? "%fq"
                               : i.op == Op::ldfsr || i.op == Op::stfsr ? "%fsr"
                               : i.op >= Op::ldf                        ? f(i.rd)
                                                                        : r(i.rd);
        return name + " " +
               (is_store(i.op) ? rd + ", " + place : place + (i.op == Op::casa ? ", " + r(i.rs2) : "") + ", " + rd);
    }
    if (i.op >= Op::fmovs) {
        return name + " " + f(i.rs1) + ", " + f(i.rs2) + ", " + f(i.rd);
    }
    switch (i.op) {
    case Op::rdasr: return "rd %asr" + std::to_string(i.rs1) + ", " + r(i.rd);
    case Op::wrasr: return "wr " + r(i.rs1) + ", " + operand2 + ", %asr" + std::to_string(i.rd);
    case Op::ticc: return name + " " + std::to_string(i.condition) + ", " + r(i.rs1) + " + " + operand2;
    default: return name + " " + r(i.rs1) + ", " + operand2 + ", " + r(i.rd);
    }
}

/// The effective address, and what the instruction has put into a register or into memory.
std::string effect(const Executed &step)
{
    const Instruction i = decode(step.word);
    std::string text;
    if (is_memory(i.op)) {
        text = hexadecimal("  [%08" PRIx64 "]", step.address);
    }
    const auto value = [&](unsigned n) { return hexadecimal("%08" PRIx64, get_register(step.state, n)); };
    const bool pair = i.op == Op::ldd || i.op == Op::std_ || i.op == Op::ldda || i.op == Op::stda;
    const bool integer =
        (i.op >= Op::add && i.op <= Op::rdtbr) || i.op == Op::sethi || i.op == Op::call ||
        (i.op >= Op::jmpl && i.op != Op::rett && i.op != Op::ticc && i.op != Op::flush && i.op < Op::cpop) ||
        (i.op >= Op::ld && i.op <= Op::casa);
    const bool doubles = i.op == Op::lddf || i.op == Op::stdf || i.op == Op::fsqrtd || i.op == Op::faddd ||
                         i.op == Op::fsubd || i.op == Op::fmuld || i.op == Op::fdivd || i.op == Op::fsmuld ||
                         i.op == Op::fitod || i.op == Op::fstod;
    const bool single = i.op == Op::ldf || i.op == Op::stf || (i.op >= Op::fmovs && i.op <= Op::fdtoi);
    constexpr unsigned floats = 32; // behind the integer registers
    if (integer && (i.rd != 0 || is_store(i.op))) {
        text += "  %" + register_name(i.rd) + "=" + value(i.rd) + (pair ? " " + value(i.rd | 1u) : "");
    } else if (doubles) {
        text += "  %f" + std::to_string(i.rd & 30) + "=" + value(floats + (i.rd & 30u)) + value(floats + (i.rd | 1u));
    } else if (single) {
        text += "  %f" + std::to_string(i.rd) + "=" + value(floats + i.rd);
    } else if (i.op >= Op::fcmps && i.op <= Op::fcmped) {
        text += "  fcc=" + std::to_string(step.state.fsr >> fsr::fcc_shift & 3);
    }
    return text;
}

} // namespace

std::string disassemble(std::uint32_t address, std::uint32_t word)
{
    thread_local Capstone capstone;
    const std::array<std::uint8_t, 4> bytes = {static_cast<std::uint8_t>(word >> 24),
                                               static_cast<std::uint8_t>(word >> 16),
                                               static_cast<std::uint8_t>(word >> 8), static_cast<std::uint8_t>(word)};
    const std::uint8_t *code = bytes.data();
    std::size_t size = bytes.size();
    std::uint64_t at = address;
    if (capstone.instruction && cs_disasm_iter(capstone.handle, &code, &size, &at, capstone.instruction)) {
        const cs_insn &found = *capstone.instruction;
        return found.op_str[0] ? std::string(found.mnemonic) + " " + found.op_str : found.mnemonic;
    }
    return plainly(word);
}

Trace::Trace(const std::string &path, const Program &program, std::uint64_t from, std::uint64_t until)
    : program_(program), file_(std::fopen(path.c_str(), "w")), from_(from), until_(until)
{
    if (!file_) {
        throw Error("the trace " + path + " cannot be written: " + std::strerror(errno));
    }
}

Trace::~Trace()
{
    std::fclose(file_);
}

void Trace::executed(const Executed &step)
{
    if (step.begun < from_ || step.begun >= until_) {
        return;
    }
    std::string what = disassemble(step.pc, step.word);
    if (step.trapped) {
        what += "    traps: " + trap_name(step.state.trap_type);
    } else {
        what += effect(step);
    }
    std::fprintf(file_, "%12" PRIu64 " %08" PRIx32 " %-40s %s\n", step.begun, step.pc, program_.place(step.pc).c_str(),
                 what.c_str());
}

} // namespace fledge::emulator
