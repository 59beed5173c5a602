// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/fuzz.h"

#include <algorithm>
#include <array>
#include <capstone/capstone.h>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <random>

#include "emulator/cpu/instruction.h"
#include "emulator/elf.h"
#include "emulator/machine.h"
#include "emulator/snapshot.h"
#include "emulator/testing/board.h"
#include "emulator/testing/differential.h"
#include "emulator/testing/program.h"

namespace fledge::emulator::testing {
namespace {

class Disassembler {
public:
    Disassembler() { cs_open(CS_ARCH_SPARC, static_cast<cs_mode>(CS_MODE_BIG_ENDIAN), &handle_); }
    ~Disassembler() { cs_close(&handle_); }
    Disassembler(const Disassembler &) = delete;
    Disassembler &operator=(const Disassembler &) = delete;

    /// The name of an instruction; "" if capstone has none.
    std::string name(std::uint32_t word)
    {
        const std::uint8_t bytes[] = {static_cast<std::uint8_t>(word >> 24), static_cast<std::uint8_t>(word >> 16),
                                      static_cast<std::uint8_t>(word >> 8), static_cast<std::uint8_t>(word)};
        cs_insn *found = nullptr;
        if (cs_disasm(handle_, bytes, sizeof bytes, 0x40000000, 1, &found) == 0)
            return "";
        const std::string text = found->mnemonic;
        cs_free(found, 1);
        return text;
    }

private:
    csh handle_ = 0;
};

// Whether capstone, which knows SPARC V9 and its names for common uses, may call an operation so.
bool is_name(const std::string &op, const std::string &name)
{
    static const std::multimap<std::string, std::string> others{
        {"jmpl", "call"}, {"jmpl", "jmp"}, {"jmpl", "ret"},  {"jmpl", "retl"},   {"lddf", "ldd"},     {"ldf", "ld"},
        {"stdf", "std"},  {"stf", "st"},   {"stdfq", "stq"}, {"or", "mov"},      {"subcc", "cmp"},    {"rdy", "rd"},
        {"rdasr", "rd"},  {"wry", "wr"},   {"wrasr", "wr"},  {"casa", "cas"},    {"rdasr", "membar"}, {"sll", "sllx"},
        {"srl", "srlx"},  {"sra", "srax"}, {"sethi", "nop"}, {"rdasr", "stbar"}, {"rdtbr", "flushw"}};
    if (op == "illegal" || op == "cpop" || op == "cbccc" || op == "fpop_unimplemented")
        return true; // of V9
    if (op == "bicc" || op == "fbfcc" || op == "ticc")
        return name.starts_with(op == "bicc" ? "b" : op == "fbfcc" ? "fb" : "t");
    const auto [first, last] = others.equal_range(op);
    return op == name || std::any_of(first, last, [&](const auto &other) { return other.second == name; });
}

std::uint32_t random_word(std::mt19937_64 &random)
{
    auto w = static_cast<std::uint32_t>(random());
    if (random() % 2 == 0) // bits that are not used; capstone has no name for words in which they are set
        w &= (w >> 13 & 1) == 0 && w >> 31 == 1 && (w >> 19 & 0x3E) != 0x34 ? ~0x1FE0u : ~0u;
    if ((w & 0xC1F80000) == 0x81A00000 && random() % 2 == 0) // rs1, which operations on one number do not use
        w &= ~(31u << 14);
    return w;
}

} // namespace

std::string fuzz_decoder(std::uint64_t seed)
{
    std::mt19937_64 random(seed);
    static Disassembler disassembler;
    for (int i = 0; i < 20'000; ++i) {
        const std::uint32_t word = random_word(random);
        const Instruction instruction = decode(word);
        const std::string op(name_of(instruction.op)), name = disassembler.name(word);
        if (op.empty() || instruction.rd > 31 || instruction.rs1 > 31 || instruction.rs2 > 31)
            return "the word " + std::to_string(word) + " decodes to nothing";
        if (!name.empty() && !is_name(op, name)) {
            char text[100];
            std::snprintf(text, sizeof text, "%08x is %s, and %s for capstone", word, op.c_str(), name.c_str());
            return text;
        }
    }
    return "";
}

std::string fuzz_processor(std::uint64_t seed)
{
    std::mt19937_64 random(seed);
    CpuState any;
    for (std::size_t i = 0; i < sizeof any; ++i)
        reinterpret_cast<unsigned char *>(&any)[i] = static_cast<unsigned char>(random());
    keep_possible(any);
    any.mode = Mode::running;
    any.cycles = any.instructions = any.traps = 0;
    any.pc = ram_base + static_cast<std::uint32_t>(random() % ram_size & ~3u);
    any.npc = random() % 4 == 0 ? any.npc : any.pc + 4;
    any.tbr = random() % 4 == 0 ? any.tbr : ram_base + (any.tbr & 0x3F000);
    std::vector<std::uint32_t> words(ram_size / 4);
    for (std::uint32_t &w : words)
        w = random() % 8 == 0 ? nop : random_word(random);
    for (std::uint32_t &r : any.windows) // some point to memory
        r = random() % 2 == 0 ? r : ram_base + r % ram_size;

    const FpuPersonality fpu = random() % 2 == 0 ? FpuPersonality::grfpu : FpuPersonality::qemu;
    std::array<std::unique_ptr<SmallComputer>, 3> computers{std::make_unique<SmallComputer>(make_interpreter()),
                                                            std::make_unique<SmallComputer>(make_threaded()),
                                                            std::make_unique<SmallComputer>(make_translator())};
    for (auto &c : computers) {
        c->s = any;
        c->core.fpu = fpu;
        for (std::size_t i = 0; i < words.size(); ++i)
            c->bus.store(static_cast<std::uint32_t>(ram_base + 4 * i), words[i]);
    }
    for (int slice = 0; slice < 20; ++slice) {
        const std::uint64_t until = computers[0]->s.cycles + 1 + random() % 300;
        std::array<Exit, 3> exits{};
        for (std::size_t i = 0; i < 3; ++i) {
            exits[i] = computers[i]->engine->run(computers[i]->core, until);
            const std::string what = differences(computers[0]->s, computers[i]->s);
            if (!what.empty() || exits[i] != exits[0])
                return std::string(computers[i]->engine->name()) + " up to cycle " + std::to_string(until) + ":\n" +
                       what;
        }
        if (exits[0] != Exit::time)
            break;
    }
    return "";
}

std::string fuzz_files(std::uint64_t seed)
{
    std::mt19937_64 random(seed);
    const auto damage = [&random](auto &bytes, std::size_t from) {
        for (auto n = 1 + random() % 4; n > 0; --n) {
            auto &byte = bytes[from + random() % (bytes.size() - from)];
            using Byte = std::remove_reference_t<decltype(byte)>;
            byte = random() % 2 == 0 ? static_cast<Byte>(random())
                                     : static_cast<Byte>(unsigned(byte) ^ 1u << random() % 8);
        }
        if (random() % 8 == 0)
            bytes.resize(from + random() % (bytes.size() - from));
    };
    constexpr Ns some = 3'000'000; // of the board's time: 3000 cycles

    std::vector<std::byte> file = program_file({add(1, 1, 1), nop, ba(-2), nop});
    damage(file, 0);
    std::string board = board_text;
    if (random() % 2 == 0)
        damage(board, 0);
    try {
        Machine machine(BoardDescription::parse(board, "damaged.toml"));
        machine.load(Program(file, "damaged"));
        machine.run_until(some);
        (void)machine.report();
    } catch (const Error &) {
    }

    Machine machine(test_board());
    machine.load(Program(program_file({add(1, 1, 1), nop, ba(-2), nop}), "whole"));
    machine.run_until(some);
    std::vector<std::byte> snapshot = machine.save();
    constexpr std::size_t head = 24; // magic and hash
    damage(snapshot, random() % 4 == 0 ? 0 : head);
    if (snapshot.size() > head && random() % 4 != 0) { // as if its writer had been wrong
        const std::uint64_t hash = Snapshot::hash_of(std::span(snapshot).subspan(head));
        std::memcpy(snapshot.data() + 16, &hash, sizeof hash);
    }
    try {
        machine.load_snapshot(snapshot);
        machine.run_until(2 * some);
        (void)machine.report();
    } catch (const Error &) {
    }
    return "";
}

} // namespace fledge::emulator::testing
