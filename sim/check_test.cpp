// SPDX-License-Identifier: Apache-2.0
#include "sim/error.h"
#include "sim/instance.h"
#include "sim/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace check_test {

using namespace fledge::sim;
using testing::HasSubstr;

struct Values {
    double x;
    double axes[3][3];
    double I[3][3];
    std::uint32_t n, spare;
    double several[2][3][3];
};

FledgeField field(const char *name, std::size_t offset, std::initializer_list<std::uint32_t> shape)
{
    FledgeField f{};
    f.name = name;
    f.offset = static_cast<std::uint32_t>(offset);
    f.type = FLEDGE_F64;
    f.group = FLEDGE_PAR;
    f.unit = "kg m^2";
    f.doc = "";
    f.size = 8;
    for (std::uint32_t n : shape) {
        f.shape[f.ndim++] = n;
        f.size *= n;
    }
    return f;
}

/// The error of checking the i-th field of these values; "" if there is none.
struct Checker {
    Checker()
    {
        list[0] = field("x", offsetof(Values, x), {});
        list[1] = field("axes", offsetof(Values, axes), {3, 3});
        list[2] = field("I", offsetof(Values, I), {3, 3});
        list[3] = field("n", offsetof(Values, n), {});
        list[3].type = FLEDGE_U32;
        list[3].size = 4;
        list[4] = field("several", offsetof(Values, several), {2, 3, 3});
        list[4].flags = FLEDGE_INERTIA;
        list[4].count = "n";
        type.n = 5;
        type.fields = list;
    }
    std::string operator()(int i) const
    {
        try {
            check_field(type, list[i], reinterpret_cast<const std::byte *>(&values), "flight.thing");
        } catch (const SetupError &error) {
            return error.what();
        }
        return "";
    }
    FledgeField list[5];
    FledgeStruct type{};
    Values values{};
};

void set_inertia(Checker &check, double a, double b, double c, double ab = 0.0)
{
    const double I[3][3] = {{a, ab, 0}, {ab, b, 0}, {0, 0, c}};
    std::memcpy(check.values.I, I, sizeof I);
}

TEST(Check, Bounds)
{
    Checker check;
    check.list[0].bounds = FLEDGE_HAS_LO | FLEDGE_LO_OPEN;
    EXPECT_EQ(check(0), "flight.thing.x must be > 0 kg m^2, found 0 kg m^2");
    check.values.x = 0.25;
    EXPECT_EQ(check(0), "");
    check.list[0].bounds = FLEDGE_HAS_LO | FLEDGE_HAS_HI | FLEDGE_HI_OPEN;
    check.list[0].hi = 0.25;
    EXPECT_EQ(check(0), "flight.thing.x must be in [0, 0.25) kg m^2, found 0.25 kg m^2");
    check.values.x = std::nextafter(0.25, 0.0);
    EXPECT_EQ(check(0), "");
}

TEST(Check, WhatIsNotFinite)
{
    Checker check;
    check.values.x = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(check(0), "flight.thing.x must be finite, found nan kg m^2");
    check.values.axes[2][1] = std::numeric_limits<double>::infinity();
    EXPECT_THAT(check(1), HasSubstr("found inf kg m^2 at [2, 1]"));
}

TEST(Check, WhatCannotBeComputedWith)
{
    Checker check;
    for (const double x : {1e-320, -1e-320, 1e-160, 9e-101, 2e100, -1e160, 1.7e308}) {
        check.values.x = x;
        EXPECT_THAT(check(0), HasSubstr("flight.thing.x must be 0 or of a size from 1e-100 to 1e+100 kg m^2, found"));
    }
    for (const double x : {0.0, -0.0, 1e-100, -1e-100, 1e100, -1e100}) {
        check.values.x = x;
        EXPECT_EQ(check(0), "");
    }
    check.list[1].flags = FLEDGE_NON_ZERO;
    check.values.axes[0][0] = check.values.axes[1][1] = check.values.axes[2][2] = 1.0;
    EXPECT_EQ(check(1), "");
    check.values.axes[1][1] = 1e160;
    EXPECT_THAT(check(1), HasSubstr("found 1e+160 kg m^2 at [1, 1]"));
}

TEST(Check, OnlyTheRowsThatCount)
{
    Checker check;
    check.list[1].flags = FLEDGE_NON_ZERO;
    check.list[1].count = "n";
    check.values.n = 1;
    EXPECT_EQ(check(1), "flight.thing.axes must have a length, found zero at [0]");
    check.values.axes[0][2] = -1.0;
    EXPECT_EQ(check(1), "");
    check.values.n = 2;
    EXPECT_EQ(check(1), "flight.thing.axes must have a length, found zero at [1]");
}

TEST(Check, Inertia)
{
    Checker check;
    check.list[2].flags = FLEDGE_INERTIA;
    set_inertia(check, 700, 700, 800);
    EXPECT_EQ(check(2), "");
    set_inertia(check, 1, 2, 3); // a flat plate
    EXPECT_EQ(check(2), "");
    set_inertia(check, 1, 2, 3.01);
    EXPECT_THAT(check(2), HasSubstr("is that of no body"));
    set_inertia(check, 3, 3, 3, 3.0); // singular
    EXPECT_THAT(check(2), HasSubstr("must be positive definite"));
    set_inertia(check, 0.6, 0.6, 1.2, 0.6); // singular but for rounding
    check.values.I[0][0] = std::nextafter(0.6, 1.0);
    EXPECT_THAT(check(2), HasSubstr("must be positive definite"));
    set_inertia(check, 10, 12, 8, 2.0);
    EXPECT_EQ(check(2), "");
    check.values.I[0][1] = 1.0;
    EXPECT_THAT(check(2), HasSubstr("must be symmetric"));
    set_inertia(check, -5, 5, 5);
    EXPECT_THAT(check(2), HasSubstr("must be positive definite"));
    set_inertia(check, 0, 0, 0);
    EXPECT_THAT(check(2), HasSubstr("must be positive definite"));
}

TEST(Check, EachOfSeveralInertias)
{
    Checker check;
    check.values.n = 2;
    for (auto &I : check.values.several) {
        I[0][0] = I[1][1] = I[2][2] = 1.0;
    }
    EXPECT_EQ(check(4), "");
    check.values.several[1][2][2] = 3.0;
    EXPECT_EQ(check(4), "flight.thing.several is that of no body: a principal moment exceeds the sum of the others, "
                        "found [[1, 0, 0], [0, 1, 0], [0, 0, 3]] kg m^2 at [1]");
    check.values.n = 1;
    EXPECT_EQ(check(4), "") << "one that does not count";
    check.values.several[0][0][1] = 0.5;
    EXPECT_EQ(check(4),
              "flight.thing.several must be symmetric, found [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]] kg m^2 at [0]");
}

TEST(Text, IsShortAndExact)
{
    EXPECT_EQ(format_number(0.1), "0.1");
    EXPECT_EQ(format_number(-0.0), "-0");
    EXPECT_EQ(format_number(1e300), "1e+300");
    EXPECT_EQ(format_time(0), "0 s");
    EXPECT_EQ(format_time(1'500'000'000), "1.5 s");
    EXPECT_EQ(format_time(-1), "-0.000000001 s");
    EXPECT_EQ(format_list({"a", "b", "c"}), "a, b and c");
    EXPECT_EQ(format_list({}), "(none)");
}

} // namespace check_test
