// SPDX-License-Identifier: Apache-2.0
#include "ground/database/testing/database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <sstream>

namespace fledge::ground {

namespace decoder_test {

using namespace testing;
using ::testing::HasSubstr;

Bytes bytes_of(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// A packet with one value of a type.
std::string value(const std::string &type, const Bytes &packet)
{
    return decoded(file(type, "a:t", container("P", "a")), packet);
}

TEST(Decoder, PacketsOfJpss1HaveThePublishedValues)
{
    const std::string xml = real_file("ccsds/jpss1_geolocation_xtce_v1.xml");
    if (!std::ifstream(xml)) {
        GTEST_SKIP() << "not here: " << xml;
    }
    const Database database = read_xtce({{xml, ""}});
    const Bytes all = bytes_of(real_file("ccsds/jpss_first2000.dat"));
    std::ifstream truth(real_file("ccsds/jpss_truth_every10th.csv"));
    std::string line, name;
    std::vector<std::string> names;
    std::getline(truth, line);
    for (std::stringstream heads(line); std::getline(heads, name, ',');) {
        names.push_back(name);
    }
    Decoder fast(database), slow(database, false);
    int rows = 0;
    for (; std::getline(truth, line); rows++) {
        for (Decoder *decoder : {&fast, &slow}) {
            const Decoded &packet = decoder->decode(std::span(all).subspan(static_cast<std::size_t>(710 * rows), 71));
            ASSERT_EQ(database.containers[packet.container].name, "JPSS_ATT_EPHEM");
            ASSERT_EQ(packet.bits, 8u * 71);
            std::stringstream columns(line);
            for (const std::string &wanted : names) {
                std::string text;
                std::getline(columns, text, ',');
                for (std::size_t i = 0; i < packet.fields.size(); i++) {
                    if (decoder->name(packet, i) == wanted) {
                        const double value = packet.fields[i].value == Kind::natural
                                                 ? static_cast<double>(packet.values[i])
                                                 : std::bit_cast<double>(packet.values[i]);
                        EXPECT_EQ(value, std::stod(text)) << wanted << ", row " << rows;
                    }
                }
            }
        }
    }
    EXPECT_EQ(rows, 200);
}

TEST(Decoder, WordsInOddByteOrdersHaveThePublishedValues)
{
    const struct {
        const char *name;
        int bits;
        const char *order;
    } cases[] = {{"12", 16, "1,0"}, {"87654321", 64, "0,1,2,3,4,5,6,7"}};
    for (const auto &[name, bits, order] : cases) {
        const std::string path = real_file(std::string("ccsds/byteorder_") + name);
        if (!std::ifstream(path + ".bin")) {
            GTEST_SKIP() << "not here: " << path << ".bin";
        }
        const Bytes all = bytes_of(path + ".bin");
        const std::string repeat = "<ParameterRefEntry parameterRef='a'><LocationInContainerInBits><FixedValue>48"
                                   "</FixedValue></LocationInContainerInBits><RepeatEntry><Count><FixedValue>80"
                                   "</FixedValue></Count></RepeatEntry></ParameterRefEntry>";
        const std::string xml =
            file(integer("t", bits, std::string("byteOrder='") + order + "'"), "a:t", container("P", repeat));
        std::ifstream truth(path + ".csv");
        const std::size_t size = 6 + 10 * static_cast<std::size_t>(bits);
        std::size_t rows = 0;
        for (std::string line; std::getline(truth, line); rows++) {
            std::string wanted = "a=";
            for (const char c : line) {
                wanted += c == ',' ? " a=" : std::string(c != '\r', c);
            }
            const auto from = all.begin() + static_cast<std::ptrdiff_t>(rows * size);
            EXPECT_EQ(decoded(xml, Bytes(from, from + static_cast<std::ptrdiff_t>(size))), wanted);
        }
        EXPECT_EQ(rows * size, all.size());
    }
}

TEST(Decoder, NumbersOfEachEncoding)
{
    const std::string twos = "encoding='twosComplement'";
    EXPECT_EQ(value(integer("t", 8), {0x9C}), "a=156");
    EXPECT_EQ(value(integer("t", 8, twos), {0x9C}), "a=-100");
    EXPECT_EQ(value(integer("t", 12, twos), {0xFF, 0x80}), "a=-8");
    EXPECT_EQ(value(integer("t", 8, "encoding='onesComplement'"), {0xFE}), "a=-1");
    EXPECT_EQ(value(integer("t", 8, "encoding='signMagnitude'"), {0x81}), "a=-1");
    EXPECT_EQ(value(integer("t", 16, "encoding='packedBCD'"), {0x12, 0x39}), "a=1239");
    EXPECT_EQ(value(integer("t", 16, "encoding='BCD'"), {1, 9}), "a=19");
    EXPECT_EQ(value(integer("t", 16, "encoding='BCD'"), {1, 10}), "a=malformed");
    EXPECT_EQ(value(integer("t", 64), Bytes(8, 0xFF)), "a=18446744073709551615");
    EXPECT_EQ(value(integer("t", 64, twos), Bytes(8, 0xFF)), "a=-1");
    EXPECT_EQ(value(integer("t", 32, "byteOrder='1,0,3,2'"), {0x03, 0x04, 0x01, 0x02}), "a=16909060"); // 3412
    EXPECT_EQ(value(integer("t", 64, "byteOrder='1,0,3,2,5,4,7,6'"), {7, 8, 5, 6, 3, 4, 1, 2}),        // 78563412
              "a=72623859790382856");
    EXPECT_EQ(value(integer("t", 8, "bitOrder='leastSignificantBitFirst'"), {0x01}), "a=128");
    const auto real = [](const std::string &attributes) {
        return "<FloatParameterType name='t'><FloatDataEncoding " + attributes + "/></FloatParameterType>";
    };
    EXPECT_EQ(value(real("sizeInBits='32'"), {0x3F, 0xC0, 0, 0}), "a=1.5");
    EXPECT_EQ(value(real("sizeInBits='64' byteOrder='leastSignificantByteFirst'"), {0, 0, 0, 0, 0, 0, 0xF8, 0x3F}),
              "a=1.5");
    EXPECT_EQ(value(real("sizeInBits='16'"), {0xC0, 0x00}), "a=-2");
    // The examples of MIL-STD-1750A: 0.5 x 2^127, -1 x 2^127, 0.5 x 2^-128, -1 x 2^-1.
    const std::string mil = "sizeInBits='32' encoding='MILSTD_1750A'";
    EXPECT_EQ(value(real(mil), {0x40, 0, 0, 0x7F}), "a=8.5070591730234616e+37");
    EXPECT_EQ(value(real(mil), {0x80, 0, 0, 0x7F}), "a=-1.7014118346046923e+38");
    EXPECT_EQ(value(real(mil), {0x40, 0, 0, 0x80}), "a=1.4693679385278594e-39");
    EXPECT_EQ(value(real(mil), {0x80, 0, 0, 0xFF}), "a=-0.5");
    EXPECT_EQ(value(real("sizeInBits='48' encoding='MILSTD_1750A'"), {0x40, 0, 0, 0x7F, 0, 0}),
              "a=8.5070591730234616e+37");
}

TEST(Decoder, TextsOfEachForm)
{
    const auto text = [](const std::string &inside, const std::string &set = "UTF-8") {
        return "<StringParameterType name='t'><StringDataEncoding encoding='" + set + "'>" + inside +
               "</StringDataEncoding></StringParameterType>";
    };
    const std::string fixed = "<SizeInBits><Fixed><FixedValue>32</FixedValue></Fixed>";
    const std::string any = "<Variable maxSizeInBits='32'><DynamicValue><ParameterInstanceRef "
                            "parameterRef='_yamcs_ignore'/></DynamicValue>";
    EXPECT_EQ(value(text(fixed + "</SizeInBits>"), {'a', 'b', 'c', 'd'}), "a=abcd");
    EXPECT_EQ(value(text(fixed + "<TerminationChar>00</TerminationChar></SizeInBits>"), {'a', 0, 'c', 'd'}), "a=a");
    EXPECT_EQ(value(text(fixed + "<LeadingSize sizeInBitsOfSizeTag='8'/></SizeInBits>"), {2, 'b', 'c', 'd'}), "a=bc");
    EXPECT_EQ(value(text(any + "<TerminationChar>00</TerminationChar></Variable>"), {'a', 'b', 0}), "a=ab");
    EXPECT_EQ(value(text(any + "<LeadingSize sizeInBitsOfSizeTag='16'/></Variable>"), {0, 1, 'x'}), "a=x");
    EXPECT_THAT(value(text(any + "<LeadingSize sizeInBitsOfSizeTag='16'/></Variable>"), {0, 9, 'x'}),
                HasSubstr("t has a size of 9 bytes; there is room for 1"));
    EXPECT_EQ(value(text(fixed + "</SizeInBits>", "UTF-16"), {0xFF, 0xFE, 0xE4, 0}), "a=\u00e4");
    EXPECT_EQ(value(text(fixed + "</SizeInBits>", "UTF-16BE"), {0xD8, 0x3D, 0xDE, 0x80}), "a=\U0001F680");
    EXPECT_EQ(value(text(fixed + "</SizeInBits>", "Windows-1252"), {0x80, 0xE9, 'u', 'r'}), "a=\u20ac\u00e9ur");
}

TEST(Decoder, Calibrators)
{
    const auto number = [](const std::string &inside) {
        return "<FloatParameterType name='t'><IntegerDataEncoding sizeInBits='8' encoding='twosComplement'>"
               "<DefaultCalibrator>" +
               inside + "</DefaultCalibrator></IntegerDataEncoding></FloatParameterType>";
    };
    const auto math = [&](const std::string &steps) {
        std::string all;
        std::stringstream words(steps);
        for (std::string word; words >> word;) {
            const std::string tag = word == "x"        ? "ThisParameterOperand"
                                    : isdigit(word[0]) ? "ValueOperand"
                                                       : "Operator";
            std::string escaped = word == "x" ? "" : word;
            for (std::size_t at = 0; (at = escaped.find('<', at)) != std::string::npos; at += 4) {
                escaped.replace(at, 1, "&lt;");
            }
            all += "<" + tag + ">" + escaped + "</" + tag + ">";
        }
        return number("<MathOperationCalibrator>" + all + "</MathOperationCalibrator>");
    };
    const std::string points = "<SplinePoint raw='0' calibrated='1'/><SplinePoint raw='10' calibrated='3'/>"
                               "<SplinePoint raw='20' calibrated='13'/></SplineCalibrator>";
    EXPECT_EQ(value(number("<PolynomialCalibrator><Term exponent='2' coefficient='0.5'/><Term exponent='0' "
                           "coefficient='1'/></PolynomialCalibrator>"),
                    {4}),
              "a=9");
    EXPECT_EQ(value(number("<SplineCalibrator>" + points), {5}), "a=2");
    EXPECT_EQ(value(number("<SplineCalibrator order='0'>" + points), {19}), "a=3");
    EXPECT_EQ(value(number("<SplineCalibrator order='2'>" + points), {5}), "a=1");
    EXPECT_EQ(value(number("<SplineCalibrator>" + points), {21}), "a=none"); // beyond its ends
    EXPECT_EQ(value(number("<SplineCalibrator extrapolate='true'>" + points), {21}), "a=14");
    EXPECT_EQ(value(math("x 2 - 3 *"), {5}), "a=9");
    EXPECT_EQ(value(math("x 3 swap /"), {6}), "a=0.5");
    EXPECT_EQ(value(math("x 2 <<"), {5}), "a=20");
    EXPECT_EQ(value(math("1 x over + +"), {5}), "a=7");
    EXPECT_EQ(value(math("x ln"), {0xFF}), "a=none");
    EXPECT_EQ(value(math("+"), {1}), "a=none"); // a note of the database when it is read
    const std::string whole = integer("t", 8, "",
                                      "<DefaultCalibrator><PolynomialCalibrator><Term exponent='1' "
                                      "coefficient='0.29'/></PolynomialCalibrator></DefaultCalibrator>");
    EXPECT_EQ(value(whole, {100}), "a=29"); // the nearest, where 0.29 x 100 is a little less
}

TEST(Decoder, LabelsBooleansAndTimes)
{
    const std::string label = "<EnumeratedParameterType name='t'><IntegerDataEncoding encoding='twosComplement'/>"
                              "<EnumerationList><Enumeration value='-2' label='LOW'/><Enumeration value='3' "
                              "maxValue='5' label='HIGH'/></EnumerationList></EnumeratedParameterType>";
    EXPECT_EQ(value(label, {0xFE}), "a=LOW");
    EXPECT_EQ(value(label, {5}), "a=HIGH");
    EXPECT_EQ(value(label, {6}), "a=?");
    EXPECT_EQ(value("<BooleanParameterType name='t'><IntegerDataEncoding/></BooleanParameterType>", {2}), "a=true");
    const auto time = [](const std::string &attributes, int bits) {
        return "<AbsoluteTimeParameterType name='t'><Encoding " + attributes + "><IntegerDataEncoding sizeInBits='" +
               std::to_string(bits) +
               "'/></Encoding><ReferenceTime><Epoch>UNIX</Epoch></ReferenceTime>"
               "</AbsoluteTimeParameterType>";
    };
    EXPECT_EQ(value(time("scale='0.001'", 16), {0x12, 0x34}), "a=4660000000");
    EXPECT_EQ(value(time("scale='1e-9'", 64), {0x19, 0xAD, 0x27, 0x48, 0x21, 0x3F, 0x65, 0x01}), // no bit is lost
              "a=1850178212668073217");
    EXPECT_EQ(value(time("", 64), Bytes(8, 0xFF)), "a=none");
}

TEST(Decoder, AReferenceFindsThisPacketThenEarlierOnesThenTheInitialValue)
{
    const std::string types =
        integer("u8", 8) + integer("c", 8, "",
                                   "<ContextCalibratorList><ContextCalibrator><ContextMatch><Comparison "
                                   "parameterRef='mode' value='1'/></ContextMatch><Calibrator>"
                                   "<PolynomialCalibrator><Term exponent='1' coefficient='10'/>"
                                   "</PolynomialCalibrator></Calibrator></ContextCalibrator>"
                                   "</ContextCalibratorList>");
    const std::string xml =
        file(types, "id:u8 mode:u8 a:c",
             container("P", "id", "", "abstract='true'") + container("M", "mode", extends("P", "id", "1")) +
                 container("A", "a", extends("P", "id", "2")));
    const Database database = read_xtce_text(xml, "s.xml");
    Decoder decoder(database);
    const auto next = [&](const Bytes &packet) { return text(database, decoder, decoder.decode(packet)); };
    EXPECT_EQ(next({2, 7}), "id=2 a=7");
    EXPECT_EQ(next({1, 1}), "id=1 mode=1");
    EXPECT_EQ(next({2, 7}), "id=2 a=70");
    EXPECT_EQ(next({1, 0}), "id=1 mode=0");
    EXPECT_EQ(next({2, 7}), "id=2 a=7");
}

TEST(Decoder, SizesConditionsAndPlacesThatVary)
{
    const std::string u8 = integer("u8", 8);
    const std::string parameter = "<ParameterRefEntry parameterRef='a'>";
    EXPECT_EQ(
        decoded(
            file(u8, "n:u8 a:u8",
                 container("P", "<ParameterRefEntry parameterRef='n'/>" + parameter +
                                    "<RepeatEntry><Count><DynamicValue><ParameterInstanceRef "
                                    "parameterRef='n'/></DynamicValue></Count>"
                                    "<Offset><FixedValue>8</FixedValue></Offset></RepeatEntry></ParameterRefEntry>")),
            {2, 5, 0, 6}),
        "n=2 a=5 a=6");
    EXPECT_EQ(
        decoded(
            file(u8, "n:u8 a:u8",
                 container("P",
                           "<ParameterRefEntry parameterRef='n'/>" + parameter +
                               "<LocationInContainerInBits referenceLocation='containerEnd'><FixedValue>4</FixedValue>"
                               "</LocationInContainerInBits></ParameterRefEntry>")),
            {2, 5, 7, 6}),
        "n=2 a=112");
    const std::string checked = file(
        u8 + integer("u16", 16), "n:u8 a:u8 crc:u16",
        container("P", "<ParameterRefEntry parameterRef='n'/><ParameterRefEntry parameterRef='crc'>"
                       "<LocationInContainerInBits referenceLocation='containerEnd'><FixedValue>0</FixedValue>"
                       "</LocationInContainerInBits></ParameterRefEntry>") +
            container("Q", "a a", extends("P", "n", "1")) + container("R", "<ContainerRefEntry containerRef='Q'/>"));
    EXPECT_EQ(decoded(checked, {1, 2, 3, 4, 5}), "n=1 crc=1029 a=2 a=3"); // behind what extends it
    EXPECT_EQ(decoded(checked, {1, 2, 3, 4, 5, 6}), "n=1 crc=1286 a=2 a=3");
    EXPECT_EQ(decoded(checked, {1, 2, 3, 4}),
              "n=1 crc=772 a=2 a=3 (the packet is 8 bits too short for /S/Q and what stands at its end)");
    const Database nested = read_xtce_text(checked, "s.xml");
    Decoder decoder(nested);
    EXPECT_THAT(decoder.decode(Bytes{1, 2, 3, 4, 5}, nested.container("R")).reason,
                HasSubstr("at the end of a container that is in another is not decoded (s.xml:8)"));
    const std::string included =
        file(u8, "n:u8 a:u8 b:u8",
             container("P", "<ParameterRefEntry parameterRef='n'/>" + parameter +
                                "<IncludeCondition><Comparison parameterRef='n' comparisonOperator='&gt;' value='3'/>"
                                "</IncludeCondition></ParameterRefEntry><ParameterRefEntry parameterRef='b'/>"));
    EXPECT_EQ(decoded(included, {3, 5}), "n=3 b=5");
    EXPECT_EQ(decoded(included, {4, 5, 6}), "n=4 a=5 b=6");
    const std::string list =
        "<ArrayParameterType name='r' arrayTypeRef='u8'><DimensionList><Dimension><StartingIndex>"
        "<FixedValue>0</FixedValue></StartingIndex><EndingIndex><DynamicValue>"
        "<ParameterInstanceRef parameterRef='m'/></DynamicValue></EndingIndex></Dimension>"
        "</DimensionList></ArrayParameterType><AggregateParameterType name='g'><MemberList><Member "
        "name='m' typeRef='u8'/><Member name='r' typeRef='r'/></MemberList></AggregateParameterType>";
    EXPECT_EQ(decoded(file(u8 + list, "a:g", container("P", "a")), {1, 5, 6}), "a.m=1 a.r[0]=5 a.r[1]=6");
    const std::string lookup = "<BinaryParameterType name='b'><BinaryDataEncoding><SizeInBits><DiscreteLookupList>"
                               "<DiscreteLookup value='12'><Comparison parameterRef='n' value='1'/></DiscreteLookup>"
                               "</DiscreteLookupList></SizeInBits></BinaryDataEncoding></BinaryParameterType>";
    EXPECT_EQ(decoded(file(u8 + lookup, "n:u8 a:b", container("P", "n a")), {1, 0xAB, 0xCD}), "n=1 a=0abc");
    EXPECT_EQ(decoded(file(u8 + lookup, "n:u8 a:b", container("P", "n a")), {2, 0xAB}),
              "n=2 (the size of b is not known)");
}

TEST(Decoder, APacketThatIsNotDecodedHasAReason)
{
    const std::string all =
        file(integer("u8", 8), "id:u8 sub:u8 a:u8",
             container("P", "id", "", "abstract='true'") +
                 container("Q", "sub", extends("P", "id", "5"), "abstract='true'") +
                 container("R", "a", extends("Q", "sub", "1")) + container("T", "a", extends("Q", "sub", "2")) +
                 container("U", "sub", extends("P", "id", "6")));
    EXPECT_EQ(decoded(all, {5, 1, 9}), "id=5 sub=1 a=9");
    EXPECT_EQ(decoded(all, {7, 1, 9}),
              "(no container that extends /S/P fits; the nearest, /S/Q, needs id == 5 (found 7))");
    EXPECT_EQ(decoded(all, {5, 3, 9}),
              "(no container that extends /S/Q fits; the nearest, /S/R, needs sub == 1 (found 3))");
    EXPECT_EQ(decoded(all, {5, 1}), "id=5 sub=1 (the packet ends within a)");
    EXPECT_EQ(decoded(all, {}), "(the packet ends within id)");
    EXPECT_EQ(decoded(file("", "", ""), {1}), "(the database has no container)");
    const std::string java =
        "<BinaryParameterType name='t'><BinaryDataEncoding><FromBinaryTransformAlgorithm name='J'/>"
        "</BinaryDataEncoding></BinaryParameterType>";
    EXPECT_EQ(value(java, {1}), "(t is encoded by the algorithm J, which is not computed)");
}

TEST(Decoder, HostileDatabasesEnd)
{
    const std::string u8 = integer("u8", 8);
    const auto repeat = [](const std::string &name, const std::string &inner, const std::string &gap) {
        return container(name, "<ContainerRefEntry containerRef='" + inner +
                                   "'><RepeatEntry><Count><FixedValue>1000000"
                                   "</FixedValue></Count><Offset><FixedValue>" +
                                   gap +
                                   "</FixedValue></Offset></RepeatEntry>"
                                   "</ContainerRefEntry>");
    };
    EXPECT_THAT(
        decoded(file(u8, "a:u8", container("Z", "a") + repeat("Y", "Z", "-8") + repeat("X", "Y", "-8")), Bytes(10)),
        HasSubstr("more values or repetitions than a decoder takes"));
    EXPECT_THAT(decoded(file(u8, "", "<SequenceContainer name='Z'/>" + repeat("Y", "Z", "0") + repeat("X", "Y", "0")),
                        Bytes(10)),
                HasSubstr("more values or repetitions"));
    EXPECT_THAT(
        decoded(
            file(u8, "a:u8",
                 container("P",
                           "<ParameterRefEntry parameterRef='a'><LocationInContainerInBits "
                           "referenceLocation='containerStart'><FixedValue>-8</FixedValue></LocationInContainerInBits>"
                           "</ParameterRefEntry>")),
            Bytes(10)),
        HasSubstr("an entry begins at bit -8, and the packet has 80"));
}

} // namespace decoder_test

} // namespace fledge::ground
