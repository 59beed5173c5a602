// SPDX-License-Identifier: Apache-2.0
// Floating point with every engine of this folder: rounding and exceptions against MPFR, and what SPARC and the GRFPU
// decide by themselves.
#include <bit>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <mpfr.h>

#include "emulator/cpu/step.h"
#include "emulator/testing/encode.h"
#include "emulator/testing/small_computer.h"

namespace fpu_test {

using namespace fledge::emulator;
using namespace fledge::emulator::testing;

using Make = std::unique_ptr<Engine> (*)();

constexpr std::uint32_t nv = fsr::invalid, of = fsr::overflow, uf = fsr::underflow, dz = fsr::division_by_zero,
                        nx = fsr::inexact;

std::uint64_t bits(double x)
{
    return std::bit_cast<std::uint64_t>(x);
}
std::uint32_t bits(float x)
{
    return std::bit_cast<std::uint32_t>(x);
}

class Fpu : public ::testing::TestWithParam<Make> {
protected:
    SmallComputer c{GetParam()()};

    Fpu()
    {
        c.r(g(1)) = SmallComputer::data;
        c.write(ram_base + 16 * trap::fp_exception, {nop});
        c.core.fpu = FpuPersonality::qemu;
    }

    /// One operation: rs1 is %f0, rs2 %f2, rd %f4 (singles in the even registers). Returns the trap, or 0.
    std::uint32_t run(std::uint32_t opf, std::uint64_t a, std::uint64_t b, bool compare = false)
    {
        c.s.floats[0] = a;
        c.s.floats[1] = b;
        c.s.floats[2] = untouched;
        c.s.fp_queue = {};
        c.write(SmallComputer::start, {fpop(compare ? 0x35 : 0x34, opf, 4, 0, 2), with_number(3, 0x25, 0, g(1), 0)});
        c.engine->invalidate(SmallComputer::start, 8);
        c.go(SmallComputer::start);
        const std::uint64_t traps = c.s.traps;
        c.steps(2); // both in one burst, so that a program sees the exceptions, too
        if (c.s.traps != traps) {
            c.s.psr |= psr::enable_traps;
            c.s.psr = (c.s.psr & ~psr::cwp) | 4;
            c.s.mode = Mode::running;
            return c.s.trap_type;
        }
        EXPECT_EQ(c.bus.load(SmallComputer::data) & ~(7u << fsr::version_shift), c.s.fsr);
        return 0;
    }
    static std::uint64_t upper(std::uint32_t single) { return std::uint64_t{single} << 32; }
    std::uint32_t cexc() const { return c.core.state.fsr & 31; }
    std::uint32_t aexc() const { return c.core.state.fsr >> 5 & 31; }
    std::uint32_t fcc() const { return c.core.state.fsr >> 10 & 3; }
    std::uint32_t ftt() const { return c.core.state.fsr & fsr::ftt; }
    std::uint64_t result() const { return c.core.state.floats[2]; }
    std::uint32_t single_result() const { return static_cast<std::uint32_t>(result() >> 32); }
    static constexpr std::uint64_t untouched = 0x0123456789ABCDEF;
};

/// What IEEE 754 says of a computation in a format: MPFR computes with more digits and rounds.
class Expected {
public:
    Expected(bool is_double, int mode)
        : digits_(is_double ? 53 : 24), lowest_(is_double ? -1021 : -125), highest_(is_double ? 1024 : 128),
          rounding_(mode == 0   ? MPFR_RNDN
                    : mode == 1 ? MPFR_RNDZ
                    : mode == 2 ? MPFR_RNDU
                                : MPFR_RNDD)
    {
        mpfr_init2(result_, digits_);
        mpfr_init2(a_, 53);
        mpfr_init2(b_, 53);
    }
    ~Expected()
    {
        for (mpfr_ptr x : {result_, a_, b_}) {
            mpfr_clear(x);
        }
    }

    double value = 0;
    std::uint32_t exceptions = 0;

    template <class Operation> void compute(double a, double b, Operation operation)
    {
        mpfr_set_emin(mpfr_get_emin_min());
        mpfr_set_emax(mpfr_get_emax_max());
        mpfr_set_d(a_, a, MPFR_RNDN);
        mpfr_set_d(b_, b, MPFR_RNDN);
        mpfr_clear_flags();
        int ternary = operation(result_, a_, b_, rounding_);
        exceptions = (mpfr_nanflag_p() != 0 ? nv : 0) | (mpfr_divby0_p() != 0 ? dz : 0);
        const bool tiny = mpfr_regular_p(result_) != 0 && mpfr_get_exp(result_) < lowest_;
        // Now in the range of the format.
        mpfr_set_emin(lowest_ - digits_ + 1);
        mpfr_set_emax(highest_);
        mpfr_clear_flags();
        ternary = mpfr_check_range(result_, ternary, rounding_);
        ternary = mpfr_subnormalize(result_, ternary, rounding_);
        value = mpfr_get_d(result_, MPFR_RNDN);
        exceptions |=
            (mpfr_overflow_p() != 0 ? of | nx : 0) | (ternary != 0 ? nx : 0) | (tiny && ternary != 0 ? uf : 0);
    }

private:
    mpfr_prec_t digits_;
    mpfr_exp_t lowest_, highest_;
    mpfr_rnd_t rounding_;
    mpfr_t result_, a_, b_;
};

const double doubles[] = {0.0,
                          -0.0,
                          1.0,
                          -1.5,
                          0x1p-1074,
                          -0x1p-1074,
                          0x1.FFFFFFFFFFFFFp-1023,
                          0x1p-1022,
                          -0x1.0000000000001p-1022,
                          0x1.FFFFFFFFFFFFFp+1023,
                          -0x1.FFFFFFFFFFFFFp+1023,
                          HUGE_VAL,
                          -HUGE_VAL,
                          0x1.0000000000001p0,
                          0x1.FFFFFFFFFFFFFp-1,
                          3.0,
                          0x1p-537,
                          0x1.23456789ABCDEp-511,
                          0x1p-150,
                          0x1.FFFFFEp127,
                          0x1.FFFFFFp127,
                          0x1.FFFFFDp-127,
                          0x1.FFFFFFp-127,
                          0x1.8p-149,
                          1e10,
                          -7.25};

double random_double(std::mt19937_64 &random)
{
    const std::uint64_t word = random();
    switch (word % 4) {
    case 0: return doubles[word / 4 % std::size(doubles)];
    case 1: return std::bit_cast<double>((random() & 0x800FFFFFFFFFFFFF) | (0x3FA + word / 4 % 10) << 52);
    case 2: return std::bit_cast<double>((random() & 0x800FFFFFFFFFFFFF) | (1 + word / 4 % 60) << 52);
    default: {
        const double x = std::bit_cast<double>(random());
        return std::isnan(x) ? 1.0 : x;
    }
    }
}

TEST_P(Fpu, EachOperationRoundsAsIeee754InEachMode)
{
    using Operation = int (*)(mpfr_t, mpfr_t, mpfr_t, mpfr_rnd_t);
    struct Kind {
        std::uint32_t opf;
        bool from_double, to_double;
        Operation operation;
    };
    const auto add = [](mpfr_t r, mpfr_t a, mpfr_t b, mpfr_rnd_t m) { return mpfr_add(r, a, b, m); };
    const auto subtract = [](mpfr_t r, mpfr_t a, mpfr_t b, mpfr_rnd_t m) { return mpfr_sub(r, a, b, m); };
    const auto multiply = [](mpfr_t r, mpfr_t a, mpfr_t b, mpfr_rnd_t m) { return mpfr_mul(r, a, b, m); };
    const auto divide = [](mpfr_t r, mpfr_t a, mpfr_t b, mpfr_rnd_t m) { return mpfr_div(r, a, b, m); };
    const auto root = [](mpfr_t r, mpfr_t, mpfr_t b, mpfr_rnd_t m) { return mpfr_sqrt(r, b, m); };
    const auto convert = [](mpfr_t r, mpfr_t, mpfr_t b, mpfr_rnd_t m) { return mpfr_set(r, b, m); };
    const Kind kinds[] = {{0x41, false, false, add},    {0x42, true, true, add},        {0x45, false, false, subtract},
                          {0x46, true, true, subtract}, {0x49, false, false, multiply}, {0x4A, true, true, multiply},
                          {0x4D, false, false, divide}, {0x4E, true, true, divide},     {0x69, false, true, multiply},
                          {0x29, false, false, root},   {0x2A, true, true, root},       {0xC6, true, false, convert},
                          {0xC9, false, true, convert}};
    std::mt19937_64 random(20);
    for (const Kind &kind : kinds) {
        for (int k = 0; k < 3000; k++) {
            double a = random_double(random), b = random_double(random);
            if (!kind.from_double) {
                a = static_cast<float>(a);
                b = static_cast<float>(b);
            }
            const int mode = k % 4;
            Expected expected(kind.to_double, mode);
            expected.compute(a, b, kind.operation);
            c.s.fsr = static_cast<std::uint32_t>(mode) << 30;
            const std::uint64_t bits_a = kind.from_double ? bits(a) : upper(bits(static_cast<float>(a)));
            const std::uint64_t bits_b = kind.from_double ? bits(b) : upper(bits(static_cast<float>(b)));
            ASSERT_EQ(run(kind.opf, bits_a, bits_b), 0u);
            if ((expected.exceptions & nv) != 0) {
                ASSERT_EQ(kind.to_double ? result() : single_result(), kind.to_double ? ~0ull >> 1 : ~0u >> 1);
            } else if (kind.to_double) {
                ASSERT_EQ(result(), bits(expected.value)) << std::hexfloat << kind.opf << ' ' << a << ' ' << b;
            } else {
                ASSERT_EQ(single_result(), bits(static_cast<float>(expected.value)))
                    << std::hexfloat << kind.opf << ' ' << a << ' ' << b;
                ASSERT_EQ(result() & 0xFFFFFFFF, untouched & 0xFFFFFFFF) << "the other half";
            }
            ASSERT_EQ(cexc(), expected.exceptions) << std::hexfloat << kind.opf << ' ' << a << ' ' << b << ' ' << mode;
            ASSERT_EQ(aexc(), expected.exceptions);
        }
    }
}

TEST_P(Fpu, IntegersConvertAndThoseThatDoNotFitBecomeTheNearest)
{
    const auto to_integer = [this](double x, std::uint32_t expected, std::uint32_t exceptions) {
        c.s.fsr = 2u << 30; // upwards: the conversion truncates nevertheless
        EXPECT_EQ(run(0xD2, 0, bits(x)), 0u);
        EXPECT_EQ(single_result(), expected) << x;
        EXPECT_EQ(cexc(), exceptions) << x;
        const auto x4 = static_cast<float>(x);
        if (double{x4} == x || std::isnan(x)) {
            EXPECT_EQ(run(0xD1, 0, upper(bits(x4))), 0u);
            EXPECT_EQ(single_result(), expected) << x;
            EXPECT_EQ(cexc(), exceptions) << x;
        }
    };
    for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
        c.core.fpu = fpu;
        to_integer(0, 0, 0);
        to_integer(-0.0, 0, 0);
        to_integer(-7, static_cast<std::uint32_t>(-7), 0);
        to_integer(2.75, 2, nx);
        to_integer(-2.75, static_cast<std::uint32_t>(-2), nx);
        to_integer(2147483647.0, 0x7FFFFFFF, 0);
        to_integer(2147483647.5, 0x7FFFFFFF, nx);
        to_integer(2147483648.0, 0x7FFFFFFF, nv);
        to_integer(-2147483648.0, 0x80000000, 0);
        to_integer(-2147483648.5, 0x80000000, nx);
        to_integer(-2147483649.0, 0x80000000, nv);
        to_integer(HUGE_VAL, 0x7FFFFFFF, nv);
        to_integer(-HUGE_VAL, 0x80000000, nv);
        to_integer(std::nan(""), 0x7FFFFFFF, nv);
        to_integer(-std::nan(""), fpu == FpuPersonality::qemu ? 0x7FFFFFFF : 0x80000000, nv);
    }
    c.s.fsr = 0;
    EXPECT_EQ(run(0xC8, 0, upper(0x80000001)), 0u); // fitod
    EXPECT_EQ(result(), bits(-2147483647.0));
    EXPECT_EQ(run(0xC4, 0, upper(0x7FFFFFFF)), 0u); // fitos
    EXPECT_EQ(single_result(), bits(0x1p31f));
    EXPECT_EQ(cexc(), nx);
    c.s.fsr = 1u << 30;
    EXPECT_EQ(run(0xC4, 0, upper(0x7FFFFFFF)), 0u);
    EXPECT_EQ(single_result(), bits(0x1.FFFFFEp30f));
}

TEST_P(Fpu, ComparesOrderNumbersAndFindNaNs)
{
    const double nan = std::nan(""), signaling = std::bit_cast<double>(0x7FF0000000000001);
    struct Case {
        double a, b;
        std::uint32_t fcc, quiet, strict; ///< exceptions of fcmp and fcmpe
    };
    const Case cases[] = {{1, 1, 0, 0, 0},           {0.0, -0.0, 0, 0, 0},     {1, 2, 1, 0, 0},
                          {2, 1, 2, 0, 0},           {-HUGE_VAL, 1, 1, 0, 0},  {0x1p-1074, 0, 2, 0, 0},
                          {nan, 1, 3, 0, nv},        {1, nan, 3, 0, nv},       {nan, nan, 3, 0, nv},
                          {signaling, 1, 3, nv, nv}, {1, signaling, 3, nv, nv}};
    for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
        c.core.fpu = fpu;
        for (const Case &k : cases) {
            c.s.fsr = 1u << fsr::fcc_shift;
            EXPECT_EQ(run(0x52, bits(k.a), bits(k.b), true), 0u);
            EXPECT_EQ(fcc(), k.fcc) << k.a << ' ' << k.b;
            EXPECT_EQ(cexc(), k.quiet) << k.a << ' ' << k.b;
            EXPECT_EQ(run(0x56, bits(k.a), bits(k.b), true), 0u);
            EXPECT_EQ(fcc(), k.fcc) << k.a << ' ' << k.b;
            EXPECT_EQ(cexc(), k.strict) << k.a << ' ' << k.b;
            EXPECT_EQ(aexc(), k.strict) << k.a << ' ' << k.b;
        }
    }
    EXPECT_EQ(run(0x51, upper(bits(-1.0f)), upper(bits(1.0f)), true), 0u);
    EXPECT_EQ(fcc(), 1u);
    EXPECT_EQ(run(0x55, upper(bits(2.0f)), upper(bits(1.0f)), true), 0u);
    EXPECT_EQ(fcc(), 2u);
}

TEST_P(Fpu, ANaNOfTheOperandsIsChosenAsTheFpuDoes)
{
    const std::uint64_t q1 = 0x7FF8000000000001, q2 = 0xFFF8000000000002, s1 = 0x7FF0000000000011,
                        s2 = 0x7FF4000000000022, number = bits(1.0), generated = 0x7FFFE00000000000;
    struct Case {
        std::uint64_t a, b, grfpu, qemu;
        bool invalid;
    };
    constexpr std::uint64_t quiet = 1ull << 51;
    for (const Case &k : {Case{number, q2, q2, q2, false}, Case{q1, number, q1, q1, false}, Case{q1, q2, q2, q2, false},
                          Case{q2, q1, q1, q2, false}, Case{number, s2, generated, s2 | quiet, true},
                          Case{s1, number, generated, s1 | quiet, true}, Case{s1, q2, generated, q2, true},
                          Case{q1, s2, generated, q1, true}, Case{s1, s2, generated, s2 | quiet, true},
                          Case{bits(HUGE_VAL), bits(HUGE_VAL), generated, ~0ull >> 1, true}}) {
        for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
            c.core.fpu = fpu;
            c.s.fsr = 0;
            EXPECT_EQ(run(0x46, k.a, k.b), 0u);
            EXPECT_EQ(result(), fpu == FpuPersonality::qemu ? k.qemu : k.grfpu) << std::hex << k.a << ' ' << k.b;
            EXPECT_EQ(cexc(), k.invalid ? nv : 0u) << std::hex << k.a << ' ' << k.b;
        }
    }
    // Conversions keep the sign and the leading bits of the fraction.
    for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
        c.core.fpu = fpu;
        run(0xC9, 0, upper(0xFFC00003));
        EXPECT_EQ(result(), 0xFFF8000060000000);
        run(0xC6, 0, 0xFFF8000060000000);
        EXPECT_EQ(single_result(), 0xFFC00003u);
    }
    run(0x41, upper(0x7F800001), upper(0x3F800000));
    EXPECT_EQ(single_result(), 0x7FFF0000u) << "the GRFPU's of single precision";
}

TEST_P(Fpu, TheGrfpuHasNoSubnormalNumbers)
{
    c.core.fpu = FpuPersonality::grfpu;
    const std::uint64_t least = bits(0x1p-1022);
    const auto traps = [this](std::uint32_t opf, std::uint64_t a, std::uint64_t b) {
        c.s.fsr = dz;
        EXPECT_EQ(run(opf, a, b), trap::fp_exception);
        EXPECT_EQ(ftt(), fsr::unfinished);
        EXPECT_EQ(result(), untouched);
        EXPECT_EQ(cexc(), dz) << "no IEEE exception happened";
    };
    traps(0x42, 1, bits(1.0));
    traps(0x4A, bits(1.0), 1);
    traps(0x2A, 0, 0x8000000000000001);
    traps(0xC6, 0, 1);
    traps(0xD2, 0, 1);
    traps(0x41, upper(1), upper(bits(1.0f)));
    traps(0xC9, 0, upper(0x807FFFFF));
    EXPECT_EQ(run(0x52, 1, 2, true), 0u) << "a compare takes them";
    EXPECT_EQ(fcc(), 1u);
    EXPECT_EQ(run(0x09, 0, upper(0x80000001)), 0u) << "a move, too";
    EXPECT_EQ(single_result(), 1u);
    c.s.fsr = fsr::nonstandard;
    EXPECT_EQ(run(0x42, 0x8000000000000001, bits(-0.0)), 0u);
    EXPECT_EQ(result(), bits(-0.0)) << "in the other mode they are zeros";

    // A result below the normal numbers is 0, whatever the rounding makes of it.
    for (std::uint32_t mode = 0; mode < 4; mode++) {
        c.s.fsr = mode << 30;
        EXPECT_EQ(run(0x46, bits(0x1p-1022), bits(0x1.0000000000001p-1022)), 0u);
        EXPECT_EQ(result(), bits(-0.0));
        EXPECT_EQ(cexc(), uf | nx);
        EXPECT_EQ(run(0x4A, bits(0x1p-1022), bits(0x1.FFFFFFFFFFFFFp-1)), 0u);
        EXPECT_EQ(result(), 0u) << "the exact product is below, the rounded one would not be";
        EXPECT_EQ(cexc(), uf | nx);
        EXPECT_EQ(run(0x4A, least, bits(1.0)), 0u);
        EXPECT_EQ(result(), least);
        EXPECT_EQ(cexc(), 0u);
        EXPECT_EQ(run(0xC6, 0, bits(0x1.FFFFFFp-127)), 0u);
        EXPECT_EQ(single_result(), 0u);
        EXPECT_EQ(cexc(), uf | nx);
    }
    c.s.fsr = 0;
    EXPECT_EQ(run(0x4A, bits(0x1.0000000000001p-1022), bits(0x1.FFFFFFFFFFFFFp-1)), 0u);
    EXPECT_EQ(result(), least) << "above the least normal number, and rounded to it";
    EXPECT_EQ(cexc(), nx);
}

TEST_P(Fpu, AnEnabledExceptionTrapsAndLeavesTheResult)
{
    for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
        c.core.fpu = fpu;
        const double greatest = 0x1.FFFFFFFFFFFFFp+1023;
        c.s.fsr = of << fsr::tem_shift | uf << fsr::aexc_shift;
        EXPECT_EQ(run(0x42, bits(greatest), bits(greatest)), trap::fp_exception);
        EXPECT_EQ(result(), untouched);
        EXPECT_EQ(ftt(), fsr::ieee_exception);
        EXPECT_EQ(cexc(), fpu == FpuPersonality::qemu ? of | nx : of) << "the manual: exactly that which traps";
        EXPECT_EQ(aexc(), uf) << "as before";
        EXPECT_EQ(run(0x4E, bits(1.0), bits(0.0)), 0u) << "not enabled";
        EXPECT_EQ(cexc(), dz);
        EXPECT_EQ(aexc(), uf | dz);
        EXPECT_EQ(ftt(), 0u);
        c.s.fsr = nx << fsr::tem_shift;
        EXPECT_EQ(run(0x42, bits(1.0), bits(0x1p-60)), trap::fp_exception);
        EXPECT_EQ(cexc(), nx);
        c.s.fsr = nv << fsr::tem_shift | 2u << fsr::fcc_shift;
        EXPECT_EQ(run(0x56, bits(1.0), bits(std::nan("")), true), trap::fp_exception);
        EXPECT_EQ(fcc(), 2u) << "as before";
    }
}

TEST_P(Fpu, WhatTheFpuDoesNotHaveTraps)
{
    EXPECT_EQ(run(0x43, 0, 0), trap::fp_exception) << "faddq";
    EXPECT_EQ(ftt(), fsr::unimplemented);
    c.write(SmallComputer::start, {with_number(3, 0x26, 0, g(1), 0)});
    c.engine->invalidate(SmallComputer::start, 4);
    c.go(SmallComputer::start);
    c.steps(1);
    EXPECT_EQ(c.s.trap_type, trap::fp_exception) << "std %fq";
    EXPECT_EQ(ftt(), fsr::sequence_error);
}

TEST_P(Fpu, TheGrfpuDefersATrapToItsNextInstruction)
{
    c.core.fpu = FpuPersonality::grfpu;
    const std::uint32_t stdfq = with_number(3, 0x26, 0, g(1), 16), stfsr = with_number(3, 0x25, 0, g(1), 0);
    const std::uint32_t division = fpop(0x34, 0x4E, 4, 0, 2), sum = fpop(0x34, 0x42, 6, 0, 0);
    constexpr std::uint32_t start = SmallComputer::start;
    std::uint32_t at = start;
    const auto step = [&](std::uint32_t word) {
        c.write(at, {word});
        c.engine->invalidate(at, 4);
        c.go(at);
        at += 4;
        const std::uint64_t traps = c.s.traps;
        c.steps(1);
        if (c.s.traps == traps) {
            return trap::none;
        }
        c.s.psr = (c.s.psr & ~psr::cwp) | psr::enable_traps | 4;
        return c.s.trap_type;
    };
    c.s.fsr = dz << fsr::tem_shift;
    c.s.floats[0] = bits(1.0);
    c.s.floats[1] = 0;
    c.s.floats[2] = untouched;
    EXPECT_EQ(step(division), trap::none);
    EXPECT_EQ(step(nop), trap::none) << "only the FPU takes the trap";
    EXPECT_EQ(step(with_number(3, 0x24, 0, g(1), 2)), trap::mem_address_not_aligned) << "has priority";
    EXPECT_EQ(step(branch(6, 8, false, 2)), trap::fp_exception);
    EXPECT_EQ(ftt(), fsr::ieee_exception);
    EXPECT_EQ(result(), untouched);
    EXPECT_EQ(step(stfsr), trap::none) << "stores execute now";
    EXPECT_EQ(c.bus.load(SmallComputer::data) & 1u << 13, 1u << 13) << "the queue is not empty";
    EXPECT_EQ(step(sum), trap::fp_exception);
    EXPECT_EQ(ftt(), fsr::sequence_error);
    EXPECT_EQ(step(stdfq), trap::none);
    EXPECT_EQ(c.bus.load(SmallComputer::data + 16), start);
    EXPECT_EQ(c.bus.load(SmallComputer::data + 20), division);
    EXPECT_EQ(step(stfsr), trap::none);
    EXPECT_EQ(c.bus.load(SmallComputer::data) & 1u << 13, 0u);
    EXPECT_EQ(step(sum), trap::none);
    EXPECT_EQ(c.s.floats[3], bits(2.0));
    EXPECT_EQ(step(stdfq), trap::fp_exception);
    EXPECT_EQ(ftt(), fsr::sequence_error) << "there is nothing in it";
}

TEST_P(Fpu, MovesTakeAnyBits)
{
    c.s.fsr = nv;
    EXPECT_EQ(run(0x01, 0, upper(0xFF800001)), 0u);
    EXPECT_EQ(single_result(), 0xFF800001u);
    EXPECT_EQ(cexc(), 0u);
    EXPECT_EQ(run(0x05, 0, upper(0xFF800001)), 0u);
    EXPECT_EQ(single_result(), 0x7F800001u);
    EXPECT_EQ(run(0x09, 0, upper(0xFF800001)), 0u);
    EXPECT_EQ(single_result(), 0x7F800001u);
}

TEST_P(Fpu, TheFsrKeepsWhatItMay)
{
    c.r(g(1)) = SmallComputer::data;
    c.write(SmallComputer::data, {0xFFFFFFFF, 0, 0});
    c.write(SmallComputer::start, {with_number(3, 0x21, 0, g(1), 0), with_number(3, 0x25, 0, g(1), 4)});
    for (FpuPersonality fpu : {FpuPersonality::qemu, FpuPersonality::grfpu}) {
        c.core.fpu = fpu;
        c.s.fsr = fsr::sequence_error;
        c.go(SmallComputer::start);
        c.steps(2);
        const std::uint32_t version = fpu == FpuPersonality::qemu ? 0 : 2;
        EXPECT_EQ(c.bus.load(SmallComputer::data + 4), 0xCFC10FFF | version << 17);
    }
}

TEST_P(Fpu, ADivisionByZeroInALoopIsAccrued)
{
    // Many operations in one burst: the flags of all are in aexc, those of the last one in cexc.
    c.s.floats[0] = bits(1.0);
    c.s.floats[1] = bits(0.0);
    c.s.floats[2] = bits(3.0);
    c.write(SmallComputer::start, {fpop(0x34, 0x4E, 6, 0, 2), fpop(0x34, 0x4E, 8, 0, 4), fpop(0x34, 0x42, 10, 0, 0)});
    c.steps(3);
    EXPECT_EQ(aexc(), dz | nx);
    EXPECT_EQ(cexc(), 0u);
    EXPECT_EQ(c.s.floats[3], bits(HUGE_VAL));
    EXPECT_EQ(c.s.floats[5], bits(2.0));
}

INSTANTIATE_TEST_SUITE_P(Engines, Fpu, ::testing::Values(&make_interpreter, &make_threaded),
                         [](const auto &made) { return std::string(made.param()->name()); });

} // namespace fpu_test
