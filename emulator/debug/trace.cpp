// SPDX-License-Identifier: Apache-2.0
#include "emulator/debug/trace.h"

#include "emulator/error.h"

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
    char text[24];
    std::snprintf(text, sizeof text, ".word 0x%08" PRIx32, word);
    return text;
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
        what += "    traps, type 0x" + std::to_string(step.state.trap_type);
    }
    std::fprintf(file_, "%12" PRIu64 " %08" PRIx32 " %-40s %s\n", step.begun, step.pc, program_.place(step.pc).c_str(),
                 what.c_str());
}

} // namespace fledge::emulator
