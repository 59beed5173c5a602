// SPDX-License-Identifier: Apache-2.0
// Writes the instructions of x86-64 for a block of SPARC's.
//
// Registers of the host: rbx the CpuState, rbp the outs and locals, r12 the ins, r13 where address 0 would be in RAM,
// r14 the Context, r15 the cycles that remain; eax, ecx, edx and xmm0 are for one instruction; xmm15 reverses bytes.
// The others hold registers of the guest within a block. Where translated code leaves in the middle of a block, it
// first stores those that have changed, so the state in memory is that before the instruction.
//
// Example:
//
//     using namespace emulator;
//     void translate(const Core &core, const TranslatedTrace &trace, Block &block)
//     {
//         CodeMemory memory(1 << 20);
//         Emitter emitter(memory, core, core.bus->ram());
//         emitter.emit(trace, block, 0);
//     }
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include <xbyak/xbyak.h>

#include "emulator/cpu/engine.h"
#include "emulator/translator/code_memory.h"
#include "emulator/translator/context.h"

namespace fledge::emulator {

/// An instruction of a block, in the order of execution.
struct Item {
    std::uint32_t pc = 0, npc = 0;
    std::uint32_t cycles = 0;
    Instruction instruction;
};

/// The instructions of a block. If it branches, the branch is the last but one, before its delay slot.
struct TranslatedTrace {
    std::vector<Item> items;
    bool branches = false;
    std::uint32_t next = 0; ///< where it goes on if it does not branch
};

class Emitter : private Xbyak::CodeGenerator {
public:
    Emitter(CodeMemory &memory, const Core &core, const Memory &ram);

    /// Whether there is a translation; otherwise the block ends, and the reference executes the instruction.
    static bool translates(const Instruction &i);

    /// Enter translated code; returns Leave in the upper half, an index in the lower.
    using Enter = std::uint64_t (*)(Context *, CpuState *, const std::uint8_t *code);
    Enter enter() const { return enter_; }

    /// Append a block to the code memory.
    void emit(const TranslatedTrace &trace, Block &block, std::uint32_t index);
    /// Make the link jump to an offset of the code memory.
    void connect(const Link &link, std::size_t to);
    bool full() const { return maxSize_ - size_ < reserve; }
    void forget();

    bool checks_reads = false; ///< some page has a flag of page_slow_read, so loads look for it
    std::vector<Link> links;
    std::vector<Site> sites;

private:
    static constexpr std::size_t reserve = 1 << 17; ///< [bytes] more than a block may need
    static constexpr int int_count = 6, float_count = 14;

    /// A register of the host that holds one of the guest, or a pair of floating-point registers.
    struct Slot {
        std::int8_t guest = -1;
        bool dirty = false;  ///< the register in memory is older
        bool normal = false; ///< the double is not subnormal
        std::uint16_t used = 0;
    };
    /// What the host's registers hold at a place of the block.
    struct Registers {
        std::array<Slot, int_count> ints;
        std::array<Slot, float_count> floats;
        Op last_op = Op::illegal;                ///< the last floating-point operation of the block
        int last_a = -1, last_b = -1;            ///< the slots that keep its operands
        Instruction compared;                    ///< Op::illegal, or what has set the condition codes
        bool icc_live = false, fcc_live = false; ///< the flags of the host are those of the last instruction
        std::uint16_t clock = 0;
    };
    /// Code behind the block: leaves at a site.
    struct Departure {
        Xbyak::Label label;
        Registers registers;
        std::uint32_t site = 0;
    };
    /// Code behind the block: looks whether a small result is 0.
    struct SmallResult {
        Xbyak::Label label, back;
        Xbyak::Label *leave = nullptr;
        int slot = 0;
        bool is_single = false;
    };

    /// Code behind the block: looks whether a store into a page with code meets the code.
    struct StoreBesideCode {
        Xbyak::Label label, back;
        Xbyak::Label *leave = nullptr;
        Xbyak::RegExp offset; ///< in the RAM
        unsigned size = 0;
    };

    Xbyak::Reg32 int_register(int slot) const;
    Xbyak::Xmm float_register(int slot) const { return Xbyak::Xmm(slot + 1); }
    Xbyak::Address in_memory(int guest) const;
    Xbyak::Address pair_in_memory(int pair) const;
    Xbyak::Address single_in_memory(int guest) const;

    int int_slot(int guest, bool load);
    Xbyak::Reg32 source(int guest) { return int_register(int_slot(guest, true)); }
    Xbyak::Reg32 target(int guest) { return int_register(int_slot(guest, false)); }
    void changed(int guest);
    void write_back(Slot &slot, int index, bool is_float);
    void write_back_all();
    int free_float_slot();
    int float_slot(int pair);
    void set_pair(int pair, int slot, bool normal);
    void store_pair(int pair, bool drop);
    void remember(Op op, int a = -1, int b = -1);
    void store_last();

    Xbyak::Label &leave_at_site();
    void always_leave();
    void exit(Leave why, std::uint32_t index);
    void chain(std::uint32_t pc);
    void branch(const Item &item, const Item &slot);
    void jump(const Item &item, const Item &slot);
    void step(const Item &item, bool npc_in_target = false);
    void instruction(const Instruction &i);
    bool integer(const Instruction &i);

    Xbyak::Reg32 operand(int guest, const Xbyak::Reg32 &scratch);
    template <class Operation>
    void binary(const Instruction &i, bool commutes, bool cc, Operation operation, bool inverted = false);
    template <class Operation> void shift(const Instruction &i, Operation operation);
    void move(const Instruction &i);
    void compare_integers(const Instruction &i);
    void set_flags();
    void keep_icc();
    void multiply(const Instruction &i, bool is_signed, bool cc);
    void divide(const Instruction &i, bool is_signed);
    void change_window(const Instruction &i, bool save);
    void address_in_eax(const Instruction &i);
    Xbyak::RegExp checked_address(const Instruction &i, unsigned size, std::uint8_t flags);
    void load(const Instruction &i, unsigned size);
    void store(const Instruction &i, unsigned size);

    template <class Operation> void doubles(const Instruction &i, bool two, bool checked, Operation operation);
    template <class Operation> void singles(const Instruction &i, bool two, bool widens, Operation operation);
    void move_single(const Instruction &i);
    bool move_double(const Instruction &first, const Instruction &second);
    void floating(const Instruction &i);
    void to_integer(const Instruction &i, bool from_double);
    void compare(const Instruction &i, bool is_double);
    void accept_double(int slot, Xbyak::Label &leave);
    void accept_single(int guest, Xbyak::Label &leave);
    void check_result(int slot, bool is_single, Xbyak::Label &leave);

    CodeMemory &memory_;
    const Core &core_;
    std::uint32_t ram_base_, ram_size_;
    bool sums_stay_; ///< no register plus a number of 13 bits reaches the RAM past the ends of the address space
    Enter enter_ = nullptr;
    std::array<std::size_t, 5> leave_{};
    std::size_t blocks_begin_ = 0;

    // of the block that is being written
    Registers regs_;
    std::deque<Departure> departures_;
    std::deque<SmallResult> small_results_;
    std::deque<StoreBesideCode> stores_beside_code_;
    std::deque<std::pair<std::uint32_t, Xbyak::Label>> unlinked_;
    std::size_t entry_ = 0; ///< where the block begins to count
    std::uint32_t block_pc_ = 0;
    Site here_;
};

} // namespace fledge::emulator
