// SPDX-License-Identifier: Apache-2.0
#include "registers/field.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace {

RegisterField field(double scale, double offset, int lsb, int bits, bool is_signed)
{
    return {"f", "V", scale, offset, static_cast<std::uint8_t>(lsb), static_cast<std::uint8_t>(bits), is_signed, 0};
}

TEST(Field, EveryCountComesBackAndNeighboursStay)
{
    std::mt19937 random(1);
    for (int i = 0; i < 20000; i++) {
        const int bits = 1 + static_cast<int>(random() % 32);
        const int lsb = static_cast<int>(random() % (33 - bits));
        const RegisterField f = field(0.3, -2, lsb, bits, random() % 2);
        const std::uint32_t word = random();
        const std::int64_t count = register_field_count(&f, random());
        const std::uint32_t placed = register_field_place(&f, word, count);
        ASSERT_EQ(register_field_count(&f, placed), count);
        const std::uint32_t own = (0xffffffffu >> (32 - bits)) << lsb;
        ASSERT_EQ(placed & ~own, word & ~own);
        int saturated;
        ASSERT_EQ(register_field_quantise(&f, register_field_value(&f, count), &saturated), count);
        ASSERT_FALSE(saturated);
    }
}

TEST(Field, AValueIsHalfACountOffAtMostWithinTheRange)
{
    const RegisterField f = field(-0.0025, 1.0, 4, 12, true);
    std::mt19937 random(2);
    std::uniform_real_distribution<double> values(1.0 - 0.0025 * 2047, 1.0 + 0.0025 * 2048);
    for (int i = 0; i < 20000; i++) {
        const double v = values(random);
        int saturated;
        const std::int64_t count = register_field_quantise(&f, v, &saturated);
        ASSERT_FALSE(saturated);
        ASSERT_LE(std::abs(register_field_value(&f, count) - v), 0.00125 * (1 + 1e-9));
    }
}

TEST(Field, RoundingIsOfTheNearest)
{
    const RegisterField f = field(1, 0, 0, 8, true);
    const double just_below = std::nextafter(0.5, 0);
    for (const auto &[value, count] :
         {std::pair{0.5, 1}, {-0.5, -1}, {just_below, 0}, {-just_below, 0}, {2.5, 3}, {-2.5, -3}, {126.5, 127}}) {
        EXPECT_EQ(register_field_quantise(&f, value, nullptr), count) << value;
    }
}

TEST(Field, BeyondTheEndsItSaturates)
{
    const double inf = std::numeric_limits<double>::infinity();
    for (bool is_signed : {false, true}) {
        for (int bits : {1, 12, 32}) {
            const RegisterField f = field(1, 0, 0, bits, is_signed);
            const double span = std::ldexp(1, bits);
            const std::int64_t low = is_signed ? static_cast<std::int64_t>(-span / 2) : 0;
            const std::int64_t high = low + static_cast<std::int64_t>(span) - 1;
            int saturated;
            for (double v : {inf, 1e300, static_cast<double>(high) + 0.5}) {
                EXPECT_EQ(register_field_quantise(&f, v, &saturated), high);
                EXPECT_TRUE(saturated);
            }
            for (double v : {-inf, -1e300, std::nan(""), static_cast<double>(low) - 0.5}) {
                EXPECT_EQ(register_field_quantise(&f, v, &saturated), low);
                EXPECT_TRUE(saturated);
            }
        }
    }
}

} // namespace
