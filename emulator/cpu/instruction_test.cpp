// SPDX-License-Identifier: Apache-2.0
#include "emulator/cpu/instruction.h"

#include <set>

#include <gtest/gtest.h>

#include "emulator/cpu/timing.h"

namespace instruction_test {

using namespace fledge::emulator;

/// Words as the GNU assembler makes them from the text behind them.
struct Row {
    std::uint32_t word;
    Op op;
};
// clang-format off
constexpr Row assembled[] = {
    {0x40000010, Op::call}, // call .+64
    {0x23048D15, Op::sethi}, // sethi %hi(0x12345400), %l1
    {0x00000005, Op::illegal}, // unimp 5
    {0x32BFFFFE, Op::bicc}, // bne,a .-8
    {0x10800400, Op::bicc}, // ba .+0x1000
    {0x07800004, Op::fbfcc}, // fbul .+16
    {0x13C00002, Op::cbccc}, // cb0 .+8
    {0x86004002, Op::add}, // add %g1,%g2,%g3
    {0xBE0A7000, Op::and_}, // and %o1,-4096,%i7
    {0xA0102FFF, Op::or_}, // or %g0,4095,%l0
    {0xA61C4012, Op::xor_}, // xor %l1,%l2,%l3
    {0x86204002, Op::sub}, // sub %g1,%g2,%g3
    {0x86284002, Op::andn}, // andn %g1,%g2,%g3
    {0x86304002, Op::orn}, // orn %g1,%g2,%g3
    {0x86384002, Op::xnor}, // xnor %g1,%g2,%g3
    {0x86404002, Op::addx}, // addx %g1,%g2,%g3
    {0x86604002, Op::subx}, // subx %g1,%g2,%g3
    {0x86504002, Op::umul}, // umul %g1,%g2,%g3
    {0x86584002, Op::smul}, // smul %g1,%g2,%g3
    {0x86704002, Op::udiv}, // udiv %g1,%g2,%g3
    {0x86784002, Op::sdiv}, // sdiv %g1,%g2,%g3
    {0x86804002, Op::addcc}, // addcc %g1,%g2,%g3
    {0x86884002, Op::andcc}, // andcc %g1,%g2,%g3
    {0x86904002, Op::orcc}, // orcc %g1,%g2,%g3
    {0x86984002, Op::xorcc}, // xorcc %g1,%g2,%g3
    {0x86A04002, Op::subcc}, // subcc %g1,%g2,%g3
    {0x86A84002, Op::andncc}, // andncc %g1,%g2,%g3
    {0x86B04002, Op::orncc}, // orncc %g1,%g2,%g3
    {0x86B84002, Op::xnorcc}, // xnorcc %g1,%g2,%g3
    {0x86C04002, Op::addxcc}, // addxcc %g1,%g2,%g3
    {0x86E04002, Op::subxcc}, // subxcc %g1,%g2,%g3
    {0x86D04002, Op::umulcc}, // umulcc %g1,%g2,%g3
    {0x86D84002, Op::smulcc}, // smulcc %g1,%g2,%g3
    {0x86F04002, Op::udivcc}, // udivcc %g1,%g2,%g3
    {0x86F84002, Op::sdivcc}, // sdivcc %g1,%g2,%g3
    {0x87004002, Op::taddcc}, // taddcc %g1,%g2,%g3
    {0x87084002, Op::tsubcc}, // tsubcc %g1,%g2,%g3
    {0x87104002, Op::taddcctv}, // taddcctv %g1,%g2,%g3
    {0x87184002, Op::tsubcctv}, // tsubcctv %g1,%g2,%g3
    {0x87204002, Op::mulscc}, // mulscc %g1,%g2,%g3
    {0x8728601F, Op::sll}, // sll %g1,31,%g3
    {0x87304002, Op::srl}, // srl %g1,%g2,%g3
    {0x87384002, Op::sra}, // sra %g1,%g2,%g3
    {0x87400000, Op::rdy}, // rd %y,%g3
    {0x87444000, Op::rdasr}, // rd %asr17,%g3
    {0x87480000, Op::rdpsr}, // rd %psr,%g3
    {0x87500000, Op::rdwim}, // rd %wim,%g3
    {0x87580000, Op::rdtbr}, // rd %tbr,%g3
    {0x81806007, Op::wry}, // wr %g1,7,%y
    {0xA7800000, Op::wrasr}, // wr %g0,%asr19
    {0x81884002, Op::wrpsr}, // wr %g1,%g2,%psr
    {0x81900001, Op::wrwim}, // wr %g1,%wim
    {0x81980001, Op::wrtbr}, // wr %g1,%tbr
    {0x81C3E008, Op::jmpl}, // jmpl %o7+8,%g0
    {0x81CC8000, Op::rett}, // rett %l2
    {0x93D06005, Op::ticc}, // tne %g1+5
    {0x81D86008, Op::flush}, // flush %g1+8
    {0x9DE3BFA0, Op::save}, // save %sp,-96,%sp
    {0x91E84002, Op::restore}, // restore %g1,%g2,%o0
    {0xC6004002, Op::ld}, // ld [%g1+%g2],%g3
    {0xC6087FFF, Op::ldub}, // ldub [%g1-1],%g3
    {0xC6104000, Op::lduh}, // lduh [%g1],%g3
    {0xC4184000, Op::ldd}, // ldd [%g1],%g2
    {0xC6204000, Op::st}, // st %g3,[%g1]
    {0xC6284000, Op::stb}, // stb %g3,[%g1]
    {0xC6304000, Op::sth}, // sth %g3,[%g1]
    {0xC4384000, Op::std_}, // std %g2,[%g1]
    {0xC6484000, Op::ldsb}, // ldsb [%g1],%g3
    {0xC6504000, Op::ldsh}, // ldsh [%g1],%g3
    {0xC6684000, Op::ldstub}, // ldstub [%g1],%g3
    {0xC6784000, Op::swap}, // swap [%g1],%g3
    {0xC6804140, Op::lda}, // lda [%g1]0xa,%g3
    {0xC6884100, Op::lduba}, // lduba [%g1]8,%g3
    {0xC6904120, Op::lduha}, // lduha [%g1]9,%g3
    {0xC4984160, Op::ldda}, // ldda [%g1]0xb,%g2
    {0xC6A04042, Op::sta}, // sta %g3,[%g1+%g2]2
    {0xC6A84020, Op::stba}, // stba %g3,[%g1]1
    {0xC6B04380, Op::stha}, // stha %g3,[%g1]0x1c
    {0xC4B84140, Op::stda}, // stda %g2,[%g1]0xa
    {0xC6C84140, Op::ldsba}, // ldsba [%g1]0xa,%g3
    {0xC6D04140, Op::ldsha}, // ldsha [%g1]0xa,%g3
    {0xC6E84140, Op::ldstuba}, // ldstuba [%g1]0xa,%g3
    {0xC6F84140, Op::swapa}, // swapa [%g1]0xa,%g3
    {0xC7E04142, Op::casa}, // casa [%g1]0xa,%g2,%g3
    {0xC7004000, Op::ldf}, // ld [%g1],%f3
    {0xC1084000, Op::ldfsr}, // ld [%g1],%fsr
    {0xC5184000, Op::lddf}, // ldd [%g1],%f2
    {0xC7204000, Op::stf}, // st %f3,[%g1]
    {0xC1284000, Op::stfsr}, // st %fsr,[%g1]
    {0xC1304000, Op::stdfq}, // std %fq,[%g1]
    {0xFD384000, Op::stdf}, // std %f30,[%g1]
    {0x85A00021, Op::fmovs}, // fmovs %f1,%f2
    {0x85A000A1, Op::fnegs}, // fnegs %f1,%f2
    {0x85A00121, Op::fabss}, // fabss %f1,%f2
    {0x85A00521, Op::fsqrts}, // fsqrts %f1,%f2
    {0x89A00542, Op::fsqrtd}, // fsqrtd %f2,%f4
    {0x87A04822, Op::fadds}, // fadds %f1,%f2,%f3
    {0x8DA08844, Op::faddd}, // faddd %f2,%f4,%f6
    {0x87A048A2, Op::fsubs}, // fsubs %f1,%f2,%f3
    {0x8DA088C4, Op::fsubd}, // fsubd %f2,%f4,%f6
    {0x87A04922, Op::fmuls}, // fmuls %f1,%f2,%f3
    {0x8DA08944, Op::fmuld}, // fmuld %f2,%f4,%f6
    {0x87A049A2, Op::fdivs}, // fdivs %f1,%f2,%f3
    {0x8DA089C4, Op::fdivd}, // fdivd %f2,%f4,%f6
    {0x89A04D22, Op::fsmuld}, // fsmuld %f1,%f2,%f4
    {0x85A01881, Op::fitos}, // fitos %f1,%f2
    {0x83A018C2, Op::fdtos}, // fdtos %f2,%f1
    {0x85A01901, Op::fitod}, // fitod %f1,%f2
    {0x85A01921, Op::fstod}, // fstod %f1,%f2
    {0x85A01A21, Op::fstoi}, // fstoi %f1,%f2
    {0x83A01A42, Op::fdtoi}, // fdtoi %f2,%f1
    {0x81A84A22, Op::fcmps}, // fcmps %f1,%f2
    {0x81A88A44, Op::fcmpd}, // fcmpd %f2,%f4
    {0x81A84AA2, Op::fcmpes}, // fcmpes %f1,%f2
    {0x81A88AC4, Op::fcmped}, // fcmped %f2,%f4
    {0x91A00864, Op::fpop_unimplemented}, // faddq %f0,%f4,%f8
};
// clang-format on

TEST(Decode, EachInstructionOfTheAssemblerIsRecognised)
{
    std::set<Op> seen;
    for (const auto &[word, op] : assembled) {
        EXPECT_EQ(name_of(decode(word).op), name_of(op)) << std::hex << word;
        seen.insert(op);
    }
    seen.insert(Op::cpop); // the assembler has no text for it
    EXPECT_EQ(seen.size(), op_count) << "an operation without a row";
}

TEST(Decode, FieldsAreThoseOfTheFormats)
{
    const auto is = [](std::uint32_t word, const Instruction &expected) { EXPECT_TRUE(decode(word) == expected); };
    is(0x86004002, {.op = Op::add, .rd = 3, .rs1 = 1, .rs2 = 2});
    is(0xBE0A7000, {.op = Op::and_, .rd = 31, .rs1 = 9, .immediate = true, .imm = -4096});
    is(0xA0102FFF, {.op = Op::or_, .rd = 16, .immediate = true, .imm = 4095});
    is(0x7FFFFFFF, {.op = Op::call, .rd = 15, .imm = -4});
    is(0x23048D15, {.op = Op::sethi, .rd = 17, .imm = 0x12345400});
    is(0x32BFFFFE, {.op = Op::bicc, .annul = true, .condition = 9, .imm = -8});
    is(0x30BFFFFF, {.op = Op::bicc, .annul = true, .condition = 8, .imm = -4});
    is(0x93D06005, {.op = Op::ticc, .rs1 = 1, .immediate = true, .condition = 9, .imm = 5});
    is(0xC6804142, {.op = Op::lda, .rd = 3, .rs1 = 1, .rs2 = 2, .asi = 10});
    is(0x8DA08844, {.op = Op::faddd, .rd = 6, .rs1 = 2, .rs2 = 4});
}

TEST(Decode, WordsThatAreNoInstructionAreIllegal)
{
    for (std::uint32_t word : {0x00000000u, 0x00400000u, 0x00C00000u, 0x01400000u, 0x80480000u, 0x80680000u,
                               0xC0400000u, 0xC6184000u /* ldd into %g3 */, 0xC6384000u /* std of %g3 */}) {
        EXPECT_EQ(decode(word).op, Op::illegal) << std::hex << word;
    }
}

TEST(Decode, EachWordDecodesToFieldsInTheirRange)
{
    std::uint32_t word = 1;
    for (int k = 0; k < 300'000; k++) {
        word = word * 1664525 + 1013904223;
        const Instruction i = decode(word ^ word >> 16);
        ASSERT_LT(static_cast<std::size_t>(i.op), op_count);
        ASSERT_LT(i.rd, 32);
        ASSERT_LT(i.rs1, 32);
        ASSERT_LT(i.rs2, 32);
        ASSERT_LT(i.condition, 16);
        if (i.op != Op::call && i.op != Op::sethi && i.op != Op::bicc && i.op != Op::fbfcc && i.op != Op::cbccc) {
            ASSERT_GE(i.imm, -4096);
            ASSERT_LE(i.imm, 4095);
        }
    }
}

TEST(Decode, EachConditionIsTheOppositeOfItsOther)
{
    for (std::uint32_t condition = 0; condition < 8; condition++) {
        for (std::uint32_t nzvc = 0; nzvc < 16; nzvc++) {
            EXPECT_NE(condition_holds(condition, nzvc), condition_holds(condition + 8, nzvc));
        }
    }
    // The floating-point conditions by their names: u g ug l ul lg ne never, always e ue ge uge le ule o.
    const char *const names[] = {"",     "LGU", "LG", "UL", "L",   "UG", "G",   "U",
                                 "ELGU", "E",   "UE", "GE", "UGE", "LE", "ULE", "ELG"};
    for (std::uint32_t condition = 0; condition < 16; condition++) {
        for (std::uint32_t fcc = 0; fcc < 4; fcc++) {
            const bool named = std::string_view(names[condition]).find("ELGU"[fcc]) != std::string_view::npos;
            EXPECT_EQ(fp_condition_holds(condition, fcc), named) << condition << ' ' << fcc;
        }
    }
}

TEST(Timing, EachStepCostsAtLeastACycle)
{
    for (const Timing &timing : {plain_timing(), leon3_timing()}) {
        for (std::uint8_t cycles : timing.cycles) {
            EXPECT_GE(cycles, 1);
        }
        EXPECT_GE(timing.trap, 1);
    }
    EXPECT_EQ(leon3_timing()[Op::udiv], 35);
    EXPECT_EQ(leon3_timing()[Op::fsqrtd], 25);
    EXPECT_EQ(leon3_timing()[Op::add], 1);
}

} // namespace instruction_test
