// SPDX-License-Identifier: Apache-2.0
// The instructions of a SPARC V8 processor as the LEON3 has them, decoded: an operation and its fields.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace fledge::emulator {

/// All operations, in groups of one format. A name with a trailing underscore avoids a C++ keyword.
// clang-format off
#define FLEDGE_SPARC_OPERATIONS(X)                                                                       \
    /* No instruction, or one that this processor does not have */                                      \
    X(illegal)                                                                                           \
    /* Format 1 and 2: imm is the displacement in bytes, of sethi the value for rd */                    \
    X(call) X(sethi) X(bicc) X(fbfcc) X(cbccc)                                                           \
    /* Arithmetic: rd = rs1 op operand2 */                                                               \
    X(add) X(and_) X(or_) X(xor_) X(sub) X(andn) X(orn) X(xnor) X(addx) X(subx)                          \
    X(umul) X(smul) X(udiv) X(sdiv)                                                                      \
    X(addcc) X(andcc) X(orcc) X(xorcc) X(subcc) X(andncc) X(orncc) X(xnorcc) X(addxcc) X(subxcc)         \
    X(umulcc) X(smulcc) X(udivcc) X(sdivcc)                                                              \
    X(taddcc) X(tsubcc) X(taddcctv) X(tsubcctv) X(mulscc) X(sll) X(srl) X(sra)                           \
    /* State registers: rs1 is the number of the ASR that rdasr reads, rd of that which wrasr writes */   \
    X(rdy) X(rdasr) X(rdpsr) X(rdwim) X(rdtbr) X(wry) X(wrasr) X(wrpsr) X(wrwim) X(wrtbr)                \
    /* Control */                                                                                        \
    X(jmpl) X(rett) X(ticc) X(flush) X(save) X(restore)                                                  \
    /* Coprocessor: there is none */                                                                     \
    X(cpop)                                                                                              \
    /* Memory: address = rs1 + operand2 */                                                               \
    X(ld) X(ldub) X(lduh) X(ldd) X(st) X(stb) X(sth) X(std_) X(ldsb) X(ldsh) X(ldstub) X(swap)           \
    X(lda) X(lduba) X(lduha) X(ldda) X(sta) X(stba) X(stha) X(stda) X(ldsba) X(ldsha) X(ldstuba)         \
    X(swapa) X(casa)                                                                                     \
    X(ldf) X(ldfsr) X(lddf) X(stf) X(stfsr) X(stdfq) X(stdf)                                             \
    /* Floating point; those of quad precision and unknown ones are fpop_unimplemented */                \
    X(fmovs) X(fnegs) X(fabss) X(fsqrts) X(fsqrtd) X(fadds) X(faddd) X(fsubs) X(fsubd)                   \
    X(fmuls) X(fmuld) X(fdivs) X(fdivd) X(fsmuld) X(fitos) X(fdtos) X(fitod) X(fstod) X(fstoi) X(fdtoi)  \
    X(fcmps) X(fcmpd) X(fcmpes) X(fcmped) X(fpop_unimplemented)
// clang-format on

enum class Op : std::uint8_t {
#define FLEDGE_OPERATION(name) name,
    FLEDGE_SPARC_OPERATIONS(FLEDGE_OPERATION)
#undef FLEDGE_OPERATION
};

inline constexpr std::size_t op_count = static_cast<std::size_t>(Op::fpop_unimplemented) + 1;

/// "add", "ldub": for tables and messages.
std::string_view name_of(Op op);

struct Instruction {
    Op op = Op::illegal;
    std::uint8_t rd = 0, rs1 = 0, rs2 = 0;
    bool immediate = false;     ///< operand2 is imm, not r[rs2]
    bool annul = false;         ///< the bit a of branches
    std::uint8_t condition = 0; ///< of bicc, fbfcc and ticc
    std::uint8_t asi = 0;       ///< of alternate-space instructions; immediate makes those illegal
    std::int32_t imm = 0;       ///< simm13, or as said at the operation

    bool operator==(const Instruction &) const = default;
};

/// A pure function of all 2^32 words. Whether an instruction is legal may depend on the state too: executing it finds
/// out. An odd rd of ldd and std is illegal here; double registers have even numbers.
Instruction decode(std::uint32_t word);

/// Whether the instruction may set pc and npc to something else than the next words.
constexpr bool transfers_control(Op op)
{
    return op == Op::call || op == Op::bicc || op == Op::fbfcc || op == Op::jmpl || op == Op::rett || op == Op::ticc;
}

/// Whether a condition of bicc and ticc holds for the four bits NZVC.
constexpr bool condition_holds(std::uint32_t condition, std::uint32_t nzvc)
{
    const bool n = nzvc & 8, z = nzvc & 4, v = nzvc & 2, c = nzvc & 1;
    bool holds = false;
    switch (condition & 7) {
    case 0: holds = false; break;       // never
    case 1: holds = z; break;           // equal
    case 2: holds = z || n != v; break; // less or equal
    case 3: holds = n != v; break;      // less
    case 4: holds = c || z; break;      // less or equal, unsigned
    case 5: holds = c; break;           // carry set
    case 6: holds = n; break;           // negative
    case 7: holds = v; break;           // overflow
    }
    return holds != ((condition & 8) != 0);
}

/// Whether a condition of fbfcc holds for fcc: 0 equal, 1 less, 2 greater, 3 unordered.
constexpr bool fp_condition_holds(std::uint32_t condition, std::uint32_t fcc)
{
    // For each condition, the values of fcc for which it holds: bit 0 equal, 1 less, 2 greater, 3 unordered.
    constexpr std::array<std::uint8_t, 16> holds{0b0000, 0b1110, 0b0110, 0b1010, 0b0010, 0b1100, 0b0100, 0b1000,
                                                 0b1111, 0b0001, 0b1001, 0b0101, 0b1101, 0b0011, 0b1011, 0b0111};
    return (holds[condition & 15] >> (fcc & 3)) & 1;
}

} // namespace fledge::emulator
