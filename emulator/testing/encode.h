// SPDX-License-Identifier: Apache-2.0
// Words of SPARC instructions for tests, built from the formats of the manual, without the decoder.
#pragma once

#include <cstdint>

namespace fledge::emulator::testing {

// Numbers of registers: g(1) is %g1.
constexpr std::uint32_t g(std::uint32_t n)
{
    return n;
}
constexpr std::uint32_t o(std::uint32_t n)
{
    return 8 + n;
}
constexpr std::uint32_t l(std::uint32_t n)
{
    return 16 + n;
}
constexpr std::uint32_t i(std::uint32_t n)
{
    return 24 + n;
}

/// Format 3 with a register as the second operand, and with a signed number of 13 bits. `op` is 2 for arithmetic, 3 for
/// memory.
constexpr std::uint32_t with_register(std::uint32_t op, std::uint32_t op3, std::uint32_t rd, std::uint32_t rs1,
                                      std::uint32_t rs2, std::uint32_t asi = 0)
{
    return op << 30 | rd << 25 | op3 << 19 | rs1 << 14 | asi << 5 | rs2;
}
constexpr std::uint32_t with_number(std::uint32_t op, std::uint32_t op3, std::uint32_t rd, std::uint32_t rs1,
                                    std::int32_t number)
{
    return op << 30 | rd << 25 | op3 << 19 | rs1 << 14 | 1u << 13 | (static_cast<std::uint32_t>(number) & 0x1FFF);
}

/// Floating-point operations: op3 is 0x34, of compares 0x35.
constexpr std::uint32_t fpop(std::uint32_t op3, std::uint32_t opf, std::uint32_t rd, std::uint32_t rs1,
                             std::uint32_t rs2)
{
    return 2u << 30 | rd << 25 | op3 << 19 | rs1 << 14 | opf << 5 | rs2;
}

/// Branches to `words` instructions from here: op2 is 2 for bicc, 6 for fbfcc; condition 8 is always, 0 never.
constexpr std::uint32_t branch(std::uint32_t op2, std::uint32_t condition, bool annul, std::int32_t words)
{
    return (annul ? 1u << 29 : 0) | condition << 25 | op2 << 22 | (static_cast<std::uint32_t>(words) & 0x3FFFFF);
}
constexpr std::uint32_t ba(std::int32_t words, bool annul = false)
{
    return branch(2, 8, annul, words);
}

constexpr std::uint32_t call(std::int32_t words)
{
    return 1u << 30 | (static_cast<std::uint32_t>(words) & 0x3FFFFFFF);
}

/// The upper 22 bits of a value.
constexpr std::uint32_t sethi(std::uint32_t rd, std::uint32_t value)
{
    return rd << 25 | 4u << 22 | value >> 10;
}

constexpr std::uint32_t nop = sethi(0, 0);

// The few that programs of tests are made of; the numbers are op3.
constexpr std::uint32_t add(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x00, rd, rs1, number);
}
constexpr std::uint32_t subcc(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x14, rd, rs1, number);
}
constexpr std::uint32_t or_(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x02, rd, rs1, number);
}
constexpr std::uint32_t mov(std::uint32_t rd, std::int32_t number)
{
    return or_(rd, 0, number);
}
constexpr std::uint32_t jmpl(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x38, rd, rs1, number);
}
constexpr std::uint32_t rett(std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x39, 0, rs1, number);
}
constexpr std::uint32_t trap_always(std::int32_t number)
{
    return with_number(2, 0x3A, 8, 0, number);
}
constexpr std::uint32_t save(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x3C, rd, rs1, number);
}
constexpr std::uint32_t restore(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(2, 0x3D, rd, rs1, number);
}
constexpr std::uint32_t ld(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(3, 0x00, rd, rs1, number);
}
constexpr std::uint32_t st(std::uint32_t rd, std::uint32_t rs1, std::int32_t number)
{
    return with_number(3, 0x04, rd, rs1, number);
}

} // namespace fledge::emulator::testing
