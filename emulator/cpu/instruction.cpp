// SPDX-License-Identifier: Apache-2.0
#include "emulator/cpu/instruction.h"

namespace fledge::emulator {

namespace {

using Table = std::array<Op, 64>; // by op3; Op::illegal where nothing else stands

constexpr Table table_of(std::initializer_list<std::pair<unsigned, Op>> entries)
{
    Table table{};
    for (const auto &[op3, op] : entries) {
        table[op3] = op;
    }
    return table;
}

// op = 2. The floating-point operations, rdasr and wrasr have a further field.
constexpr Table arithmetic = table_of({
    {0x00, Op::add},      {0x01, Op::and_},     {0x02, Op::or_},    {0x03, Op::xor_},   {0x04, Op::sub},
    {0x05, Op::andn},     {0x06, Op::orn},      {0x07, Op::xnor},   {0x08, Op::addx},   {0x0A, Op::umul},
    {0x0B, Op::smul},     {0x0C, Op::subx},     {0x0E, Op::udiv},   {0x0F, Op::sdiv},   {0x10, Op::addcc},
    {0x11, Op::andcc},    {0x12, Op::orcc},     {0x13, Op::xorcc},  {0x14, Op::subcc},  {0x15, Op::andncc},
    {0x16, Op::orncc},    {0x17, Op::xnorcc},   {0x18, Op::addxcc}, {0x1A, Op::umulcc}, {0x1B, Op::smulcc},
    {0x1C, Op::subxcc},   {0x1E, Op::udivcc},   {0x1F, Op::sdivcc}, {0x20, Op::taddcc}, {0x21, Op::tsubcc},
    {0x22, Op::taddcctv}, {0x23, Op::tsubcctv}, {0x24, Op::mulscc}, {0x25, Op::sll},    {0x26, Op::srl},
    {0x27, Op::sra},      {0x28, Op::rdasr},    {0x29, Op::rdpsr},  {0x2A, Op::rdwim},  {0x2B, Op::rdtbr},
    {0x30, Op::wrasr},    {0x31, Op::wrpsr},    {0x32, Op::wrwim},  {0x33, Op::wrtbr},  {0x36, Op::cpop},
    {0x37, Op::cpop},     {0x38, Op::jmpl},     {0x39, Op::rett},   {0x3A, Op::ticc},   {0x3B, Op::flush},
    {0x3C, Op::save},     {0x3D, Op::restore},
});

// op = 3
constexpr Table memory = table_of({
    {0x00, Op::ld},   {0x01, Op::ldub},  {0x02, Op::lduh},  {0x03, Op::ldd},   {0x04, Op::st},      {0x05, Op::stb},
    {0x06, Op::sth},  {0x07, Op::std_},  {0x09, Op::ldsb},  {0x0A, Op::ldsh},  {0x0D, Op::ldstub},  {0x0F, Op::swap},
    {0x10, Op::lda},  {0x11, Op::lduba}, {0x12, Op::lduha}, {0x13, Op::ldda},  {0x14, Op::sta},     {0x15, Op::stba},
    {0x16, Op::stha}, {0x17, Op::stda},  {0x19, Op::ldsba}, {0x1A, Op::ldsha}, {0x1D, Op::ldstuba}, {0x1F, Op::swapa},
    {0x20, Op::ldf},  {0x21, Op::ldfsr}, {0x23, Op::lddf},  {0x24, Op::stf},   {0x25, Op::stfsr},   {0x26, Op::stdfq},
    {0x27, Op::stdf}, {0x30, Op::cpop},  {0x31, Op::cpop},  {0x33, Op::cpop},  {0x34, Op::cpop},    {0x35, Op::cpop},
    {0x36, Op::cpop}, {0x37, Op::cpop},  {0x3C, Op::casa},
});

Op fpop1(std::uint32_t opf)
{
    switch (opf) {
    case 0x01: return Op::fmovs;
    case 0x05: return Op::fnegs;
    case 0x09: return Op::fabss;
    case 0x29: return Op::fsqrts;
    case 0x2A: return Op::fsqrtd;
    case 0x41: return Op::fadds;
    case 0x42: return Op::faddd;
    case 0x45: return Op::fsubs;
    case 0x46: return Op::fsubd;
    case 0x49: return Op::fmuls;
    case 0x4A: return Op::fmuld;
    case 0x4D: return Op::fdivs;
    case 0x4E: return Op::fdivd;
    case 0x69: return Op::fsmuld;
    case 0xC4: return Op::fitos;
    case 0xC6: return Op::fdtos;
    case 0xC8: return Op::fitod;
    case 0xC9: return Op::fstod;
    case 0xD1: return Op::fstoi;
    case 0xD2: return Op::fdtoi;
    default: return Op::fpop_unimplemented;
    }
}

Op fpop2(std::uint32_t opf)
{
    switch (opf) {
    case 0x51: return Op::fcmps;
    case 0x52: return Op::fcmpd;
    case 0x55: return Op::fcmpes;
    case 0x56: return Op::fcmped;
    default: return Op::fpop_unimplemented;
    }
}

/// The signed number in the low bits of a word.
constexpr std::int32_t signed_bits(std::uint32_t word, unsigned bits)
{
    return static_cast<std::int32_t>(word << (32 - bits)) >> (32 - bits);
}

} // namespace

Instruction decode(std::uint32_t word)
{
    Instruction i;
    i.rd = (word >> 25) & 31;
    i.rs1 = (word >> 14) & 31;
    i.rs2 = word & 31;
    const std::uint32_t op3 = (word >> 19) & 63;
    switch (word >> 30) {
    case 0:
        i.rs1 = i.rs2 = 0;
        switch ((word >> 22) & 7) {
        case 2: i.op = Op::bicc; break;
        case 4: i.op = Op::sethi; break;
        case 6: i.op = Op::fbfcc; break;
        case 7: i.op = Op::cbccc; break;
        default: return {};
        }
        if (i.op == Op::sethi) {
            i.imm = static_cast<std::int32_t>(word << 10);
        } else {
            i.annul = (i.rd & 16) != 0;
            i.condition = i.rd & 15;
            i.rd = 0;
            i.imm = signed_bits(word, 22) * 4;
        }
        return i;
    case 1: i = {.op = Op::call, .rd = 15, .imm = static_cast<std::int32_t>(word << 2)}; return i;
    case 2:
        if (op3 == 0x34 || op3 == 0x35) {
            i.op = op3 == 0x34 ? fpop1((word >> 5) & 511) : fpop2((word >> 5) & 511);
            return i;
        }
        i.op = arithmetic[op3];
        if (i.op == Op::rdasr && i.rs1 == 0) {
            i.op = Op::rdy;
        } else if (i.op == Op::wrasr && i.rd == 0) {
            i.op = Op::wry;
        } else if (i.op == Op::ticc) {
            i.condition = i.rd & 15;
            i.rd = 0;
        }
        break;
    default:
        i.op = memory[op3];
        i.asi = (word >> 5) & 255;
        if ((i.op == Op::ldd || i.op == Op::std_) && (i.rd & 1) != 0) {
            i.op = Op::illegal;
        }
        break;
    }
    i.immediate = (word & (1u << 13)) != 0;
    if (i.immediate) {
        i.rs2 = 0;
        i.imm = signed_bits(word, 13);
    }
    return i;
}

std::string_view name_of(Op op)
{
    static constexpr std::array<std::string_view, op_count> names{
#define FLEDGE_OPERATION(name) #name,
        FLEDGE_SPARC_OPERATIONS(FLEDGE_OPERATION)
#undef FLEDGE_OPERATION
    };
    std::string_view name = names[static_cast<std::size_t>(op)];
    return name.ends_with('_') ? name.substr(0, name.size() - 1) : name;
}

} // namespace fledge::emulator
