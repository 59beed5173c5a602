// SPDX-License-Identifier: Apache-2.0
#include "emulator/translator/emitter_parts.h"

namespace fledge::emulator {

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

} // namespace fledge::emulator
