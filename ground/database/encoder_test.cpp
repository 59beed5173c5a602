// SPDX-License-Identifier: Apache-2.0
#include "ground/database/encoder.h"

#include "ground/database/testing/database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <regex>

namespace fledge::ground {

namespace encoder_test {

using namespace testing;

Given number(std::int64_t value)
{
    Given result;
    result.integer = value;
    return result;
}

Given text(const std::string &value)
{
    Given result;
    result.kind = Given::Kind::text;
    result.text = value;
    return result;
}

/// A command C that extends B, whose container has a header of telemetry.
const char *const commands =
    "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet><IntegerParameterType name='u8'>"
    "<IntegerDataEncoding/></IntegerParameterType></ParameterTypeSet><ParameterSet>"
    "<Parameter name='apid' parameterTypeRef='u8'/><Parameter name='sequence' parameterTypeRef='u8'/></ParameterSet>"
    "<ContainerSet><SequenceContainer name='H'><EntryList><ParameterRefEntry parameterRef='apid'/><ParameterRefEntry "
    "parameterRef='sequence'/></EntryList></SequenceContainer></ContainerSet></TelemetryMetaData><CommandMetaData>"
    "<ArgumentTypeSet><IntegerArgumentType name='code'><IntegerDataEncoding/></IntegerArgumentType>"
    "<FloatArgumentType name='gain'><IntegerDataEncoding sizeInBits='16' encoding='twosComplement'><DefaultCalibrator>"
    "<PolynomialCalibrator><Term exponent='1' coefficient='10'/></PolynomialCalibrator></DefaultCalibrator>"
    "</IntegerDataEncoding><ValidRangeSet><ValidRange minInclusive='-5' maxExclusive='5'/></ValidRangeSet>"
    "</FloatArgumentType><EnumeratedArgumentType name='mode'><IntegerDataEncoding sizeInBits='4'/><EnumerationList>"
    "<Enumeration value='1' label='SAFE'/><Enumeration value='2' label='NOMINAL'/><Enumeration value='3' "
    "label='FREE_SPIN'/><Enumeration value='4' label='SLOW_SPIN'/></EnumerationList>"
    "</EnumeratedArgumentType></ArgumentTypeSet><MetaCommandSet><MetaCommand name='B' abstract='true'><ArgumentList>"
    "<Argument name='opcode' argumentTypeRef='code'/></ArgumentList><CommandContainer name='BC'><EntryList>"
    "<ArgumentRefEntry argumentRef='opcode'/></EntryList><BaseContainer containerRef='H'><RestrictionCriteria>"
    "<Comparison parameterRef='apid' "
    "value='42'/></RestrictionCriteria></BaseContainer></CommandContainer></MetaCommand>"
    "<MetaCommand name='C'><BaseMetaCommand metaCommandRef='B'><ArgumentAssignmentList><ArgumentAssignment "
    "argumentName='opcode' argumentValue='7'/></ArgumentAssignmentList></BaseMetaCommand><ArgumentList><Argument "
    "name='gain' argumentTypeRef='gain'/><Argument name='mode' argumentTypeRef='mode' initialValue='NOMINAL'/>"
    "</ArgumentList><CommandContainer name='CC'><EntryList><ArgumentRefEntry argumentRef='gain'/><FixedValueEntry "
    "binaryValue='f5' sizeInBits='4'/><ArgumentRefEntry argumentRef='mode'/></EntryList><BaseContainer "
    "containerRef='BC'/></CommandContainer></MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>";

std::string refusal(const std::map<std::string, Given> &given, const std::string &name = "C")
{
    const Database database = read_xtce_text(commands, "s.xml");
    try {
        encode(database, database.command(name), given);
    } catch (const Refusal &reason) {
        return reason.what();
    }
    return "";
}

TEST(Encoder, ACommandHasItsHeaderItsFixedAndItsGivenValues)
{
    const Database database = read_xtce_text(commands, "s.xml");
    const Id id = database.command("C");
    EXPECT_EQ(encode(database, id, {{"gain", number(-2)}, {"sequence", number(3)}}),
              (Bytes{42, 3, 7, 0xFF, 0xEC, 0x52}));
    EXPECT_EQ(encode(database, id, {{"gain", text("4.25")}, {"sequence", number(3)}, {"mode", text("SAFE")}}),
              (Bytes{42, 3, 7, 0, 43, 0x51}));
}

TEST(Encoder, ALabelMayBeShortenedToAnEndingThatIsUnique)
{
    const Database database = read_xtce_text(commands, "s.xml");
    const auto mode = [&](const char *label) {
        return encode(database, database.command("C"),
                      {{"gain", number(0)}, {"sequence", number(3)}, {"mode", text(label)}});
    };
    EXPECT_EQ(mode("SLOW_SPIN"), (Bytes{42, 3, 7, 0, 0, 0x54}));
    const Database named = read_xtce_text(std::regex_replace(commands, std::regex("FREE_SPIN"), "FREE_FALL"), "s.xml");
    EXPECT_EQ(encode(named, named.command("C"), {{"gain", number(0)}, {"sequence", number(3)}, {"mode", text("SPIN")}}),
              mode("SLOW_SPIN"));
    EXPECT_EQ(refusal({{"gain", number(0)}, {"sequence", number(3)}, {"mode", text("SPIN")}}),
              "mode must be one of SAFE, NOMINAL, FREE_SPIN, SLOW_SPIN");
}

TEST(Encoder, PlacesHaveTheBitsOfEachEntry)
{
    const Database database = read_xtce_text(commands, "s.xml");
    std::vector<Placed> places;
    encode(database, database.command("C"), {{"gain", number(-2)}, {"sequence", number(3)}}, &places);
    std::string text;
    for (const Placed &place : places) {
        text += place.name + (place.argument ? "*" : "") + " " + std::to_string(place.bit) + "+" +
                std::to_string(place.bits) + ", ";
    }
    EXPECT_EQ(text, "apid 0+8, sequence 8+8, opcode* 16+8, gain* 24+16, mode* 44+4, ");
}

TEST(Encoder, MissingUnknownOrWrongValuesAreRefused)
{
    const Given value = number(1);
    EXPECT_EQ(refusal({{"sequence", value}}), "/S/C needs gain");
    EXPECT_EQ(refusal({{"gain", value}}), "/S/C needs sequence, which has no initial value");
    EXPECT_EQ(refusal({{"gain", value}, {"sequence", value}, {"speed", value}}), "/S/C has no argument speed");
    EXPECT_EQ(refusal({{"gain", value}, {"sequence", value}, {"opcode", value}}),
              "/S/C fixes the argument opcode: do not give it");
    EXPECT_EQ(refusal({{"gain", number(5)}, {"sequence", value}}), "gain must be from -5 to below 5; found 5");
    EXPECT_EQ(refusal({{"gain", value}, {"sequence", number(256)}}), "sequence has 8 bits, too few for 256");
    EXPECT_EQ(refusal({{"gain", value}, {"sequence", value}, {"mode", text("OFF")}}),
              "mode must be one of SAFE, NOMINAL, FREE_SPIN, SLOW_SPIN");
    EXPECT_EQ(refusal({{"gain", text("fast")}, {"sequence", value}}), "gain must be a number");
    EXPECT_EQ(refusal({}, "B"), "/S/B is abstract: give a command that extends it");
    EXPECT_EQ(refusal({}, "D"), "the database has no command D");
}

TEST(Encoder, AnUnsignedNumberAsTextIsNotNegative)
{
    const auto encoded = [](const std::string &is_signed, const Given &value) {
        const Database database = read_xtce_text(
            "<SpaceSystem name='S'><CommandMetaData><ArgumentTypeSet><IntegerArgumentType name='n' signed='" +
                is_signed +
                "'><StringDataEncoding><SizeInBits><Fixed><FixedValue>16</FixedValue></Fixed></SizeInBits>"
                "</StringDataEncoding></IntegerArgumentType></ArgumentTypeSet><MetaCommandSet><MetaCommand name='C'>"
                "<ArgumentList><Argument name='x' argumentTypeRef='n'/></ArgumentList><CommandContainer name='CC'>"
                "<EntryList><ArgumentRefEntry argumentRef='x'/></EntryList></CommandContainer></MetaCommand>"
                "</MetaCommandSet></CommandMetaData></SpaceSystem>",
            "s.xml");
        return encode(database, database.command("C"), {{"x", value}});
    };
    EXPECT_EQ(encoded("false", number(12)), (Bytes{'1', '2'}));
    for (const Given &value : {number(-1), text("-1")}) {
        EXPECT_EQ(encoded("true", value), (Bytes{'-', '1'}));
        EXPECT_THROW(encoded("false", value), Refusal);
    }
}

TEST(Encoder, NumbersComeBackFromTheirBits)
{
    Encoding encoding;
    encoding.kind = Encoding::Kind::integer;
    for (const NumberForm form : {NumberForm::plain, NumberForm::twos_complement, NumberForm::ones_complement,
                                  NumberForm::sign_magnitude, NumberForm::bcd, NumberForm::packed_bcd}) {
        for (const std::vector<std::uint8_t> &order : std::vector<std::vector<std::uint8_t>>{{}, {0, 1}}) {
            encoding.form = form;
            encoding.bits = 16;
            encoding.byte_order = order;
            int held = 0;
            for (int value = -70000; value < 70000; value++) {
                std::uint64_t number = 0;
                if (const auto bits = bits_of(encoding, Wide(value))) {
                    held++;
                    ASSERT_TRUE(number_of(encoding, *bits, number));
                    ASSERT_EQ(static_cast<std::int64_t>(number), value);
                }
            }
            const int signless = form == NumberForm::plain ? 65536 : form == NumberForm::bcd ? 100 : 10000;
            EXPECT_EQ(held, form == NumberForm::twos_complement   ? 65536
                            : raw_kind(encoding) == Kind::integer ? 65535
                                                                  : signless);
        }
    }
    encoding.kind = Encoding::Kind::real;
    encoding.byte_order.clear();
    for (const auto &[form, n] : {std::pair(NumberForm::ieee754, 16u),
                                  {NumberForm::ieee754, 32u},
                                  {NumberForm::mil1750a, 32u},
                                  {NumberForm::mil1750a, 48u}}) {
        encoding.form = form;
        encoding.bits = n;
        std::uint64_t seed = 1, first = 0, second = 0;
        for (int i = 0; i < 100'000; i++, seed = seed * 6364136223846793005u + 1442695040888963407u) {
            number_of(encoding, seed >> (64 - n), first);
            const auto back = bits_of(encoding, std::bit_cast<double>(first));
            ASSERT_TRUE(back);
            number_of(encoding, *back, second);
            if (std::bit_cast<double>(first) == std::bit_cast<double>(first)) {
                ASSERT_EQ(first, second) << n << " bits, " << (seed >> (64 - n));
            }
        }
    }
}

} // namespace encoder_test

} // namespace fledge::ground
