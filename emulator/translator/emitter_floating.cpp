// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/emitter_parts.h"

namespace fledge::emulator {

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

} // namespace fledge::emulator
