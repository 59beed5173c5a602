// SPDX-License-Identifier: Apache-2.0
#include "flight/exec/bounds.h"
#include "flight/exec/element.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace element_test {

template <class T> void expect_round_trip(FledgeType type)
{
    EXPECT_EQ(element_size(type), sizeof(T));
    const double lowest = static_cast<double>(std::numeric_limits<T>::lowest());
    const double highest = static_cast<double>(std::numeric_limits<T>::max());
    for (const double x :
         {-1e300, -9.1e15, -70000.0, -129.0, -2.5, -0.4, 0.0, 0.5, 1.49, 200.0, 33000.0, 3e9, 9.1e15}) {
        unsigned char memory[16];
        std::fill(std::begin(memory), std::end(memory), static_cast<unsigned char>(0xA5));
        if (std::is_same_v<T, float> && std::abs(x) > highest) {
            continue; // no float: what the conversion gives is not defined
        }
        element_write(type, memory + 1, x);
        double expected = static_cast<double>(static_cast<float>(x));
        if (std::is_same_v<T, double>) {
            expected = x;
        } else if (std::is_integral_v<T>) {
            expected = std::clamp(std::round(x), std::max(lowest, -9.0e15), std::min(highest, 9.0e15));
        }
        EXPECT_EQ(element_read(type, memory + 1), expected) << x;
        EXPECT_EQ(memory[0], 0xA5);
        EXPECT_EQ(memory[1 + sizeof(T)], 0xA5) << "no wider than its type";
    }
}

TEST(Element, IsWrittenAndReadInItsWidthAndRange)
{
    expect_round_trip<double>(FLEDGE_F64);
    expect_round_trip<float>(FLEDGE_F32);
    expect_round_trip<std::int8_t>(FLEDGE_I8);
    expect_round_trip<std::uint8_t>(FLEDGE_U8);
    expect_round_trip<std::int16_t>(FLEDGE_I16);
    expect_round_trip<std::uint16_t>(FLEDGE_U16);
    expect_round_trip<std::int32_t>(FLEDGE_I32);
    expect_round_trip<std::int32_t>(FLEDGE_ENUM);
    expect_round_trip<std::uint32_t>(FLEDGE_U32);
    expect_round_trip<std::int64_t>(FLEDGE_I64);
    expect_round_trip<std::uint64_t>(FLEDGE_U64);
    EXPECT_EQ(element_size(FLEDGE_CHAR), 1u);
    EXPECT_EQ(element_size(FLEDGE_STRUCT), 0u);
    for (const FledgeType type : {FLEDGE_CHAR, FLEDGE_STRUCT, static_cast<FledgeType>(FLEDGE_STRUCT + 1)}) {
        char text[] = "text"; // no number is read or written
        EXPECT_EQ(element_read(type, text), 0.0);
        element_write(type, text, 7.0);
        EXPECT_STREQ(text, "text");
    }
}

TEST(Bounds, NumbersOfAnyQuantityAreComputable)
{
    for (const double sign : {-1.0, 1.0}) {
        for (const auto &[x, good] : {std::pair{0.0, 1},
                                      {1e-101, 0},
                                      {1e-100, 1},
                                      {1e100, 1},
                                      {1e101, 0},
                                      {std::numeric_limits<double>::infinity(), 0},
                                      {std::numeric_limits<double>::quiet_NaN(), 0}}) {
            EXPECT_EQ(exec_computable(sign * x), good) << sign * x;
        }
    }
}

TEST(Bounds, AreOpenOrClosedOnEitherSide)
{
    for (unsigned bounds = 0; bounds < 16; bounds++) {
        for (const double x : {0.5, 1.0, 1.5, 2.0, 2.5}) {
            const bool low = !(bounds & FLEDGE_HAS_LO) || x > 1.0 || (x == 1.0 && !(bounds & FLEDGE_LO_OPEN));
            const bool high = !(bounds & FLEDGE_HAS_HI) || x < 2.0 || (x == 2.0 && !(bounds & FLEDGE_HI_OPEN));
            EXPECT_EQ(exec_within(bounds, 1.0, 2.0, x), low && high) << bounds << " " << x;
        }
    }
    EXPECT_FALSE(exec_within(FLEDGE_HAS_LO, 1.0, 0.0, std::numeric_limits<double>::quiet_NaN()));
    EXPECT_FALSE(exec_within(FLEDGE_HAS_HI, 0.0, 1.0, std::numeric_limits<double>::quiet_NaN()));
}

/// The inertia of principal moments a, b, c, turned by 0.4 rad about the third axis.
ExecInertia turned(double a, double b, double c, double asymmetry = 0.0)
{
    const double k = std::cos(0.4), s = std::sin(0.4);
    double m[3][3] = {{k * k * a + s * s * b, k * s * (a - b) + asymmetry, 0.0},
                      {k * s * (a - b), s * s * a + k * k * b, 0.0},
                      {0.0, 0.0, c}};
    return exec_inertia(m);
}

TEST(Inertia, IsThatOfABodyByItsPrincipalMoments)
{
    EXPECT_EQ(turned(3.0, 4.0, 5.0), EXEC_INERTIA_GOOD);
    EXPECT_EQ(turned(3.0, 4.0, 7.0), EXEC_INERTIA_GOOD) << "flat";
    EXPECT_EQ(turned(3.0, 4.0, 7.1), EXEC_INERTIA_NO_BODY);
    EXPECT_EQ(turned(8.0, 4.0, 3.0), EXEC_INERTIA_NO_BODY);
    EXPECT_EQ(turned(3.0, 4.0, -1.0), EXEC_INERTIA_INDEFINITE);
    EXPECT_EQ(turned(-3.0, -4.0, -5.0), EXEC_INERTIA_INDEFINITE);
    EXPECT_EQ(turned(3.0, 4.0, 5.0, 1e-3), EXEC_INERTIA_ASYMMETRIC);
    EXPECT_EQ(turned(3.0, 4.0, 5.0, -1e-3), EXEC_INERTIA_ASYMMETRIC);
    EXPECT_EQ(turned(3.0, 4.0, 5.0, 1e-12), EXEC_INERTIA_GOOD) << "rounding";
}

} // namespace element_test
