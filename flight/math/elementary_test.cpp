// SPDX-License-Identifier: Apache-2.0
// The elementary functions against MPFR at 200 bits, in all regimes of their arguments, and their
// special cases. FLEDGE_CAMPAIGN=1 in the environment takes a hundred times as many arguments.
#include <gtest/gtest.h>
#include <mpfr.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "flight/math/elementary.h"

namespace elementary_test {

constexpr double INF = std::numeric_limits<double>::infinity();
constexpr double LARGEST = std::numeric_limits<double>::max();
constexpr double SMALLEST = std::numeric_limits<double>::denorm_min();
constexpr double HALF_PI = 0x1.921fb54442d18p+0;

std::uint64_t bits_of(double x)
{
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}

double from_bits(std::uint64_t bits)
{
    double x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}

int arguments_per_regime()
{
    const char *campaign = std::getenv("FLEDGE_CAMPAIGN");
    return campaign && std::string(campaign) == "1" ? 200'000 : 2'000;
}

// ---- the oracle --------------------------------------------------------------------------------

class Exact {
public:
    Exact() { mpfr_init2(value_, 200); }
    ~Exact() { mpfr_clear(value_); }
    Exact(const Exact &) = delete;
    Exact &operator=(const Exact &) = delete;

    mpfr_ptr get() { return value_; }
    void set(double x) { mpfr_set_d(value_, x, MPFR_RNDN); }

    // |got - value| in units of the last place that a double of this size has. Infinity, and what
    // lies beyond 2^1024, count as 2^1024: an overflow is right where the value rounds to it.
    double ulps_from(double got)
    {
        if (mpfr_nan_p(value_) || std::isnan(got)) {
            return mpfr_nan_p(value_) && std::isnan(got) ? 0.0 : INF;
        }
        if (mpfr_inf_p(value_) || mpfr_zero_p(value_)) {
            return got == mpfr_get_d(value_, MPFR_RNDN) ? 0.0 : INF;
        }
        const long exponent = std::max(mpfr_get_exp(value_) - 53L, -1074L);
        if (mpfr_get_exp(value_) > 1024) {
            return std::isinf(got) && std::signbit(got) == (mpfr_signbit(value_) != 0) ? 0.0 : INF;
        }
        mpfr_t difference;
        mpfr_init2(difference, 300);
        if (std::isinf(got)) {
            mpfr_set_si_2exp(difference, got > 0 ? 1 : -1, 1024, MPFR_RNDN);
        } else {
            mpfr_set_d(difference, got, MPFR_RNDN);
        }
        mpfr_sub(difference, difference, value_, MPFR_RNDN);
        mpfr_mul_2si(difference, difference, -exponent, MPFR_RNDN);
        const double ulps = std::fabs(mpfr_get_d(difference, MPFR_RNDN));
        mpfr_clear(difference);
        return ulps;
    }

private:
    mpfr_t value_;
};

struct Worst {
    double ulps = 0.0;
    double y = 0.0, x = 0.0;

    void see(double found, double at_x, double at_y = 0.0)
    {
        if (!(found <= ulps)) {
            *this = {found, at_y, at_x};
        }
    }
};

// ---- arguments ---------------------------------------------------------------------------------

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}

    std::uint64_t bits() { return engine_(); }
    int integer(int low, int high) { return low + static_cast<int>(engine_() % (high - low + 1ull)); }
    double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double between(double low, double high) { return low + (high - low) * unit(); }
    double sign() { return engine_() & 1 ? 1.0 : -1.0; }

    // Every exponent from low to high is equally likely.
    double spread(int low, int high) { return std::ldexp(1.0 + unit(), integer(low, high)); }

    // Up to a few units of the last place away from x.
    double beside(double x) { return from_bits(bits_of(x) + static_cast<std::uint64_t>(integer(-3, 3))); }

private:
    std::mt19937_64 engine_;
};

using Regime = std::function<double(Random &)>;

double near_quarter_turns(Random &random)
{
    const double turns = std::floor(random.spread(0, random.integer(1, 60)));
    Exact multiple;
    mpfr_const_pi(multiple.get(), MPFR_RNDN);
    mpfr_mul_d(multiple.get(), multiple.get(), turns / 2.0, MPFR_RNDN);
    return random.sign() * random.beside(mpfr_get_d(multiple.get(), MPFR_RNDN));
}

const std::vector<Regime> ANGLES = {
    [](Random &r) { return r.between(-HALF_PI, HALF_PI); },
    [](Random &r) { return r.between(-30.0, 30.0); },
    [](Random &r) { return r.between(0.7, 0.8); }, // where the reduced angle is largest
    [](Random &r) { return r.between(-2e6, 2e6); },
    [](Random &r) { return r.sign() * r.spread(-1074, -20); },
    [](Random &r) { return r.sign() * r.spread(-30, 60); },
    [](Random &r) { return r.sign() * r.spread(60, 1023); },
    near_quarter_turns,
    // No double comes closer to a multiple of pi/2, relative to the multiple.
    [](Random &r) { return r.beside(0x1.6ac5b262ca1ffp+849); },
};

const std::vector<Regime> RATIOS = {
    [](Random &r) { return r.between(-1.0, 1.0); },
    [](Random &r) { return r.sign() * r.spread(-1074, -2); },
    [](Random &r) { return r.sign() * (1.0 - r.spread(-53, -2)); },
    [](Random &r) { return r.sign() * (0.5 + r.sign() * r.spread(-54, -3)); },
};

const std::vector<Regime> TANGENTS = {
    [](Random &r) { return r.between(-3.0, 3.0); },
    [](Random &r) { return r.sign() * r.spread(-1074, 1023); },
    [](Random &r) { return r.sign() * r.spread(-30, 60); },
    [](Random &r) { return r.sign() * (1.0 + r.sign() * r.spread(-53, -2)); },
    [](Random &r) { return r.beside(0x1.a827999fcef32p-2) * (1.0 + r.spread(-53, -6)); },
};

const std::vector<Regime> EXPONENTS = {
    [](Random &r) { return r.between(-1.0, 1.0); },
    [](Random &r) { return r.between(-708.0, 709.0); },
    [](Random &r) { return r.between(-746.0, -708.0); },
    [](Random &r) { return r.between(709.7, 709.9); },
    [](Random &r) { return r.beside(0x1.62e42fefa39efp+9); },
    [](Random &r) { return r.sign() * r.spread(-1074, 10); },
    [](Random &r) { return r.beside((r.integer(-60000, 60000) + 0.5) * (std::log(2.0) / 64)); },
};

const std::vector<Regime> POSITIVES = {
    [](Random &r) { return r.spread(-1022, 1023); }, [](Random &r) { return from_bits(r.bits() >> 12); },
    [](Random &r) { return r.between(0.5, 2.0); },   [](Random &r) { return 1.0 + r.sign() * r.spread(-53, -2); },
    [](Random &r) { return r.between(0.98, 1.02); },
};

// ---- one argument ------------------------------------------------------------------------------

struct Function {
    const char *name;
    double (*ours)(double);
    int (*exact)(mpfr_ptr, mpfr_srcptr, mpfr_rnd_t);
    const std::vector<Regime> *regimes;
};

void PrintTo(const Function &function, std::ostream *out)
{
    *out << function.name;
}

class OneArgument : public testing::TestWithParam<Function> {};

TEST_P(OneArgument, IsWithinOneUlp)
{
    const Function &f = GetParam();
    Worst worst;
    Exact x, y;
    for (std::size_t regime = 0; regime < f.regimes->size(); ++regime) {
        Random random(1000 + regime);
        for (int i = 0; i < arguments_per_regime(); ++i) {
            const double argument = (*f.regimes)[regime](random);
            x.set(argument);
            f.exact(y.get(), x.get(), MPFR_RNDN);
            worst.see(y.ulps_from(f.ours(argument)), argument);
        }
    }
    std::printf("%-5s worst %.4f ulp at %a\n", f.name, worst.ulps, worst.x);
    EXPECT_LE(worst.ulps, 1.0) << f.name << " at " << std::hexfloat << worst.x;
}

TEST_P(OneArgument, GivesTheOneNaNForNaN)
{
    EXPECT_EQ(bits_of(GetParam().ours(NAN)), bits_of(NAN));
    EXPECT_EQ(bits_of(GetParam().ours(-NAN)), bits_of(NAN));
    EXPECT_EQ(bits_of(GetParam().ours(from_bits(0x7ff8dead'beef0001))), bits_of(NAN));
}

INSTANTIATE_TEST_SUITE_P(
    Elementary, OneArgument,
    testing::Values(Function{"sin", fm_sin, mpfr_sin, &ANGLES}, Function{"cos", fm_cos, mpfr_cos, &ANGLES},
                    Function{"tan", fm_tan, mpfr_tan, &ANGLES}, Function{"asin", fm_asin, mpfr_asin, &RATIOS},
                    Function{"acos", fm_acos, mpfr_acos, &RATIOS}, Function{"atan", fm_atan, mpfr_atan, &TANGENTS},
                    Function{"exp", fm_exp, mpfr_exp, &EXPONENTS}, Function{"log", fm_log, mpfr_log, &POSITIVES}),
    [](const auto &test) { return std::string(test.param.name); });

// ---- sine and cosine together ------------------------------------------------------------------

TEST(SinCos, HasTheBitsOfSinAndCos)
{
    for (std::size_t regime = 0; regime < ANGLES.size(); ++regime) {
        Random random(2000 + regime);
        for (int i = 0; i < 1000; ++i) {
            const double x = ANGLES[regime](random);
            double s, c;
            fm_sincos(x, &s, &c);
            ASSERT_EQ(bits_of(s), bits_of(fm_sin(x))) << x;
            ASSERT_EQ(bits_of(c), bits_of(fm_cos(x))) << x;
        }
    }
}

TEST(SinCos, GivesNaNForWhatIsNoAngle)
{
    for (const double x : {INF, -INF, static_cast<double>(NAN)}) {
        double s = 0.0, c = 0.0;
        fm_sincos(x, &s, &c);
        EXPECT_EQ(bits_of(s), bits_of(NAN));
        EXPECT_EQ(bits_of(c), bits_of(NAN));
        EXPECT_EQ(bits_of(fm_tan(x)), bits_of(NAN));
    }
}

// ---- two arguments -----------------------------------------------------------------------------

TEST(ArcTangent2, IsWithinOneUlp)
{
    using Pair = std::pair<double, double>;
    const std::vector<std::function<Pair(Random &)>> regimes = {
        [](Random &r) { return Pair(r.between(-1.0, 1.0), r.between(-1.0, 1.0)); },
        [](Random &r) { return Pair(r.sign() * r.spread(-1074, 1023), r.sign() * r.spread(-1074, 1023)); },
        // Of like size, at every size: what can overflow or underflow on the way.
        [](Random &r) {
            const int e = r.integer(-1074, 1023);
            const int near = std::min(std::max(e + r.integer(-70, 70), -1074), 1023);
            return Pair(r.sign() * r.spread(e, e), r.sign() * r.spread(near, near));
        },
        // Beside the axes, the diagonals, and the limits of the sectors.
        [](Random &r) {
            const double slopes[] = {0x1p-40, 0.4142135623730951, 1.0, 2.414213562373095, 0x1p40};
            const double x = r.spread(-3, 3);
            return Pair(r.sign() * r.beside(slopes[r.integer(0, 4)] * x), r.sign() * x);
        },
    };
    Worst worst;
    Exact x, y, angle;
    for (std::size_t regime = 0; regime < regimes.size(); ++regime) {
        Random random(3000 + regime);
        for (int i = 0; i < arguments_per_regime(); ++i) {
            const auto [dy, dx] = regimes[regime](random);
            y.set(dy);
            x.set(dx);
            mpfr_atan2(angle.get(), y.get(), x.get(), MPFR_RNDN);
            worst.see(angle.ulps_from(fm_atan2(dy, dx)), dx, dy);
        }
    }
    std::printf("atan2 worst %.4f ulp at %a, %a\n", worst.ulps, worst.y, worst.x);
    EXPECT_LE(worst.ulps, 1.0) << std::hexfloat << worst.y << ", " << worst.x;
}

TEST(Power, IsWithinOneUlp)
{
    using Pair = std::pair<double, double>;
    const std::vector<std::function<Pair(Random &)>> regimes = {
        [](Random &r) { return Pair(r.between(0.0, 10.0), r.between(-10.0, 10.0)); },
        [](Random &r) { return Pair(r.sign() * r.spread(-30, 30), r.integer(-30, 30)); },
        [](Random &r) { return Pair(r.spread(-1074, 1023), r.sign() * r.spread(-70, 70)); },
        // Of any size, with results of all sizes up to overflow, and down to subnormal ones and 0.
        [](Random &r) {
            const double x = r.spread(-1074, 1023);
            return Pair(x, r.between(-746.0, 710.0) / std::log(x));
        },
        [](Random &r) {
            const double x = r.spread(-1074, 1023);
            return Pair(x, r.between(-746.0, -700.0) / std::log(x));
        },
        // Beside 1, where the exponent may be huge.
        [](Random &r) {
            const double x = 1.0 + r.sign() * r.spread(-53, -2);
            return Pair(x, r.between(-746.0, 710.0) / std::log(x));
        },
        // Where the logarithm changes the row of its table, or has its largest rest.
        [](Random &r) {
            const double x = from_bits(0x3fe6a00000000000u + (static_cast<std::uint64_t>(r.integer(0, 32)) << 47));
            return Pair(r.beside(x), r.between(-2000.0, 2000.0));
        },
    };
    Worst worst;
    Exact base, exponent, power;
    for (std::size_t regime = 0; regime < regimes.size(); ++regime) {
        Random random(5000 + regime);
        for (int i = 0; i < arguments_per_regime(); ++i) {
            const auto [x, y] = regimes[regime](random);
            base.set(x);
            exponent.set(y);
            mpfr_pow(power.get(), base.get(), exponent.get(), MPFR_RNDN);
            worst.see(power.ulps_from(fm_pow(x, y)), x, y);
        }
    }
    std::printf("pow   worst %.4f ulp at %a, %a\n", worst.ulps, worst.x, worst.y);
    EXPECT_LE(worst.ulps, 1.0) << std::hexfloat << worst.x << ", " << worst.y;
}

TEST(Power, IsExactWhereItIsADouble)
{
    Random random(6000);
    for (int i = 0; i < 20'000; ++i) {
        const int n = random.integer(1, 33), most = static_cast<int>(std::exp2(53.0 / n));
        const double x = random.integer(1, std::max(most, 1));
        double product = 1.0;
        for (int k = 0; k < n; ++k) {
            product *= x; // exact, below 2^53
        }
        const int scale = random.integer(-1000 / n, 900 / n); // of the base, so that the power remains normal
        const double signed_x = random.sign() * std::ldexp(x, scale);
        const double wanted = std::ldexp(signed_x < 0 && n % 2 ? -product : product, n * scale);
        ASSERT_EQ(bits_of(fm_pow(signed_x, n)), bits_of(wanted)) << signed_x << ", " << n;
        if (n % 2) {
            ASSERT_EQ(bits_of(fm_pow(product * product, 0.5)), bits_of(std::sqrt(product * product))) << product;
        }
    }
    for (int n = -1074; n < 1024; ++n) {
        ASSERT_EQ(fm_pow(2.0, n), std::ldexp(1.0, n)) << n;
    }
}

// ---- special cases -----------------------------------------------------------------------------

void expect_same(double got, double wanted, const char *what)
{
    EXPECT_EQ(bits_of(got), bits_of(wanted)) << what << ": " << got << " instead of " << wanted;
}

#define EXPECT_SAME(call, wanted) expect_same(call, wanted, #call)

TEST(SpecialCases, OddFunctionsKeepTheSignOfZeroAndOfTheTiniest)
{
    for (const auto f : {fm_sin, fm_tan, fm_asin, fm_atan}) {
        for (const double x : {0.0, SMALLEST, 3 * SMALLEST, 0x1p-1022, 0x1p-600, 0x1p-30}) {
            EXPECT_EQ(bits_of(f(x)), bits_of(x)) << x;
            EXPECT_EQ(bits_of(f(-x)), bits_of(-x)) << x;
        }
    }
}

TEST(SpecialCases, OddAndEvenHoldToTheBit)
{
    Random random(4000);
    for (int i = 0; i < 10'000; ++i) {
        const double x = random.spread(-20, 20), ratio = random.unit();
        EXPECT_SAME(fm_sin(-x), -fm_sin(x));
        EXPECT_SAME(fm_cos(-x), fm_cos(x));
        EXPECT_SAME(fm_tan(-x), -fm_tan(x));
        EXPECT_SAME(fm_atan(-x), -fm_atan(x));
        EXPECT_SAME(fm_asin(-ratio), -fm_asin(ratio));
        EXPECT_SAME(fm_atan2(-x, ratio), -fm_atan2(x, ratio));
    }
}

TEST(SpecialCases, Cosine)
{
    EXPECT_SAME(fm_cos(0.0), 1.0);
    EXPECT_SAME(fm_cos(-0.0), 1.0);
    EXPECT_SAME(fm_cos(SMALLEST), 1.0);
}

TEST(SpecialCases, ArcSineAndArcCosine)
{
    EXPECT_SAME(fm_asin(1.0), HALF_PI);
    EXPECT_SAME(fm_asin(-1.0), -HALF_PI);
    EXPECT_SAME(fm_acos(1.0), 0.0);
    EXPECT_SAME(fm_acos(-1.0), 2 * HALF_PI);
    EXPECT_SAME(fm_acos(0.0), HALF_PI);
    EXPECT_SAME(fm_acos(-0.0), HALF_PI);
    for (const double x : {std::nextafter(1.0, 2.0), 2.0, LARGEST, INF}) {
        for (const auto f : {fm_asin, fm_acos}) {
            EXPECT_SAME(f(x), NAN);
            EXPECT_SAME(f(-x), NAN);
        }
    }
}

TEST(SpecialCases, ArcTangent)
{
    EXPECT_SAME(fm_atan(INF), HALF_PI);
    EXPECT_SAME(fm_atan(-INF), -HALF_PI);
    EXPECT_SAME(fm_atan(LARGEST), HALF_PI);
    EXPECT_SAME(fm_atan(1.0), HALF_PI / 2);
}

TEST(SpecialCases, ArcTangent2)
{
    const double pi = 2 * HALF_PI, three_quarters = 0x1.2d97c7f3321d2p+1;
    for (const double sign : {1.0, -1.0}) {
        EXPECT_SAME(fm_atan2(sign * 0.0, 0.0), sign * 0.0);
        EXPECT_SAME(fm_atan2(sign * 0.0, -0.0), sign * pi);
        for (const double x : {SMALLEST, 1.0, LARGEST, INF}) {
            EXPECT_SAME(fm_atan2(sign * 0.0, x), sign * 0.0);
            EXPECT_SAME(fm_atan2(sign * 0.0, -x), sign * pi);
            EXPECT_SAME(fm_atan2(sign * x, 0.0), sign * HALF_PI);
            EXPECT_SAME(fm_atan2(sign * x, -0.0), sign * HALF_PI);
        }
        for (const double y : {SMALLEST, 1.0, LARGEST}) {
            EXPECT_SAME(fm_atan2(sign * y, INF), sign * 0.0);
            EXPECT_SAME(fm_atan2(sign * y, -INF), sign * pi);
            EXPECT_SAME(fm_atan2(sign * INF, y), sign * HALF_PI);
            EXPECT_SAME(fm_atan2(sign * INF, -y), sign * HALF_PI);
        }
        EXPECT_SAME(fm_atan2(sign * INF, INF), sign * HALF_PI / 2);
        EXPECT_SAME(fm_atan2(sign * INF, -INF), sign * three_quarters);
        EXPECT_SAME(fm_atan2(sign * SMALLEST, LARGEST), sign * 0.0);
        EXPECT_SAME(fm_atan2(sign * LARGEST, LARGEST), sign * HALF_PI / 2);
        EXPECT_SAME(fm_atan2(sign * SMALLEST, SMALLEST), sign * HALF_PI / 2);
        for (const double other : {0.0, 1.0, INF, static_cast<double>(NAN)}) {
            EXPECT_SAME(fm_atan2(sign * NAN, other), NAN);
            EXPECT_SAME(fm_atan2(sign * other, NAN), NAN);
        }
    }
}

TEST(SpecialCases, Exponential)
{
    EXPECT_SAME(fm_exp(0.0), 1.0);
    EXPECT_SAME(fm_exp(-0.0), 1.0);
    EXPECT_SAME(fm_exp(INF), INF);
    EXPECT_SAME(fm_exp(-INF), 0.0);
    EXPECT_SAME(fm_exp(LARGEST), INF);
    EXPECT_SAME(fm_exp(-LARGEST), 0.0);
    EXPECT_SAME(fm_exp(800.0), INF);
    EXPECT_SAME(fm_exp(-800.0), 0.0);
    EXPECT_LT(fm_exp(0x1.62e42fefa39efp+9), INF) << "the largest argument without overflow";
    EXPECT_SAME(fm_exp(std::nextafter(0x1.62e42fefa39efp+9, INF)), INF);
    EXPECT_SAME(fm_exp(-745.13), SMALLEST);
    EXPECT_SAME(fm_exp(-745.14), 0.0);
}

TEST(SpecialCases, Logarithm)
{
    EXPECT_SAME(fm_log(1.0), 0.0);
    EXPECT_SAME(fm_log(0.0), -INF);
    EXPECT_SAME(fm_log(-0.0), -INF);
    EXPECT_SAME(fm_log(INF), INF);
    for (const double x : {SMALLEST, 1.0, LARGEST, INF}) {
        EXPECT_SAME(fm_log(-x), NAN);
    }
}

TEST(SpecialCases, Power)
{
    for (const double x : {0.0, SMALLEST, 0.5, 1.0, 3.0, LARGEST, INF, static_cast<double>(NAN)}) {
        for (const double sign : {1.0, -1.0}) {
            EXPECT_SAME(fm_pow(sign * x, 0.0), 1.0);
            EXPECT_SAME(fm_pow(sign * x, -0.0), 1.0);
            EXPECT_SAME(fm_pow(1.0, sign * x), 1.0);
        }
        EXPECT_SAME(fm_pow(NAN, x), x == 0.0 ? 1.0 : static_cast<double>(NAN));
        EXPECT_SAME(fm_pow(x, NAN), x == 1.0 ? 1.0 : static_cast<double>(NAN));
    }
    EXPECT_SAME(fm_pow(-1.0, NAN), NAN);
    for (const double y : {1.0, 3.0, 0x1.fffffffffffffp+52}) { // odd
        EXPECT_SAME(fm_pow(0.0, y), 0.0);
        EXPECT_SAME(fm_pow(-0.0, y), -0.0);
        EXPECT_SAME(fm_pow(0.0, -y), INF);
        EXPECT_SAME(fm_pow(-0.0, -y), -INF);
        EXPECT_SAME(fm_pow(-INF, y), -INF);
        EXPECT_SAME(fm_pow(-INF, -y), -0.0);
        EXPECT_SAME(fm_pow(-1.0, y), -1.0);
    }
    for (const double y : {0.5, 2.0, 2.5, 0x1p52, 0x1p53, 0x1.8p54, LARGEST, INF}) {
        EXPECT_SAME(fm_pow(0.0, y), 0.0);
        EXPECT_SAME(fm_pow(-0.0, y), 0.0);
        EXPECT_SAME(fm_pow(0.0, -y), INF);
        EXPECT_SAME(fm_pow(-0.0, -y), INF);
        EXPECT_SAME(fm_pow(INF, y), INF);
        EXPECT_SAME(fm_pow(INF, -y), 0.0);
        EXPECT_SAME(fm_pow(-INF, y), INF);
        EXPECT_SAME(fm_pow(-INF, -y), 0.0);
    }
    for (const double y : {2.0, 0x1p52, 0x1p66, LARGEST, INF}) {
        EXPECT_SAME(fm_pow(-1.0, y), 1.0);
        EXPECT_SAME(fm_pow(-1.0, -y), 1.0);
    }
    for (const double y : {0.5, -0.5, 1.5, 0x1.8p+1 + 0x1p-51, 0x1.fffffffffffffp+51, SMALLEST}) { // no integers
        EXPECT_SAME(fm_pow(-2.0, y), NAN);
        EXPECT_SAME(fm_pow(-SMALLEST, y), NAN);
        EXPECT_SAME(fm_pow(-LARGEST, y), NAN);
    }
    for (const double y : {0x1.fffffffffffffp64, 0x1p65, 0x1.0000000000001p65, 0x1p80, LARGEST, INF}) {
        EXPECT_SAME(fm_pow(std::nextafter(1.0, 2.0), y), INF);
        EXPECT_SAME(fm_pow(std::nextafter(1.0, 2.0), -y), 0.0);
        EXPECT_SAME(fm_pow(std::nextafter(1.0, 0.0), y), 0.0);
        EXPECT_SAME(fm_pow(std::nextafter(1.0, 0.0), -y), INF);
        EXPECT_SAME(fm_pow(-2.0, y), INF);
        EXPECT_SAME(fm_pow(-2.0, -y), 0.0);
    }
    for (const double y : {0x1.fffffffffffffp-66, 0x1p-65, SMALLEST}) {
        for (const double x : {SMALLEST, 0.5, 2.0, LARGEST}) {
            EXPECT_SAME(fm_pow(x, y), 1.0);
            EXPECT_SAME(fm_pow(x, -y), 1.0);
        }
    }
    EXPECT_SAME(fm_pow(2.0, 1024.0), INF);
    EXPECT_SAME(fm_pow(-2.0, 1025.0), -INF);
    EXPECT_SAME(fm_pow(2.0, 1200.0), INF);
    EXPECT_SAME(fm_pow(2.0, -1075.0), 0.0);
    EXPECT_SAME(fm_pow(-2.0, -1201.0), -0.0);
    EXPECT_SAME(fm_pow(-2.0, -1074.0), SMALLEST);
    EXPECT_SAME(fm_pow(SMALLEST, -1.0), INF);
    EXPECT_SAME(fm_pow(0x1p-1060, 0.5), 0x1p-530);
    EXPECT_SAME(fm_pow(LARGEST, 1.0), LARGEST);
    EXPECT_SAME(fm_pow(3.0 * SMALLEST, 1.0), 3.0 * SMALLEST);
}

TEST(SpecialCases, SquareRootAndMagnitude)
{
    EXPECT_SAME(fm_sqrt(2.0), 0x1.6a09e667f3bcdp+0);
    EXPECT_SAME(fm_sqrt(-0.0), -0.0);
    EXPECT_SAME(fm_abs(-0.0), 0.0);
    EXPECT_SAME(fm_abs(-INF), INF);
}

} // namespace elementary_test
