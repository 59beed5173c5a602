// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/emitter_parts.h"

namespace fledge::emulator {

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

/// Whether it is an instruction of the integer unit, other than a load or store.
bool Emitter::integer(const Instruction &i)
{
    const auto plus = [this](const auto &d, const auto &b) { add(d, b); };
    const auto minus = [this](const auto &d, const auto &b) { sub(d, b); };
    const auto plus_carry = [this](const auto &d, const auto &b) { adc(d, b); };
    const auto minus_carry = [this](const auto &d, const auto &b) { sbb(d, b); };
    const auto conjunction = [this](const auto &d, const auto &b) { and_(d, b); };
    const auto disjunction = [this](const auto &d, const auto &b) { or_(d, b); };
    const auto exclusive = [this](const auto &d, const auto &b) { xor_(d, b); };
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
    default: return false;
    }
    return true;
}

} // namespace fledge::emulator
