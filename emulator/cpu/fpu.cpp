// SPDX-License-Identifier: Apache-2.0
// IEEE 754 arithmetic as SPARC has it. The host rounds and finds the exceptions, one operation at a time; NaNs,
// subnormal numbers and integers that do not fit are decided here.
#include "emulator/cpu/fpu.h"

#include <bit>
#include <cmath>
#include <concepts>
#include <limits>

#include "emulator/cpu/host_fpu.h"
#include "emulator/cpu/step.h"

namespace fledge::emulator {

namespace {

template <std::floating_point F> using Bits = std::conditional_t<sizeof(F) == 4, std::uint32_t, std::uint64_t>;

template <class F> constexpr F smallest_normal = std::numeric_limits<F>::min();

template <class F> Bits<F> bits_of(F x)
{
    return std::bit_cast<Bits<F>>(x);
}

template <class F> bool is_signaling(F x)
{
    constexpr Bits<F> quiet_bit = Bits<F>{1} << (std::numeric_limits<F>::digits - 2);
    return std::isnan(x) && (bits_of(x) & quiet_bit) == 0;
}

template <class F> bool is_subnormal(F x)
{
    return std::fpclassify(x) == FP_SUBNORMAL;
}

/// A NaN as the double with the same sign and the same leading bits of the fraction.
constexpr std::uint64_t quiet = std::uint64_t{1} << 51, fraction = (std::uint64_t{1} << 52) - 1;

std::uint64_t widened(float nan)
{
    const std::uint64_t b = bits_of(nan);
    return (b & 0x80000000u) << 32 | std::uint64_t{0x7FF} << 52 | (b & 0x7FFFFF) << 29;
}
std::uint64_t widened(double nan)
{
    return bits_of(nan);
}

template <class F> F narrowed(std::uint64_t nan)
{
    if constexpr (sizeof(F) == 8) {
        return std::bit_cast<double>(nan);
    } else {
        return std::bit_cast<float>(static_cast<std::uint32_t>(nan >> 32 & 0x80000000u) | 0x7F800000u |
                                    static_cast<std::uint32_t>((nan & fraction) >> 29));
    }
}

constexpr std::uint64_t default_nan(FpuPersonality fpu)
{
    return fpu == FpuPersonality::grfpu ? 0x7FFFE00000000000 : 0x7FFFFFFFFFFFFFFF;
}

/// The NaN that an operation with one or two NaNs gives; a number that is no NaN is 0 here.
std::uint64_t chosen_nan(FpuPersonality fpu, std::uint64_t a, std::uint64_t b, bool signaling)
{
    if (fpu == FpuPersonality::grfpu) {
        return signaling ? default_nan(fpu) : b != 0 ? b : a;
    }
    // QEMU 7.2 follows the x87: a quiet NaN goes before a signaling one, then the larger fraction, then the positive.
    const auto rank = [a, b](std::uint64_t nan) {
        const bool quiet_first = a != 0 && b != 0 && ((a ^ b) & quiet) != 0;
        return nan == 0 ? 0 : quiet_first ? 1 + (nan & quiet) : 1 + (nan & fraction) * 2 + (nan >> 63 == 0 ? 1 : 0);
    };
    return (rank(a) >= rank(b) ? a : b) | quiet;
}

class Fpu {
public:
    Fpu(CpuState &s, FpuPersonality fpu, const Instruction &i) : fpu_(fpu), s_(s), i_(i) {}

    std::uint32_t perform();

private:
    template <class F> F operand(std::uint32_t r) const
    {
        if constexpr (sizeof(F) == 8) {
            return std::bit_cast<double>(s_.floats[r / 2]);
        } else {
            return std::bit_cast<float>(single(s_, r));
        }
    }

    void set(double x) { s_.floats[i_.rd / 2] = bits_of(x); }
    void set(float x) { set_single(s_, i_.rd, bits_of(x)); }
    void set(std::int32_t x) { set_single(s_, i_.rd, static_cast<std::uint32_t>(x)); }

    /// The result of a computation of the host, in the rounding mode of `fsr`; adds its exceptions.
    template <class Compute> auto on_host(std::uint32_t fsr, Compute compute)
    {
        HostFpu host(fsr);
        const volatile auto result = compute();
        exceptions_ |= host.leave();
        return +result;
    }

    /// The end of every operation: traps, or what the operation leaves in the FSR.
    std::uint32_t exception(std::uint32_t ftt)
    {
        s_.fsr = (s_.fsr & ~fsr::ftt) | ftt;
        return trap::fp_exception;
    }

    std::uint32_t trap_of_exceptions()
    {
        const std::uint32_t enabled = exceptions_ & s_.fsr >> fsr::tem_shift & fsr::cexc;
        std::uint32_t current = exceptions_;
        if (enabled != 0 && fpu_ == FpuPersonality::grfpu) {
            // The manual: exactly the exception that traps. Invalid is the highest bit, inexact the lowest.
            current = std::bit_floor(enabled);
        }
        s_.fsr = (s_.fsr & ~(fsr::ftt | fsr::cexc)) | current;
        if (enabled != 0) {
            return exception(fsr::ieee_exception);
        }
        s_.fsr |= current << fsr::aexc_shift;
        return trap::none;
    }

    template <class Result> std::uint32_t finish(Result result)
    {
        const std::uint32_t t = trap_of_exceptions();
        if (t == trap::none) {
            set(result);
        }
        return t;
    }

    /// False: the GRFPU does not compute with a subnormal operand.
    template <class F> bool accept(F &x) const
    {
        if (fpu_ != FpuPersonality::grfpu || !is_subnormal(x)) {
            return true;
        }
        x = std::copysign(F{0}, x);
        return (s_.fsr & fsr::nonstandard) != 0;
    }

    /// An operation on one or two operands of type From.
    template <class To, class From, class Compute> std::uint32_t unary(Compute compute)
    {
        return both<To>(From{0}, operand<From>(i_.rs2), [compute](From, From b) { return compute(b); });
    }
    template <class To, class From, class Compute> std::uint32_t binary(Compute compute)
    {
        return both<To>(operand<From>(i_.rs1), operand<From>(i_.rs2), compute);
    }

    template <class To, class From, class Compute> std::uint32_t both(From a, From b, Compute compute)
    {
        if (!accept(a) || !accept(b)) {
            return exception(fsr::unfinished);
        }
        if (std::isnan(a) || std::isnan(b)) {
            const bool signaling = is_signaling(a) || is_signaling(b);
            exceptions_ = signaling ? fsr::invalid : 0;
            std::uint64_t wide_a = std::isnan(a) ? widened(a) : 0, wide_b = std::isnan(b) ? widened(b) : 0;
            if (fpu_ == FpuPersonality::qemu && i_.op == Op::fsmuld) { // it converts first, which makes both quiet
                wide_a |= wide_a != 0 ? quiet : 0;
                wide_b |= wide_b != 0 ? quiet : 0;
            }
            return finish(narrowed<To>(chosen_nan(fpu_, wide_a, wide_b, signaling)));
        }
        const volatile From host_a = a, host_b = b; // so that the compiler computes between the changes of the mode
        const auto computed = [&] { return static_cast<To>(compute(host_a, host_b)); };
        To result = on_host(s_.fsr, computed);
        if (std::isnan(result)) {
            result = narrowed<To>(default_nan(fpu_));
        } else if (fpu_ == FpuPersonality::grfpu && is_tiny(result, computed)) {
            result = std::copysign(To{0}, result);
            exceptions_ |= fsr::underflow | fsr::inexact;
        }
        return finish(result);
    }

    /// Whether a result that is not 0 is below the normal numbers before it is rounded: the GRFPU makes it 0.
    template <class To, class Compute> bool is_tiny(To result, Compute computed)
    {
        if (std::abs(result) != smallest_normal<To> || (exceptions_ & fsr::inexact) == 0) {
            return is_subnormal(result);
        }
        const std::uint32_t before = exceptions_;
        const To truncated = on_host(1u << fsr::rounding_shift, computed);
        exceptions_ = before;
        return is_subnormal(truncated);
    }

    template <class To> std::uint32_t from_integer()
    {
        const volatile auto integer = static_cast<std::int32_t>(single(s_, i_.rs2));
        return finish(on_host(s_.fsr, [&integer] { return static_cast<To>(integer); }));
    }

    template <class From> std::uint32_t to_integer()
    {
        From x = operand<From>(i_.rs2);
        if (!accept(x)) {
            return exception(fsr::unfinished);
        }
        constexpr double lowest = std::numeric_limits<std::int32_t>::min(),
                         highest = std::numeric_limits<std::int32_t>::max();
        const double whole = std::trunc(double{x});
        if (std::isnan(x) || whole < lowest || whole > highest) {
            exceptions_ = fsr::invalid;
            const bool positive = std::isnan(x) && fpu_ == FpuPersonality::qemu ? true : !std::signbit(x);
            return finish(static_cast<std::int32_t>(positive ? highest : lowest));
        }
        exceptions_ = whole != double{x} ? fsr::inexact : 0;
        return finish(static_cast<std::int32_t>(whole));
    }

    /// fcc: 0 equal, 1 less, 2 greater, 3 unordered. A compare takes subnormal numbers as they are.
    template <class F> std::uint32_t compare(bool quiet_is_invalid)
    {
        const F a = operand<F>(i_.rs1), b = operand<F>(i_.rs2);
        std::uint32_t fcc = 3;
        if (std::isnan(a) || std::isnan(b)) {
            exceptions_ = quiet_is_invalid || is_signaling(a) || is_signaling(b) ? fsr::invalid : 0;
        } else {
            fcc = a == b ? 0 : a < b ? 1 : 2;
        }
        const std::uint32_t t = trap_of_exceptions();
        if (t == trap::none) {
            s_.fsr = (s_.fsr & ~fsr::fcc) | fcc << fsr::fcc_shift;
        }
        return t;
    }

    /// fmovs, fnegs, fabss: any bits.
    std::uint32_t move(std::uint32_t bits)
    {
        set_single(s_, i_.rd, bits);
        return trap_of_exceptions();
    }

    FpuPersonality fpu_;
    CpuState &s_;
    const Instruction &i_;
    std::uint32_t exceptions_ = 0;
};

std::uint32_t Fpu::perform()
{
    const auto add = [](auto a, auto b) { return a + b; };
    const auto subtract = [](auto a, auto b) { return a - b; };
    const auto multiply = [](auto a, auto b) { return a * b; };
    const auto divide = [](auto a, auto b) { return a / b; };
    const auto root = [](auto b) { return std::sqrt(b); };
    const auto convert = [](auto b) { return b; };
    constexpr std::uint32_t sign = 0x80000000u;
    switch (i_.op) {
    case Op::fmovs: return move(single(s_, i_.rs2));
    case Op::fnegs: return move(single(s_, i_.rs2) ^ sign);
    case Op::fabss: return move(single(s_, i_.rs2) & ~sign);
    case Op::fadds: return binary<float, float>(add);
    case Op::faddd: return binary<double, double>(add);
    case Op::fsubs: return binary<float, float>(subtract);
    case Op::fsubd: return binary<double, double>(subtract);
    case Op::fmuls: return binary<float, float>(multiply);
    case Op::fmuld: return binary<double, double>(multiply);
    case Op::fsmuld: return binary<double, float>([](float a, float b) { return double{a} * double{b}; });
    case Op::fdivs: return binary<float, float>(divide);
    case Op::fdivd: return binary<double, double>(divide);
    case Op::fsqrts: return unary<float, float>(root);
    case Op::fsqrtd: return unary<double, double>(root);
    case Op::fstod: return unary<double, float>(convert);
    case Op::fdtos: return unary<float, double>(convert);
    case Op::fitos: return from_integer<float>();
    case Op::fitod: return from_integer<double>();
    case Op::fstoi: return to_integer<float>();
    case Op::fdtoi: return to_integer<double>();
    case Op::fcmps: return compare<float>(false);
    case Op::fcmpd: return compare<double>(false);
    case Op::fcmpes: return compare<float>(true);
    case Op::fcmped: return compare<double>(true);
    default:
        if (fpu_ == FpuPersonality::qemu) {
            s_.fsr &= ~fsr::cexc;
        }
        return exception(fsr::unimplemented);
    }
}

} // namespace

std::uint32_t execute_fpop(CpuState &s, FpuPersonality fpu, const Instruction &i)
{
    return Fpu(s, fpu, i).perform();
}

std::uint32_t no_queue(CpuState &s)
{
    s.fsr = (s.fsr & ~fsr::ftt) | fsr::sequence_error;
    return trap::fp_exception;
}

std::uint32_t fsr_version(FpuPersonality fpu)
{
    return (fpu == FpuPersonality::grfpu ? 2u : 0u) << fsr::version_shift; // QEMU loses its own 4 at the first ldfsr
}

} // namespace fledge::emulator
