// SPDX-License-Identifier: Apache-2.0
#include "world/environment/text_kernel.h"

#include "sim/error.h"
#include "world/environment/testing/files.h"

namespace fledge::world {
namespace text_kernel_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::real_file;

TextKernel data(const std::string &text)
{
    return TextKernel::parse("KPL/PCK\n\\begindata\n" + text, "test.tpc");
}

TEST(TextKernel, AllWaysToWriteValues)
{
    const TextKernel kernel = TextKernel::parse("A = 0 is a comment\n"
                                                "  \\begindata  \r\n"
                                                "A=(1,2\r\n"
                                                "    ,-3.5D+2 +4 .5 6.)\n"
                                                "B = 7e-1\n"
                                                "B += ( 8 9 )\n"
                                                "C = 'it''s (one) = string'\n"
                                                "T = ( 10, @1972-JAN-1 )\n"
                                                "\\begintext\n"
                                                "B = 100\n"
                                                "\\begindata\n"
                                                "D = 1\n"
                                                "D = 2",
                                                "test.tpc");
    EXPECT_THAT(kernel.numbers("A", 1, 9), ElementsAre(1, 2, -350, 4, 0.5, 6));
    EXPECT_THAT(kernel.numbers("B", 1, 9), ElementsAre(0.7, 8, 9));
    EXPECT_EQ(kernel.values("C")[0].text, "it's (one) = string");
    EXPECT_EQ(kernel.values("T")[1].text, "@1972-JAN-1");
    EXPECT_EQ(kernel.values("T")[1].line, 8u);
    EXPECT_EQ(kernel.number("D"), 2);
    EXPECT_THAT(kernel.names(), ElementsAre("A", "B", "C", "D", "T"));
}

TEST(TextKernel, WhatIsDamagedIsRefusedWithItsLine)
{
    const auto error = [](const std::string &text) { return error_of([&] { data(text); }); };
    EXPECT_THROW(data("A = ( 1"), sim::SetupError);
    EXPECT_THAT(error("A = ( 1\n2"), HasSubstr("test.tpc:4: expected ) at the end of the values of A, "
                                               "which line 3 begins; found the end of the file"));
    EXPECT_THAT(error("A = ( 1\nB = 2"), HasSubstr("is no number"));
    EXPECT_THAT(error("A = ( 1\n= 2 )"), HasSubstr("test.tpc:4: expected )"));
    EXPECT_THAT(error("A = 1 2"), HasSubstr("test.tpc:3: expected = or += after 2"));
    EXPECT_THAT(error("A"), HasSubstr("test.tpc:3: expected = or += after A"));
    EXPECT_THAT(error("\n= 1"), HasSubstr("test.tpc:4: expected a name"));
    EXPECT_THAT(error("A = ()"), HasSubstr("test.tpc:3: A has no value"));
    EXPECT_THAT(error("A = 1.2.3"), HasSubstr("\"1.2.3\" of A is no number"));
    EXPECT_THAT(error("A = 1x"), HasSubstr("is no number"));
    EXPECT_THAT(error("A = nan"), HasSubstr("is no number"));
    EXPECT_THAT(error("A = 1D999"), HasSubstr("is no number"));
    EXPECT_THAT(error("A = 'x\n'"), HasSubstr("does not end in its line"));
    EXPECT_THAT(error_of([] { TextKernel::parse("DAF/SPK", "a.bsp"); }), HasSubstr("a.bsp: has no line \\begindata"));
    EXPECT_THAT(error_of([] { TextKernel::parse(std::string("DAF/PCK\0", 8), "a.bpc"); }),
                HasSubstr("holds binary data"));
}

TEST(TextKernel, ValuesThatAreNotThereOrNotAsExpectedAreNamed)
{
    const TextKernel kernel = data("A = ( 1 2 )\nB = 'x'");
    EXPECT_THAT(error_of([&] { kernel.number("C"); }), HasSubstr("does not define C; it defines A and B"));
    EXPECT_THAT(error_of([&] { kernel.number("A"); }), HasSubstr(":3: A has 2 values; expected 1"));
    EXPECT_THAT(error_of([&] { kernel.number("B"); }), HasSubstr(":4: expected numbers for B"));
}

TEST(TextKernel, NaifsPlanetaryConstants)
{
    const std::string path = real_file("pck00008.tpc");
    SKIP_WITHOUT(path);
    const TextKernel kernel = TextKernel::read(path);
    EXPECT_THAT(kernel.numbers("BODY499_RADII", 3, 3), ElementsAre(3396.19, 3396.19, 3376.20));
    EXPECT_THAT(kernel.numbers("BODY301_PM", 3, 3), ElementsAre(38.3213, 13.17635815, -1.4e-12));
    EXPECT_EQ(kernel.numbers("BODY3_NUT_PREC_ANGLES", 26, 26)[25], 473327.79642);
    EXPECT_FALSE(kernel.has("BODY499_LONG_AXIS")); // given in a comment only
}

} // namespace text_kernel_test
} // namespace fledge::world
