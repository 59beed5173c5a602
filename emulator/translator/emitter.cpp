// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/emitter.h"

#include <bit>
#include <cstddef>
#include <cstring>

namespace fledge::emulator {

namespace {

using namespace Xbyak::util;

constexpr std::size_t state_globals = offsetof(CpuState, globals), state_windows = offsetof(CpuState, windows);

#define IN_STATE(member) (rbx + offsetof(CpuState, member))
#define IN_CONTEXT(member) (r14 + offsetof(Context, member))

constexpr Op exact = Op::fmovs; ///< stands for all operations that cause no exception

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

int log2_of(unsigned size)
{
    return size == 8 ? 3 : size == 4 ? 2 : size == 2 ? 1 : 0;
}

} // namespace

Emitter::Emitter(CodeMemory &memory, const Core &core, const Memory &ram)
    : Xbyak::CodeGenerator(memory.size(), memory.writable()), memory_(memory), core_(core), ram_base_(ram.base),
      ram_size_(ram.size), sums_stay_(ram.base >= page_size && ram.base + (ram.size - 1) < 0u - page_size)
{
    const std::array<Xbyak::Reg64, 6> saved{rbx, rbp, r12, r13, r14, r15};
    for (const auto &r : saved) {
        push(r);
    }
    mov(r14, rdi);
    mov(rbx, rsi);
    stmxcsr(dword[IN_CONTEXT(host_mxcsr)]);
    ldmxcsr(dword[IN_CONTEXT(guest_mxcsr)]);
    mov(r15, qword[IN_CONTEXT(remaining)]);
    mov(rbp, qword[IN_CONTEXT(outs)]);
    mov(r12, qword[IN_CONTEXT(ins)]);
    mov(r13, qword[IN_CONTEXT(ram)]);
    vmovdqa(xmm15, xword[IN_CONTEXT(swap)]);
    jmp(rdx);
    Xbyak::Label out;
    for (std::uint32_t why = 0; why < leave_.size(); why++) {
        leave_[why] = getSize();
        mov(edx, why);
        jmp(out, T_NEAR);
    }
    L(out);
    shl(rdx, 32);
    or_(rax, rdx);
    mov(qword[IN_CONTEXT(remaining)], r15);
    stmxcsr(dword[IN_CONTEXT(guest_mxcsr)]);
    ldmxcsr(dword[IN_CONTEXT(host_mxcsr)]);
    for (auto r = saved.rbegin(); r != saved.rend(); ++r) {
        pop(*r);
    }
    ret();
    enter_ = std::bit_cast<Enter>(memory.executable(0));
    blocks_begin_ = getSize();
}

void Emitter::forget()
{
    setSize(blocks_begin_);
    links.clear();
    sites.clear();
}

void Emitter::connect(const Link &link, std::size_t to)
{
    const auto distance = static_cast<std::int32_t>(to - (link.jump + 4));
    std::memcpy(memory_.writable() + link.jump, &distance, sizeof distance);
}

// ---- registers

Xbyak::Reg32 Emitter::int_register(int slot) const
{
    static constexpr std::array<int, int_count> numbers{Xbyak::Operand::ESI,  Xbyak::Operand::EDI,
                                                        Xbyak::Operand::R8D,  Xbyak::Operand::R9D,
                                                        Xbyak::Operand::R10D, Xbyak::Operand::R11D};
    return Xbyak::Reg32(numbers[static_cast<std::size_t>(slot)]);
}

Xbyak::Address Emitter::in_memory(int guest) const
{
    const std::size_t offset = 4 * static_cast<std::size_t>(guest % 8);
    return guest < 8    ? dword[rbx + state_globals + offset]
           : guest < 16 ? dword[rbp + offset]
           : guest < 24 ? dword[rbp + 32 + offset]
                        : dword[r12 + offset];
}

Xbyak::Address Emitter::pair_in_memory(int pair) const
{
    return qword[IN_STATE(floats) + 8 * static_cast<std::size_t>(pair)];
}

Xbyak::Address Emitter::single_in_memory(int guest) const
{
    return dword[IN_STATE(floats) + 8 * static_cast<std::size_t>(guest / 2) + (is_double_register(guest) ? 4u : 0u)];
}

/// Stores a slot if memory is older. Changes no flags of the host.
void Emitter::write_back(Slot &slot, int index, bool is_float)
{
    if (slot.dirty && is_float) {
        vmovq(pair_in_memory(slot.guest), float_register(index));
    } else if (slot.dirty) {
        mov(in_memory(slot.guest), int_register(index));
    }
    slot.dirty = false;
}

void Emitter::write_back_all()
{
    for (int k = 0; k < int_count; k++) {
        write_back(regs_.ints[static_cast<std::size_t>(k)], k, false);
    }
    for (int k = 0; k < float_count; k++) {
        write_back(regs_.floats[static_cast<std::size_t>(k)], k, true);
    }
    store_last();
}

/// The slot of a register of the guest; one that is not there takes the place of the one unused for longest.
int Emitter::int_slot(int guest, bool load)
{
    int found = -1, oldest = -1;
    for (int k = 0; k < int_count; k++) {
        const Slot &slot = regs_.ints[static_cast<std::size_t>(k)];
        if (slot.guest == guest) {
            found = k;
        }
        const auto age = [this](int s) {
            const Slot &other = regs_.ints[static_cast<std::size_t>(s)];
            return other.guest < 0 ? -1 : int{other.used};
        };
        if (oldest < 0 || age(k) < age(oldest)) {
            oldest = k;
        }
    }
    const int k = found >= 0 ? found : oldest;
    Slot &slot = regs_.ints[static_cast<std::size_t>(k)];
    if (found < 0) {
        write_back(slot, k, false);
        slot = {.guest = static_cast<std::int8_t>(guest)};
        if (load) {
            mov(int_register(k), in_memory(guest));
        }
    }
    slot.used = regs_.clock;
    return k;
}

/// A slot that holds nothing of use; the operands of the last operation are of use.
int Emitter::free_float_slot()
{
    int oldest = -1;
    const auto age = [this](int s) {
        const Slot &slot = regs_.floats[static_cast<std::size_t>(s)];
        return slot.guest < 0 ? (slot.used == regs_.clock ? 1 << 16 : -1) : int{slot.used};
    };
    for (int k = 0; k < float_count; k++) {
        if (k != regs_.last_a && k != regs_.last_b && (oldest < 0 || age(k) < age(oldest))) {
            oldest = k;
        }
    }
    Slot &slot = regs_.floats[static_cast<std::size_t>(oldest)];
    write_back(slot, oldest, true);
    slot = {.used = regs_.clock};
    return oldest;
}

int Emitter::float_slot(int pair)
{
    for (int k = 0; k < float_count; k++) {
        Slot &slot = regs_.floats[static_cast<std::size_t>(k)];
        if (slot.guest == pair) {
            slot.used = regs_.clock;
            return k;
        }
    }
    const int k = free_float_slot();
    vmovq(float_register(k), pair_in_memory(pair));
    regs_.floats[static_cast<std::size_t>(k)] = {.guest = static_cast<std::int8_t>(pair), .used = regs_.clock};
    return k;
}

/// The slot has the new value of the pair.
void Emitter::set_pair(int pair, int slot, bool normal)
{
    for (Slot &other : regs_.floats) {
        if (other.guest == pair) {
            other = {};
        }
    }
    regs_.floats[static_cast<std::size_t>(slot)] = {
        .guest = static_cast<std::int8_t>(pair), .dirty = true, .normal = normal, .used = regs_.clock};
}

/// Memory gets the pair, because an instruction reads or, with `drop`, changes a half of it there.
void Emitter::store_pair(int pair, bool drop)
{
    for (int k = 0; k < float_count; k++) {
        Slot &slot = regs_.floats[static_cast<std::size_t>(k)];
        if (slot.guest == pair) {
            write_back(slot, k, true);
            if (drop) {
                slot = {};
            }
        }
    }
}

void Emitter::remember(Op op, int a, int b)
{
    regs_.last_op = op;
    regs_.last_a = a;
    regs_.last_b = b;
}

/// The current exceptions follow from what this stores.
void Emitter::store_last()
{
    if (regs_.last_op == Op::illegal) {
        return;
    }
    if (regs_.last_a >= 0) {
        vmovq(qword[IN_CONTEXT(last_a)], float_register(regs_.last_a));
    }
    if (regs_.last_b >= 0) {
        vmovq(qword[IN_CONTEXT(last_b)], float_register(regs_.last_b));
    }
    mov(dword[IN_CONTEXT(last_op)], static_cast<std::uint32_t>(regs_.last_op));
    remember(Op::illegal);
}

// ---- ways out of a block

void Emitter::exit(Leave why, std::uint32_t index)
{
    mov(eax, index);
    jmp(getCode() + leave_[static_cast<std::size_t>(why)], T_NEAR);
}

/// Where to jump so that the reference executes the present instruction. The registers are those of now.
Xbyak::Label &Emitter::leave_at_site()
{
    departures_.emplace_back();
    departures_.back().registers = regs_;
    departures_.back().site = static_cast<std::uint32_t>(sites.size());
    sites.push_back(here_);
    return departures_.back().label;
}

void Emitter::always_leave()
{
    jmp(leave_at_site(), T_NEAR);
}

void Emitter::chain(std::uint32_t pc)
{
    write_back_all();
    if (pc == block_pc_) {
        jmp(getCode() + entry_, T_NEAR);
        return;
    }
    unlinked_.emplace_back(static_cast<std::uint32_t>(links.size()), Xbyak::Label());
    jmp(unlinked_.back().second, T_NEAR);
    links.push_back({.pc = pc, .jump = getSize() - 4});
}

// ---- a block

void Emitter::emit(const TranslatedTrace &trace, Block &block, std::uint32_t index)
{
    regs_ = {};
    departures_.clear();
    small_results_.clear();
    stores_beside_code_.clear();
    unlinked_.clear();
    block_pc_ = block.pc;
    block.entry = getSize();

    std::uint32_t cycles = 0;
    bool fpu = false;
    for (const Item &item : trace.items) {
        cycles += item.cycles;
        fpu = fpu || uses_fpu(item.instruction.op);
    }
    const auto count = static_cast<std::uint32_t>(trace.items.size());
    Xbyak::Label not_ready, time;
    if (fpu) {
        cmp(dword[IN_CONTEXT(fp_ready)], 0);
        je(not_ready, T_NEAR);
    }
    entry_ = getSize();
    sub(r15, cycles);
    jl(time, T_NEAR);
    add(qword[IN_STATE(instructions)], count);

    here_ = {};
    here_.cycles = cycles;
    here_.instructions = count;
    const std::size_t straight = trace.items.size() - (trace.branches ? 2 : 0);
    for (std::size_t k = 0; k < straight; k++) {
        if (k + 1 < straight && trace.items[k + 1].pc == trace.items[k].pc + 4 &&
            move_double(trace.items[k].instruction, trace.items[k + 1].instruction)) {
            here_.cycles -= trace.items[k].cycles + trace.items[k + 1].cycles;
            here_.instructions -= 2;
            k++;
        } else {
            step(trace.items[k]);
        }
    }
    if (!trace.branches) {
        chain(trace.next);
    } else if (trace.items[straight].instruction.op == Op::jmpl) {
        jump(trace.items[straight], trace.items[straight + 1]);
    } else {
        branch(trace.items[straight], trace.items[straight + 1]);
    }

    for (SmallResult &small : small_results_) {
        L(small.label);
        vxorpd(xmm0, xmm0, xmm0);
        if (small.is_single) {
            vucomiss(float_register(small.slot), xmm0);
        } else {
            vucomisd(float_register(small.slot), xmm0);
        }
        jp(*small.leave, T_NEAR);
        je(small.back, T_NEAR);
        jmp(*small.leave, T_NEAR);
    }
    for (StoreBesideCode &store : stores_beside_code_) { // rdx + rcx: the flags of the page
        L(store.label);
        movzx(edx, byte[rdx + rcx]);
        and_(edx, page_slow_write);
        cmp(edx, page_code);
        jne(*store.leave, T_NEAR);
        mov(rdx, qword[IN_CONTEXT(code_words)]);
        lea(ecx, ptr[store.offset]);
        shr(ecx, 2);
        if (store.size == 8) {
            cmp(word[rdx + rcx], 0);
        } else {
            cmp(byte[rdx + rcx], 0);
        }
        jne(*store.leave, T_NEAR);
        jmp(store.back, T_NEAR);
    }
    for (Departure &departure : departures_) {
        L(departure.label);
        regs_ = departure.registers;
        write_back_all();
        exit(Leave::site, departure.site);
    }
    for (auto &[link, label] : unlinked_) {
        L(label);
        links[link].unlinked = getSize();
        exit(Leave::link, link);
    }
    L(time);
    add(r15, cycles);
    exit(Leave::time, index);
    if (fpu) {
        L(not_ready);
        exit(Leave::not_ready, index);
    }
}

/// An instruction, and what the block counts for it.
void Emitter::step(const Item &item, bool npc_in_target)
{
    here_.instruction = item.instruction;
    here_.pc = item.pc;
    here_.npc = item.npc;
    here_.npc_in_target = npc_in_target;
    regs_.clock++;
    instruction(item.instruction);
    here_.cycles -= item.cycles;
    here_.instructions--;
}

void Emitter::branch(const Item &item, const Item &slot)
{
    const Instruction &i = item.instruction;
    regs_.clock++;
    here_.cycles -= item.cycles;
    here_.instructions--;
    Xbyak::Label taken;
    if (i.op == Op::bicc) {
        if (!regs_.icc_live && regs_.compared.op != Op::illegal) {
            set_flags();
        } else if (!regs_.icc_live) {
            movzx(eax, word[IN_CONTEXT(icc)]);
            add(al, 127);
            sahf();
        }
        using Jump = void (Emitter::*)(const Xbyak::Label &, LabelType);
        static constexpr std::array<Jump, 16> jumps{nullptr,       &Emitter::je,  &Emitter::jle, &Emitter::jl,
                                                    &Emitter::jbe, &Emitter::jb,  &Emitter::js,  &Emitter::jo,
                                                    nullptr,       &Emitter::jne, &Emitter::jg,  &Emitter::jge,
                                                    &Emitter::ja,  &Emitter::jae, &Emitter::jns, &Emitter::jno};
        (this->*jumps[i.condition])(taken, T_NEAR);
    } else {
        std::uint32_t holds = 0; // bit k: the condition holds for fcc = k
        for (std::uint32_t fcc = 0; fcc < 4; fcc++) {
            holds |= fp_condition_holds(i.condition, fcc) ? 1u << fcc : 0;
        }
        if (regs_.fcc_live) { // not unordered, for then the comparison left
            using Jump = void (Emitter::*)(const Xbyak::Label &, LabelType);
            static constexpr std::array<Jump, 7> jumps{nullptr,      &Emitter::je,  &Emitter::jb, &Emitter::jbe,
                                                       &Emitter::ja, &Emitter::jae, &Emitter::jne};
            if ((holds & 7) == 7) {
                jmp(taken, T_NEAR);
            } else if ((holds & 7) != 0) {
                (this->*jumps[holds & 7])(taken, T_NEAR);
            }
        } else {
            mov(ecx, dword[IN_CONTEXT(fcc)]);
            mov(eax, holds);
            bt(eax, ecx);
            jc(taken, T_NEAR);
        }
    }
    const Registers at_branch = regs_;
    const Site slot_site = here_;
    if (i.annul) {
        const std::int64_t less = std::int64_t{slot.cycles} - core_.timing.annulled;
        if (less != 0) {
            add(r15, static_cast<std::uint32_t>(less));
        }
        sub(qword[IN_STATE(instructions)], 1);
    } else {
        Item untaken = slot;
        untaken.npc = item.pc + 8;
        step(untaken);
    }
    chain(item.pc + 8);
    L(taken);
    regs_ = at_branch;
    here_ = slot_site;
    Item after = slot;
    after.npc = item.pc + static_cast<std::uint32_t>(i.imm);
    step(after);
    chain(after.npc);
}

void Emitter::jump(const Item &item, const Item &slot)
{
    const Instruction &i = item.instruction;
    here_.instruction = i;
    here_.pc = item.pc;
    here_.npc = item.npc;
    here_.npc_in_target = false;
    regs_.clock++;
    regs_.icc_live = regs_.fcc_live = false;
    address_in_eax(i);
    test(al, 3);
    jnz(leave_at_site(), T_NEAR);
    mov(dword[IN_CONTEXT(target)], eax);
    if (i.rd != 0) {
        mov(target(i.rd), item.pc);
        changed(i.rd);
    }
    here_.cycles -= item.cycles;
    here_.instructions--;
    step(slot, true);
    write_back_all();
    mov(ecx, dword[IN_CONTEXT(target)]);
    mov(rax, qword[IN_CONTEXT(targets)]);
    mov(edx, ecx);
    and_(edx, (target_count - 1) * 4);
    lea(rax, ptr[rax + rdx * 4]);
    Xbyak::Label miss;
    cmp(qword[rax], rcx);
    jne(miss);
    jmp(qword[rax + 8]);
    L(miss);
    exit(Leave::lookup, 0);
}

// ---- integers

/// A source register; %g0 is a 0 in the scratch register. Changes no flags of the host.
Xbyak::Reg32 Emitter::operand(int guest, const Xbyak::Reg32 &scratch)
{
    if (guest == 0) {
        mov(scratch, 0);
        return scratch;
    }
    return source(guest);
}

/// rd = rs1 op operand2, or op ~operand2, where `operation(d, b)` is d op= b.
template <class Operation>
void Emitter::binary(const Instruction &i, bool commutes, bool cc, Operation operation, bool inverted)
{
    if (i.rd == 0 && !cc) {
        return;
    }
    const bool number = i.immediate || i.rs2 == 0;
    const auto n = static_cast<std::uint32_t>(i.immediate ? i.imm : 0);
    const Xbyak::Reg32 a = operand(i.rs1, eax);
    Xbyak::Reg32 b = number ? ecx : source(i.rs2);
    const Xbyak::Reg32 d = i.rd == 0 ? eax : target(i.rd);
    if (!number && (inverted || (d.getIdx() == b.getIdx() && d.getIdx() != a.getIdx() && !commutes))) {
        mov(ecx, b);
        b = ecx;
    }
    if (!number && inverted) {
        not_(ecx);
    }
    if (!number && d.getIdx() == b.getIdx()) {
        operation(d, a);
    } else {
        if (d.getIdx() != a.getIdx()) {
            mov(d, a);
        }
        if (number) {
            operation(d, inverted ? ~n : n);
        } else {
            operation(d, b);
        }
    }
    if (i.rd != 0) {
        changed(i.rd);
    }
    if (cc) {
        keep_icc();
    }
}

/// rd = operand2
void Emitter::move(const Instruction &i)
{
    if (i.rd == 0) {
        return;
    }
    if (i.immediate || i.rs2 == 0) {
        mov(target(i.rd), static_cast<std::uint32_t>(i.immediate ? i.imm : 0));
    } else {
        const Xbyak::Reg32 from = source(i.rs2);
        mov(target(i.rd), from);
    }
    changed(i.rd);
}

/// subcc, andcc and orcc without a result: the flags of the host can be made again at the branch, if the operands are
/// still the same.
void Emitter::compare_integers(const Instruction &i)
{
    regs_.compared = i;
    set_flags();
    keep_icc();
}

void Emitter::set_flags()
{
    const Instruction &i = regs_.compared;
    const bool number = i.immediate || i.rs2 == 0;
    const auto n = static_cast<std::uint32_t>(i.immediate ? i.imm : 0);
    if (i.op == Op::orcc) { // one of the operands is 0
        const Xbyak::Reg32 r = operand(i.rs1 != 0 ? i.rs1 : i.rs2, eax);
        test(r, r);
        return;
    }
    const Xbyak::Reg32 a = operand(i.rs1, eax);
    const Xbyak::Reg32 b = number ? ecx : source(i.rs2);
    if (i.op == Op::subcc && number) {
        cmp(a, n);
    } else if (i.op == Op::subcc) {
        cmp(a, b);
    } else if (number) {
        test(a, n);
    } else {
        test(a, b);
    }
}

/// The register of the guest has a new value.
void Emitter::changed(int guest)
{
    regs_.ints[static_cast<std::size_t>(int_slot(guest, false))].dirty = true;
    const Instruction &i = regs_.compared;
    if (i.rs1 == guest || (!i.immediate && i.rs2 == guest)) {
        regs_.compared = {};
    }
}

/// The flags of the host become the condition codes. SPARC's carry of a subtraction is a borrow, too.
void Emitter::keep_icc()
{
    lahf();
    seto(al);
    mov(word[IN_CONTEXT(icc)], ax);
    regs_.icc_live = true;
}

template <class Operation> void Emitter::shift(const Instruction &i, Operation operation)
{
    if (i.rd == 0) {
        return;
    }
    const Xbyak::Reg32 a = operand(i.rs1, eax);
    const bool number = i.immediate || i.rs2 == 0;
    if (!number) {
        mov(ecx, source(i.rs2));
    }
    const Xbyak::Reg32 d = target(i.rd);
    if (d.getIdx() != a.getIdx()) {
        mov(d, a);
    }
    if (!number) {
        operation(d, cl);
    } else if ((i.imm & 31) != 0 && i.immediate) {
        operation(d, i.imm & 31);
    }
    changed(i.rd);
}

void Emitter::multiply(const Instruction &i, bool is_signed, bool cc)
{
    const Xbyak::Reg32 a = operand(i.rs1, eax);
    if (is_signed) {
        movsxd(rax, a);
    } else {
        mov(eax, a);
    }
    if (i.immediate) {
        if (is_signed) {
            mov(rcx, i.imm);
        } else {
            mov(ecx, static_cast<std::uint32_t>(i.imm));
        }
    } else if (is_signed) {
        movsxd(rcx, operand(i.rs2, ecx));
    } else {
        mov(ecx, operand(i.rs2, ecx));
    }
    imul(rax, rcx);
    mov(rcx, rax);
    shr(rcx, 32);
    mov(dword[IN_STATE(y)], ecx);
    if (i.rd != 0) {
        mov(target(i.rd), eax);
        changed(i.rd);
    }
    if (cc) {
        test(eax, eax);
        keep_icc();
    }
}

void Emitter::divide(const Instruction &i, bool is_signed)
{
    if (i.immediate && (i.imm == 0 || i.imm == -1)) {
        always_leave();
        return;
    }
    const Xbyak::Reg32 a = operand(i.rs1, edx);
    const Xbyak::Reg32 b = i.immediate ? ecx : operand(i.rs2, ecx);
    if (i.immediate) {
        mov(ecx, static_cast<std::uint32_t>(i.imm));
    } else if (b.getIdx() != ecx.getIdx()) {
        mov(ecx, b);
    }
    Xbyak::Label &leave = leave_at_site();
    mov(eax, dword[IN_STATE(y)]);
    shl(rax, 32);
    or_(rax, a.cvt64());
    if (is_signed) { // a division by -1 may overflow the host's 64 bits
        lea(edx, ptr[rcx + 1]);
        cmp(edx, 1);
        jbe(leave, T_NEAR);
        movsxd(rcx, ecx);
        cqo();
        idiv(rcx);
        movsxd(rdx, eax);
        cmp(rdx, rax);
        jne(leave, T_NEAR);
    } else {
        test(ecx, ecx);
        jz(leave, T_NEAR);
        xor_(edx, edx);
        div(rcx);
        mov(ecx, -1);
        cmp(rax, rcx);
        cmova(rax, rcx);
    }
    if (i.rd != 0) {
        mov(target(i.rd), eax);
        changed(i.rd);
    }
}

/// save and restore: the outs of a window are the ins of the next one, in the same memory.
void Emitter::change_window(const Instruction &i, bool save)
{
    mov(ecx, dword[IN_STATE(psr)]);
    lea(edx, ptr[rcx + (save ? window_count - 1 : 1)]);
    and_(edx, window_count - 1);
    mov(eax, dword[IN_STATE(wim)]);
    bt(eax, edx);
    jc(leave_at_site(), T_NEAR);
    if (i.rd != 0) {
        address_in_eax(i);
    }
    and_(ecx, ~psr::cwp);
    or_(ecx, edx);
    mov(dword[IN_STATE(psr)], ecx);
    for (int k = 0; k < int_count; k++) {
        Slot &slot = regs_.ints[static_cast<std::size_t>(k)];
        const bool moves = save ? slot.guest >= 8 && slot.guest < 16 : slot.guest >= 24;
        if (moves) {
            continue;
        }
        if (slot.guest >= 8) {
            write_back(slot, k, false);
            slot = {};
        }
    }
    for (Slot &slot : regs_.ints) {
        if (slot.guest >= 8) {
            slot.guest = static_cast<std::int8_t>(slot.guest + (save ? 16 : -16));
        }
    }
    if (save) {
        mov(r12, rbp);
        shl(edx, 6);
        lea(rbp, ptr[rbx + rdx + state_windows]);
    } else {
        mov(rbp, r12);
        inc(edx);
        and_(edx, window_count - 1);
        shl(edx, 6);
        lea(r12, ptr[rbx + rdx + state_windows]);
    }
    if (i.rd != 0) {
        mov(target(i.rd), eax);
        changed(i.rd);
    }
}

// ---- memory

/// rs1 + operand2
void Emitter::address_in_eax(const Instruction &i)
{
    if (!i.immediate && i.rs2 != 0 && i.rs1 != 0) {
        const Xbyak::Reg64 a = source(i.rs1).cvt64();
        lea(eax, ptr[a + source(i.rs2).cvt64()]);
    } else if (i.rs1 != 0) {
        lea(eax, ptr[source(i.rs1).cvt64() + (i.immediate ? i.imm : 0)]);
    } else if (i.immediate || i.rs2 == 0) {
        mov(eax, static_cast<std::uint32_t>(i.immediate ? i.imm : 0));
    } else {
        mov(eax, source(i.rs2));
    }
}

/// Where the aligned datum stands in the host's memory; leaves if that is not RAM, or if its page has one of the flags,
/// but for stores beside the code of a page.
Xbyak::RegExp Emitter::checked_address(const Instruction &i, unsigned size, std::uint8_t flags)
{
    const int k = log2_of(size);
    Xbyak::RegExp place = r13 + rax, in_ram = rax - static_cast<std::int32_t>(ram_base_);
    if (i.rs1 != 0 && (i.immediate || i.rs2 == 0) && sums_stay_) {
        const std::int32_t offset = i.immediate ? i.imm : 0;
        const Xbyak::Reg64 base = source(i.rs1).cvt64();
        in_ram = base + (offset - static_cast<std::int32_t>(ram_base_));
        place = r13 + base + offset;
    } else {
        address_in_eax(i);
    }
    lea(ecx, ptr[in_ram]);
    if (k != 0) {
        ror(ecx, k); // the low bits, which must be 0, become the high ones
    }
    Xbyak::Label &leave = leave_at_site();
    cmp(ecx, ram_size_ >> k);
    jae(leave, T_NEAR);
    if (flags != 0) {
        shr(ecx, 12 - k);
        mov(rdx, qword[IN_CONTEXT(page_flags)]);
        test(byte[rdx + rcx], flags);
        if (flags == page_slow_write) {
            stores_beside_code_.emplace_back();
            StoreBesideCode &s = stores_beside_code_.back();
            s.leave = &leave;
            s.offset = in_ram;
            s.size = size;
            jnz(s.label, T_NEAR);
            L(s.back);
        } else {
            jnz(leave, T_NEAR);
        }
    }
    return place;
}

void Emitter::load(const Instruction &i, unsigned size)
{
    const bool is_signed = i.op == Op::ldsb || i.op == Op::ldsh;
    const Xbyak::RegExp place = checked_address(i, size, checks_reads ? page_slow_read : 0);
    if (i.op == Op::lddf) {
        const int k = free_float_slot();
        vmovq(float_register(k), qword[place]);
        vpshufb(float_register(k), float_register(k), xmm15);
        set_pair(i.rd / 2, k, false);
        return;
    }
    if (i.op == Op::ldf) {
        store_pair(i.rd / 2, true);
        mov(edx, dword[place]);
        bswap(edx);
        mov(single_in_memory(i.rd), edx);
        return;
    }
    if (size == 8) {
        mov(rax, qword[place]);
        bswap(rax);
        mov(target(i.rd + 1), eax);
        changed(i.rd + 1);
        if (i.rd != 0) {
            shr(rax, 32);
            mov(target(i.rd), eax);
            changed(i.rd);
        }
        return;
    }
    if (i.rd == 0) {
        return;
    }
    const Xbyak::Reg32 d = target(i.rd);
    if (size == 4) {
        mov(d, dword[place]);
        bswap(d);
    } else if (size == 2) {
        movzx(d, word[place]);
        bswap(d);
        if (is_signed) {
            sar(d, 16);
        } else {
            shr(d, 16);
        }
    } else if (is_signed) {
        movsx(d, byte[place]);
    } else {
        movzx(d, byte[place]);
    }
    changed(i.rd);
}

void Emitter::store(const Instruction &i, unsigned size)
{
    const Xbyak::RegExp place = checked_address(i, size, page_slow_write);
    if (i.op == Op::stdf) {
        vpshufb(xmm0, float_register(float_slot(i.rd / 2)), xmm15);
        vmovq(qword[place], xmm0);
        return;
    }
    if (i.op == Op::stf) {
        store_pair(i.rd / 2, false);
        mov(edx, single_in_memory(i.rd));
        bswap(edx);
        mov(dword[place], edx);
        return;
    }
    mov(edx, operand(i.rd, edx));
    if (size == 8) {
        shl(rdx, 32);
        or_(rdx, source(i.rd + 1).cvt64());
        bswap(rdx);
        mov(qword[place], rdx);
    } else if (size == 4) {
        bswap(edx);
        mov(dword[place], edx);
    } else if (size == 2) {
        rol(dx, 8);
        mov(word[place], dx);
    } else {
        mov(byte[place], dl);
    }
}

// ---- floating point

/// The GRFPU traps on subnormal operands.
void Emitter::accept_double(int slot, Xbyak::Label &leave)
{
    Slot &s = regs_.floats[static_cast<std::size_t>(slot)];
    if (core_.fpu != FpuPersonality::grfpu || s.normal) {
        return;
    }
    vmovq(rax, float_register(slot));
    lea(rax, ptr[rax + rax - 1]);
    cmp(rax, qword[IN_CONTEXT(subnormal_limit)]);
    jb(leave, T_NEAR);
    s.normal = true;
}

void Emitter::accept_single(int guest, Xbyak::Label &leave)
{
    if (core_.fpu == FpuPersonality::grfpu) {
        mov(eax, single_in_memory(guest));
        lea(eax, ptr[rax + rax - 1]);
        cmp(eax, (1u << 24) - 1);
        jb(leave, T_NEAR);
    }
}

/// The reference decides about NaNs; the GRFPU gives 0 for a result that is too small to be normal.
void Emitter::check_result(int slot, bool is_single, Xbyak::Label &leave)
{
    const Xbyak::Xmm d = float_register(slot);
    if (core_.fpu != FpuPersonality::grfpu) {
        if (is_single) {
            vucomiss(d, d);
        } else {
            vucomisd(d, d);
        }
        jp(leave, T_NEAR);
        return;
    }
    small_results_.push_back({.label = {}, .back = {}, .leave = &leave, .slot = slot, .is_single = is_single});
    if (is_single) {
        vandps(xmm0, d, xword[IN_CONTEXT(single_magnitude)]);
        vucomiss(xmm0, dword[IN_CONTEXT(single_smallest_normal)]);
    } else {
        vandpd(xmm0, d, xword[IN_CONTEXT(magnitude)]);
        vucomisd(xmm0, qword[IN_CONTEXT(smallest_normal)]);
    }
    jbe(small_results_.back().label, T_NEAR); // also if they cannot be compared
    L(small_results_.back().back);
}

/// An operation on doubles.
template <class Operation> void Emitter::doubles(const Instruction &i, bool two, bool tiny, Operation operation)
{
    const int b = float_slot(i.rs2 / 2), a = two ? float_slot(i.rs1 / 2) : -1;
    const int d = free_float_slot();
    Xbyak::Label &leave = leave_at_site();
    if (two) {
        accept_double(a, leave);
    }
    accept_double(b, leave);
    operation(float_register(d), two ? float_register(a) : float_register(b), float_register(b));
    if (tiny) {
        check_result(d, false, leave);
    } else { // a square root
        vucomisd(float_register(d), float_register(d));
        jp(leave, T_NEAR);
    }
    set_pair(i.rd / 2, d, true);
    remember(i.op, a, b);
}

/// An operation on singles, which are in memory; `widens`: the result is a double.
template <class Operation> void Emitter::singles(const Instruction &i, bool two, bool widens, Operation operation)
{
    if (two) {
        store_pair(i.rs1 / 2, false);
    }
    store_pair(i.rs2 / 2, false);
    const int a = free_float_slot(), b = free_float_slot(), d = free_float_slot();
    Xbyak::Label &leave = leave_at_site();
    if (two) {
        accept_single(i.rs1, leave);
        vmovd(float_register(a), single_in_memory(i.rs1));
    }
    accept_single(i.rs2, leave);
    vmovd(float_register(b), single_in_memory(i.rs2));
    operation(float_register(d), float_register(a), float_register(b));
    check_result(d, !widens, leave);
    if (widens) {
        set_pair(i.rd / 2, d, true);
    } else {
        store_pair(i.rd / 2, true);
        vmovd(single_in_memory(i.rd), float_register(d));
    }
    if (widens) {
        remember(exact);
    } else {
        remember(i.op, two ? a : -1, b);
    }
}

/// fmovs, fnegs, fabss
void Emitter::move_single(const Instruction &i)
{
    const int from = i.rs2 / 2, to = i.rd / 2;
    store_pair(from, from == to);
    store_pair(to, true);
    mov(ecx, single_in_memory(i.rs2));
    if (i.op == Op::fnegs) {
        xor_(ecx, 1u << 31);
    } else if (i.op == Op::fabss) {
        and_(ecx, ~(1u << 31));
    }
    mov(single_in_memory(i.rd), ecx);
    remember(exact);
}

/// Two instructions that move a double: the upper half, whose sign may change, then the lower.
bool Emitter::move_double(const Instruction &first, const Instruction &second)
{
    if ((first.op != Op::fmovs && first.op != Op::fnegs && first.op != Op::fabss) || second.op != Op::fmovs ||
        !is_double_register(first.rd) || !is_double_register(first.rs2) || second.rd != first.rd + 1 ||
        second.rs2 != first.rs2 + 1 || first.rd == first.rs2) {
        return false;
    }
    regs_.clock++;
    regs_.icc_live = regs_.fcc_live = false;
    const int from = float_slot(first.rs2 / 2), d = free_float_slot();
    if (first.op == Op::fmovs) {
        vmovapd(float_register(d), float_register(from));
    } else if (first.op == Op::fnegs) {
        vxorpd(float_register(d), float_register(from), xword[IN_CONTEXT(sign)]);
    } else {
        vandpd(float_register(d), float_register(from), xword[IN_CONTEXT(magnitude)]);
    }
    set_pair(first.rd / 2, d, regs_.floats[static_cast<std::size_t>(from)].normal);
    remember(exact);
    return true;
}

void Emitter::to_integer(const Instruction &i, bool from_double)
{
    const int b = from_double ? float_slot(i.rs2 / 2) : free_float_slot();
    if (!from_double) {
        store_pair(i.rs2 / 2, false);
    }
    Xbyak::Label &leave = leave_at_site();
    if (from_double) {
        accept_double(b, leave);
        vcvttsd2si(ecx, float_register(b));
    } else {
        accept_single(i.rs2, leave);
        vmovd(float_register(b), single_in_memory(i.rs2));
        vcvttss2si(ecx, float_register(b));
    }
    cmp(ecx, 1u << 31); // what the host gives for a number that does not fit
    je(leave, T_NEAR);
    store_pair(i.rd / 2, true);
    mov(single_in_memory(i.rd), ecx);
    remember(i.op, -1, b);
}

void Emitter::compare(const Instruction &i, bool is_double)
{
    if (is_double) {
        const int a = float_slot(i.rs1 / 2), b = float_slot(i.rs2 / 2);
        vucomisd(float_register(a), float_register(b));
    } else {
        store_pair(i.rs1 / 2, false);
        store_pair(i.rs2 / 2, false);
        vmovd(xmm0, single_in_memory(i.rs1));
        vucomiss(xmm0, single_in_memory(i.rs2));
    }
    jp(leave_at_site(), T_NEAR);
    setb(al);
    seta(cl);
    movzx(eax, al);
    movzx(ecx, cl);
    lea(eax, ptr[rax + rcx * 2]);
    mov(dword[IN_CONTEXT(fcc)], eax);
    remember(exact);
    regs_.fcc_live = true;
}

void Emitter::floating(const Instruction &i)
{
    using Xmm = Xbyak::Xmm;
    switch (i.op) {
    case Op::fmovs:
    case Op::fnegs:
    case Op::fabss: move_single(i); break;
    case Op::faddd: doubles(i, true, true, [this](Xmm d, Xmm a, Xmm b) { vaddsd(d, a, b); }); break;
    case Op::fsubd: doubles(i, true, true, [this](Xmm d, Xmm a, Xmm b) { vsubsd(d, a, b); }); break;
    case Op::fmuld: doubles(i, true, true, [this](Xmm d, Xmm a, Xmm b) { vmulsd(d, a, b); }); break;
    case Op::fdivd: doubles(i, true, true, [this](Xmm d, Xmm a, Xmm b) { vdivsd(d, a, b); }); break;
    case Op::fsqrtd: doubles(i, false, false, [this](Xmm d, Xmm a, Xmm b) { vsqrtsd(d, a, b); }); break;
    case Op::fadds: singles(i, true, false, [this](Xmm d, Xmm a, Xmm b) { vaddss(d, a, b); }); break;
    case Op::fsubs: singles(i, true, false, [this](Xmm d, Xmm a, Xmm b) { vsubss(d, a, b); }); break;
    case Op::fmuls: singles(i, true, false, [this](Xmm d, Xmm a, Xmm b) { vmulss(d, a, b); }); break;
    case Op::fdivs: singles(i, true, false, [this](Xmm d, Xmm a, Xmm b) { vdivss(d, a, b); }); break;
    case Op::fsqrts: singles(i, false, false, [this](Xmm d, Xmm, Xmm b) { vsqrtss(d, b, b); }); break;
    case Op::fstod: singles(i, false, true, [this](Xmm d, Xmm, Xmm b) { vcvtss2sd(d, b, b); }); break;
    case Op::fsmuld:
        singles(i, true, true, [this](Xmm d, Xmm a, Xmm b) {
            vcvtss2sd(xmm0, a, a);
            vcvtss2sd(d, b, b);
            vmulsd(d, xmm0, d);
        });
        break;
    case Op::fitod: {
        store_pair(i.rs2 / 2, false);
        const int d = free_float_slot();
        vxorpd(xmm0, xmm0, xmm0);
        vcvtsi2sd(float_register(d), xmm0, single_in_memory(i.rs2));
        set_pair(i.rd / 2, d, true);
        remember(exact);
        break;
    }
    case Op::fdtos: {
        const int b = float_slot(i.rs2 / 2), d = free_float_slot();
        Xbyak::Label &leave = leave_at_site();
        accept_double(b, leave);
        vcvtsd2ss(float_register(d), float_register(b), float_register(b));
        check_result(d, true, leave);
        store_pair(i.rd / 2, true);
        vmovd(single_in_memory(i.rd), float_register(d));
        remember(i.op, -1, b);
        break;
    }
    case Op::fstoi: to_integer(i, false); break;
    case Op::fdtoi: to_integer(i, true); break;
    case Op::fcmps:
    case Op::fcmpes: compare(i, false); break;
    default: compare(i, true); break;
    }
}

// ---- all

bool Emitter::translates(const Instruction &i)
{
    const Op op = i.op;
    if (op >= Op::ldf) {
        const bool doubles_in = op == Op::fsqrtd || op == Op::faddd || op == Op::fsubd || op == Op::fmuld ||
                                op == Op::fdivd || op == Op::fdtos || op == Op::fdtoi || op == Op::fcmpd ||
                                op == Op::fcmped;
        const bool double_out = op == Op::fsqrtd || op == Op::faddd || op == Op::fsubd || op == Op::fmuld ||
                                op == Op::fdivd || op == Op::fsmuld || op == Op::fitod || op == Op::fstod ||
                                op == Op::lddf || op == Op::stdf;
        return op != Op::ldfsr && op != Op::stfsr && op != Op::stdfq && op != Op::fitos &&
               op != Op::fpop_unimplemented && !(doubles_in && ((i.rs1 | i.rs2) & 1) != 0) &&
               !(double_out && (i.rd & 1) != 0);
    }
    return op == Op::call || op == Op::sethi || op == Op::bicc || op == Op::fbfcc ||
           (op >= Op::add && op <= Op::smulcc) || (op >= Op::sll && op <= Op::sra) || op == Op::rdy || op == Op::wry ||
           op == Op::jmpl || op == Op::flush || op == Op::save || op == Op::restore || (op >= Op::ld && op <= Op::ldsh);
}

void Emitter::instruction(const Instruction &i)
{
    const bool flags_stay = i.op == Op::sethi || i.op == Op::bicc || i.op == Op::fbfcc;
    const bool icc_live = regs_.icc_live, fcc_live = regs_.fcc_live;
    regs_.icc_live = icc_live && flags_stay;
    regs_.fcc_live = fcc_live && flags_stay;
    const auto plus = [this](const auto &d, const auto &b) { add(d, b); };
    const auto minus = [this](const auto &d, const auto &b) { sub(d, b); };
    const auto plus_carry = [this](const auto &d, const auto &b) { adc(d, b); };
    const auto minus_carry = [this](const auto &d, const auto &b) { sbb(d, b); };
    const auto conjunction = [this](const auto &d, const auto &b) { and_(d, b); };
    const auto disjunction = [this](const auto &d, const auto &b) { or_(d, b); };
    const auto exclusive = [this](const auto &d, const auto &b) { xor_(d, b); };
    if (!translates(i)) {
        always_leave();
        return;
    }
    if (sets_icc(i.op) || i.op == Op::save || i.op == Op::restore) {
        regs_.compared = {};
    }
    switch (i.op) {
    case Op::call:
        mov(target(15), here_.pc);
        changed(15);
        break;
    case Op::bicc:
    case Op::fbfcc:
    case Op::flush: break; // a branch that always or never holds: the trace goes on where it leads
    case Op::sethi:
        if (i.rd != 0) {
            mov(target(i.rd), static_cast<std::uint32_t>(i.imm));
            changed(i.rd);
        }
        break;
    case Op::add: binary(i, true, false, plus); break;
    case Op::sub: binary(i, false, false, minus); break;
    case Op::and_: binary(i, true, false, conjunction); break;
    case Op::or_:
        if (i.rs1 == 0) {
            move(i);
        } else {
            binary(i, true, false, disjunction);
        }
        break;
    case Op::xor_: binary(i, true, false, exclusive); break;
    case Op::addcc: binary(i, true, true, plus); break;
    case Op::subcc:
    case Op::andcc:
    case Op::orcc:
        if (i.rd == 0 && (i.op != Op::orcc || (!i.immediate && (i.rs1 == 0 || i.rs2 == 0)))) {
            compare_integers(i);
        } else if (i.op == Op::subcc) {
            binary(i, false, true, minus);
        } else if (i.op == Op::andcc) {
            binary(i, true, true, conjunction);
        } else {
            binary(i, true, true, disjunction);
        }
        break;
    case Op::xorcc: binary(i, true, true, exclusive); break;
    case Op::andn: binary(i, false, false, conjunction, true); break;
    case Op::orn: binary(i, false, false, disjunction, true); break;
    case Op::xnor: binary(i, false, false, exclusive, true); break;
    case Op::andncc: binary(i, false, true, conjunction, true); break;
    case Op::orncc: binary(i, false, true, disjunction, true); break;
    case Op::xnorcc: binary(i, false, true, exclusive, true); break;
    case Op::addx:
    case Op::addxcc:
    case Op::subx:
    case Op::subxcc:
        bt(dword[IN_CONTEXT(icc)], 8); // the carry
        if (i.op == Op::addx || i.op == Op::addxcc) {
            binary(i, true, i.op == Op::addxcc, plus_carry);
        } else {
            binary(i, false, i.op == Op::subxcc, minus_carry);
        }
        break;
    case Op::umul: multiply(i, false, false); break;
    case Op::smul: multiply(i, true, false); break;
    case Op::umulcc: multiply(i, false, true); break;
    case Op::smulcc: multiply(i, true, true); break;
    case Op::udiv: divide(i, false); break;
    case Op::sdiv: divide(i, true); break;
    case Op::sll: shift(i, [this](const auto &d, const auto &n) { shl(d, n); }); break;
    case Op::srl: shift(i, [this](const auto &d, const auto &n) { shr(d, n); }); break;
    case Op::sra: shift(i, [this](const auto &d, const auto &n) { sar(d, n); }); break;
    case Op::rdy:
        if (i.rd != 0) {
            mov(target(i.rd), dword[IN_STATE(y)]);
            changed(i.rd);
        }
        break;
    case Op::wry:
        mov(eax, operand(i.rs1, eax));
        if (i.immediate) {
            xor_(eax, static_cast<std::uint32_t>(i.imm));
        } else if (i.rs2 != 0) {
            xor_(eax, source(i.rs2));
        }
        mov(dword[IN_STATE(y)], eax);
        break;
    case Op::save: change_window(i, true); break;
    case Op::restore: change_window(i, false); break;
    case Op::ldub:
    case Op::ldsb: load(i, 1); break;
    case Op::lduh:
    case Op::ldsh: load(i, 2); break;
    case Op::ld:
    case Op::ldf: load(i, 4); break;
    case Op::ldd:
    case Op::lddf: load(i, 8); break;
    case Op::stb: store(i, 1); break;
    case Op::sth: store(i, 2); break;
    case Op::st:
    case Op::stf: store(i, 4); break;
    case Op::std_:
    case Op::stdf: store(i, 8); break;
    default: floating(i); break;
    }
}

} // namespace fledge::emulator
