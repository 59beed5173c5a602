// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/emitter_parts.h"

#include <bit>
#include <cstring>

namespace fledge::emulator {

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

// ---- all instructions

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
    if (!translates(i)) {
        always_leave();
        return;
    }
    if (sets_icc(i.op) || i.op == Op::save || i.op == Op::restore) {
        regs_.compared = {};
    }
    if (integer(i)) {
        return;
    }
    switch (i.op) {
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
