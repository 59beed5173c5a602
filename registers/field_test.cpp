// SPDX-License-Identifier: Apache-2.0
#include "registers/field.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace field_test {

RegisterField field(double scale, double offset, int lsb, int bits, bool is_signed)
{
    return {"f", "V", scale, offset, static_cast<std::uint8_t>(lsb), static_cast<std::uint8_t>(bits), is_signed, 0,
            0,   0,   0,     0};
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

RegisterField packed(int bits, bool is_signed, bool is_float, bool little, double scale = 1, double offset = 0)
{
    RegisterField f = field(scale, offset, 0, bits, is_signed);
    f.at = 3; // no multiple of its size
    f.count = 2;
    f.is_float = is_float;
    f.little_endian = little;
    return f;
}

TEST(Field, NumbersInPacketsStandAsTheirTypeAndOrderSay)
{
    std::uint8_t packet[3 + 2 * 8];
    const auto bytes = [&](const RegisterField &f, double value) {
        std::memset(packet, 0xEE, sizeof packet);
        EXPECT_EQ(register_field_write(&f, packet, 1, value), 0);
        EXPECT_EQ(register_field_read(&f, packet, 1), value);
        const int n = f.bits / 8;
        for (int i = 0; i < 3 + n; i++) {
            EXPECT_EQ(packet[i], 0xEE);
        }
        std::uint64_t raw = 0;
        for (int i = 0; i < n; i++) {
            raw = raw << 8 | packet[3 + n + i];
        }
        return raw;
    };
    EXPECT_EQ(bytes(packed(16, true, false, false), -2), 0xFFFEu);
    EXPECT_EQ(bytes(packed(16, true, false, true), -2), 0xFEFFu);
    EXPECT_EQ(bytes(packed(32, false, false, false), 4294967295.0), 0xFFFFFFFFu);
    EXPECT_EQ(bytes(packed(8, true, false, true), -128), 0x80u);
    EXPECT_EQ(bytes(packed(64, true, false, false), -9007199254740992.0), 0xFFE0000000000000u);
    EXPECT_EQ(bytes(packed(64, false, false, false), 9007199254740992.0), 0x0020000000000000u);
    EXPECT_EQ(bytes(packed(32, true, true, false), -1.5), 0xBFC00000u); // IEEE 754, binary32
    EXPECT_EQ(bytes(packed(32, true, true, true), -1.5), 0x0000C0BFu);
    EXPECT_EQ(bytes(packed(64, true, true, false), 1.0), 0x3FF0000000000000u);
    EXPECT_EQ(bytes(packed(64, true, true, false), -0.0), 0x8000000000000000u);
    EXPECT_EQ(bytes(packed(16, false, false, false, 0.25, -1), 3.5), 18u); // (3.5 + 1) / 0.25
    EXPECT_EQ(bytes(packed(32, true, true, false, 0.5, 1), 2.0), 0x40000000u);
}

TEST(Field, BeyondItsTypeANumberInAPacketIsLimited)
{
    std::uint8_t packet[3 + 2 * 8] = {};
    for (const auto &[f, value, limit] : {std::tuple{packed(16, true, false, false), 40000.0, 32767.0},
                                          {packed(8, false, false, false), -1.0, 0.0},
                                          {packed(64, true, false, false), 1e300, 9223372036854775807.0},
                                          {packed(64, true, false, true), -1e300, -9223372036854775808.0},
                                          {packed(64, false, false, true), -5.0, 0.0}}) {
        EXPECT_EQ(register_field_write(&f, packet, 0, value), 1);
        EXPECT_EQ(register_field_read(&f, packet, 0), limit);
    }
    const RegisterField f = packed(32, true, true, false);
    EXPECT_EQ(register_field_write(&f, packet, 0, std::nan("")), 0);
    EXPECT_TRUE(std::isnan(register_field_read(&f, packet, 0)));
}

} // namespace field_test
