// SPDX-License-Identifier: Apache-2.0
// Doubles and their text against the C library, which converts exactly, too. FLEDGE_CASES: how many random ones.
#include "targets/micropython/decimal.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

namespace decimal_test {

unsigned cases()
{
    const char *given = std::getenv("FLEDGE_CASES");
    return given ? static_cast<unsigned>(std::strtoul(given, nullptr, 10)) : 3000u;
}

std::string expected(double value, char format, int precision)
{
    char text[1500];
    const char words[] = {'%', '.', '*', format, 0};
    std::snprintf(text, sizeof text, words, precision, value); // NOLINT
    return text;
}

std::string written(double value, char format, int precision, size_t size = 1500, char sign = 0)
{
    char text[1500];
    const int n = decimal_format(value, text, size, format, precision, sign);
    EXPECT_EQ(std::string(text).size(), static_cast<size_t>(n));
    return text;
}

void check_read(const std::string &text)
{
    EXPECT_EQ(std::bit_cast<uint64_t>(decimal_read(text.data(), text.size())),
              std::bit_cast<uint64_t>(std::strtod(text.c_str(), nullptr)))
        << text;
}

// Of all sizes: random bits, subnormal numbers, those near powers of two, and short ones as people write them.
double some(std::mt19937_64 &random, unsigned i)
{
    const uint64_t bits = random();
    switch (i % 4) {
    case 0: return std::bit_cast<double>(bits & ~(UINT64_C(0x400) << 52 & -(bits >> 62 == 3)));
    case 1: return std::bit_cast<double>(bits & 0x800FFFFFFFFFFFFF >> (bits >> 58));
    case 2:
        return std::ldexp(1.0, static_cast<int>(bits % 2090) - 1074) *
               (1.0 - static_cast<double>(bits >> 62) * 0x1p-53);
    default: return static_cast<double>(static_cast<int64_t>(bits % 2000001) - 1000000) / 1000.0;
    }
}

// The C library rounds behind the point as it writes; before it, whole numbers are rounded as integers.
TEST(Decimal, RoundsAsTheCLibrary)
{
    std::mt19937_64 random(7);
    for (unsigned i = 0; i < cases(); i++) {
        const double value = some(random, i);
        if (!std::isfinite(value)) {
            continue;
        }
        const int digits = static_cast<int>(random() % (i % 2 ? 340 : 8));
        const double wanted = std::strtod(expected(value, 'f', digits).c_str(), nullptr);
        EXPECT_EQ(std::bit_cast<uint64_t>(decimal_round(value, digits)), std::bit_cast<uint64_t>(wanted))
            << value << " to " << digits;
        const int64_t number = static_cast<int64_t>(random() % 2'000'001) * 5 - 5'000'000;
        const int64_t unit = i % 3 == 0 ? 10 : i % 3 == 1 ? 100 : 1000;
        const int64_t below = (number - (number % unit + unit) % unit) / unit, rest = number - below * unit;
        const int64_t whole = below + (2 * rest > unit || (2 * rest == unit && below % 2 != 0));
        EXPECT_EQ(decimal_round(static_cast<double>(number), i % 3 == 0   ? -1
                                                             : i % 3 == 1 ? -2
                                                                          : -3),
                  static_cast<double>(whole * unit))
            << number;
    }
}

TEST(Decimal, RoundsAtTheEnds)
{
    const auto same = [](double got, double wanted) {
        EXPECT_EQ(std::bit_cast<uint64_t>(got), std::bit_cast<uint64_t>(wanted)) << got << " " << wanted;
    };
    same(decimal_round(2.675, 2), 2.67); // 2.67499999999999982236431605997495353221893310546875
    same(decimal_round(0.125, 2), 0.12);
    same(decimal_round(0.375, 2), 0.38);
    same(decimal_round(-0.004, 2), -0.0);
    same(decimal_round(-0.0, 1), -0.0);
    same(decimal_round(5.0, -1), 0.0);
    same(decimal_round(15.0, -1), 20.0);
    same(decimal_round(5.000001, -1), 10.0);
    same(decimal_round(9.99, 1), 10.0);
    same(decimal_round(1.7976931348623157e308, -308), INFINITY);
    same(decimal_round(-1.7976931348623157e308, -309), -0.0);
    same(decimal_round(5e-324, 400), 5e-324);
    same(decimal_round(5e-324, 323), 0.0);
    for (const double x : {1.25, 5e-324, 1.7976931348623157e308}) {
        same(decimal_round(-x, INT64_MAX), -x);
        same(decimal_round(-x, INT64_MIN), -0.0);
    }
    same(decimal_round(-INFINITY, 2), -INFINITY);
    EXPECT_TRUE(std::isnan(decimal_round(NAN, 2)));
}

TEST(Decimal, RandomDoublesAreReadAndWrittenAsTheCLibraryDoes)
{
    std::mt19937_64 random(7);
    for (unsigned i = 0; i < cases(); i++) {
        const double value = some(random, i);
        if (std::isnan(value)) {
            continue;
        }
        const int precision = static_cast<int>(random() % 30);
        const char format = "efgEFG"[random() % 6];
        EXPECT_EQ(written(value, format, precision), expected(value, format, precision));
        if (std::isfinite(value)) {
            check_read(expected(std::fabs(value), 'e', precision));
            const std::string shortest = written(std::fabs(value), 'g', DECIMAL_SHORTEST);
            EXPECT_EQ(std::strtod(shortest.c_str(), nullptr), std::fabs(value)) << shortest;
        }
    }
}

// The text of what lies exactly between two doubles, all its digits; and the same a little above and below.
TEST(Decimal, TiesGoToTheEvenDouble)
{
    std::mt19937_64 random(3);
    for (unsigned i = 0; i < cases() / 10; i++) {
        const double value = std::fabs(some(random, i));
        if (!(value < 1e300) || value == 0.0) {
            continue;
        }
        const auto next = static_cast<long double>(std::nextafter(value, INFINITY));
        char text[1500];
        std::snprintf(text, sizeof text, "%.1100Le", (static_cast<long double>(value) + next) / 2);
        const std::string half = text, digits = half.substr(0, half.find('e')), power = half.substr(half.find('e'));
        check_read(half);
        check_read(digits + "1" + power);
        std::string below = digits;
        const size_t last = below.find_last_not_of("0.");
        below[last]--;
        check_read(below + "9" + power);
    }
}

TEST(Decimal, HardCasesAreExact)
{
    for (const char *text : {"0",
                             "0.0",
                             "00.000e5",
                             "1",
                             "5e-324",
                             "2.4703282292062327e-324",
                             "2.4703282292062328e-324",
                             "2.225073858507201e-308",
                             "2.2250738585072011e-308",
                             "2.2250738585072014e-308",
                             "1.7976931348623157e308",
                             "1.7976931348623158e308",
                             "1.7976931348623159e308",
                             "1e309",
                             "1e400",
                             "1e-400",
                             "1e99999",
                             "1e-99999",
                             "1e999999999999",
                             "9007199254740993",
                             "9007199254740992.99999999999999999999999",
                             "0.1",
                             "0.30000000000000004",
                             "6.02214076e23",
                             "1e22",
                             "1e23",
                             "0.000000000000000000000000000000000000000000001",
                             "123456789012345678901234567890",
                             "1.",
                             ".5",
                             "8.5e-5",
                             "0e999999"}) {
        check_read(text);
    }
    check_read(std::string(2000, '9') + "e-2000");
    check_read("0." + std::string(400, '0') + "1e400");
    check_read("1" + std::string(400, '0') + "e-400");
    EXPECT_EQ(decimal_read("1_234.5e-6", 10), 1234.5e-6);
    EXPECT_EQ(decimal_read("12.5xyz", 7), 12.5);
    EXPECT_EQ(decimal_read("12.5", 2), 12.0);
}

TEST(Decimal, TheShortestTextIsThatOfPython)
{
    const struct {
        double value;
        const char *text;
    } known[] = {{0.1, "0.1"},
                 {1.0, "1"},
                 {-0.0, "-0"},
                 {1e22, "1e+22"},
                 {1e16, "1e+16"},
                 {1e15, "1000000000000000"},
                 {0.0001, "0.0001"},
                 {0.00001, "1e-05"},
                 {5e-324, "5e-324"},
                 {1.0 / 3.0, "0.3333333333333333"},
                 {1.7976931348623157e308, "1.7976931348623157e+308"},
                 {0.1 + 0.2, "0.30000000000000004"},
                 {123456.789, "123456.789"},
                 {INFINITY, "inf"},
                 {-INFINITY, "-inf"},
                 {NAN, "nan"},
                 {9007199254740993.0, "9007199254740992"},
                 {2.5e-310, "2.5e-310"}};
    for (const auto &example : known) {
        EXPECT_EQ(written(example.value, 'g', DECIMAL_SHORTEST, 32), example.text);
    }
}

TEST(Decimal, ATextStaysWithinItsMemory)
{
    for (size_t size = 0; size < 40; size++) {
        for (const double value : {1e300, -1e-300, 1234.5, 2e-308, 1e15, 123456789.0}) {
            for (const char format : {'e', 'f', 'g'}) {
                for (const int precision : {-1, 0, 5, 20, 126, +DECIMAL_SHORTEST}) {
                    std::string text(size + 1, '#');
                    const int n = decimal_format(value, text.data(), size, format, precision, '+');
                    EXPECT_EQ(text[size], '#');
                    EXPECT_LE(n, static_cast<int>(size > 0 ? size - 1 : 0));
                    if (size >= 10 && (format != 'f' || std::fabs(value) > 1.0)) {
                        EXPECT_NEAR(std::strtod(text.c_str(), nullptr) / value, 1.0, 0.5) << text;
                    }
                }
            }
        }
    }
    EXPECT_EQ(written(1e300, 'f', 3, 36), "1.000e+300");
    EXPECT_EQ(written(1.5, 'f', 2, 36, '+'), "+1.50");
    EXPECT_EQ(written(1.5, 'F', -1), "1.500000");
}

} // namespace decimal_test
