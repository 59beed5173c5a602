// SPDX-License-Identifier: Apache-2.0
#include "ground/database/command_decoder.h"

#include "ground/database/encoder.h"
#include "ground/database/testing/database.h"

#include <gtest/gtest.h>

namespace fledge::ground {

namespace command_decoder_test {

using namespace testing;

std::string argument_types()
{
    return "<ArgumentTypeSet><IntegerArgumentType name='u8'><IntegerDataEncoding/></IntegerArgumentType>"
           "<FloatArgumentType name='gain'><IntegerDataEncoding sizeInBits='16' encoding='twosComplement'>"
           "<DefaultCalibrator><PolynomialCalibrator><Term exponent='0' coefficient='5'/><Term exponent='1' "
           "coefficient='10'/></PolynomialCalibrator></DefaultCalibrator></IntegerDataEncoding></FloatArgumentType>"
           "<FloatArgumentType name='curve'><IntegerDataEncoding sizeInBits='8'><DefaultCalibrator>"
           "<SplineCalibrator><SplinePoint raw='0' calibrated='200'/><SplinePoint raw='10' calibrated='0'/>"
           "</SplineCalibrator></DefaultCalibrator></IntegerDataEncoding></FloatArgumentType>"
           "<FloatArgumentType name='square'><IntegerDataEncoding sizeInBits='8'><DefaultCalibrator>"
           "<PolynomialCalibrator><Term exponent='2' coefficient='1'/></PolynomialCalibrator></DefaultCalibrator>"
           "</IntegerDataEncoding></FloatArgumentType>"
           "<FloatArgumentType name='f32'><FloatDataEncoding sizeInBits='32'/></FloatArgumentType>"
           "<EnumeratedArgumentType name='mode'><IntegerDataEncoding sizeInBits='4'/><EnumerationList>"
           "<Enumeration value='1' label='MODE_SAFE'/><Enumeration value='2' label='MODE_FINE'/></EnumerationList>"
           "</EnumeratedArgumentType>"
           "<BinaryArgumentType name='data'><BinaryDataEncoding><SizeInBits><DynamicValue><ArgumentInstanceRef "
           "argumentRef='n'/><LinearAdjustment slope='8'/></DynamicValue></SizeInBits></BinaryDataEncoding>"
           "</BinaryArgumentType></ArgumentTypeSet>";
}

std::string arguments(const std::string &list)
{
    std::string all;
    for (std::size_t at = 0, colon; (colon = list.find(':', at)) != std::string::npos;) {
        const std::size_t end = std::min(list.find(' ', colon), list.size());
        all += "<Argument name='" + list.substr(at, colon - at) + "' argumentTypeRef='" +
               list.substr(colon + 1, end - colon - 1) + "'/>";
        at = std::min(end + 1, list.size());
    }
    return all.empty() ? all : "<ArgumentList>" + all + "</ArgumentList>";
}

/// A command; assigned: "name=value" of its base. entries: arguments, or XML.
std::string command(const std::string &name, const std::string &base, const std::string &assigned,
                    const std::string &own, const std::string &entries, const std::string &attributes = "")
{
    const std::size_t equals = assigned.find('=');
    std::string list = entries;
    if (entries.find('<') == std::string::npos) {
        list.clear();
        for (std::size_t at = 0; at < entries.size();) {
            const std::size_t end = std::min(entries.find(' ', at), entries.size());
            list += "<ArgumentRefEntry argumentRef='" + entries.substr(at, end - at) + "'/>";
            at = end + 1;
        }
    }
    const std::string assignment = "<ArgumentAssignmentList><ArgumentAssignment argumentName='" +
                                   assigned.substr(0, equals) + "' argumentValue='" +
                                   (equals != std::string::npos ? assigned.substr(equals + 1) : "") +
                                   "'/></ArgumentAssignmentList>";
    return "<MetaCommand name='" + name + "' " + attributes + ">" +
           (base.empty() ? ""
                         : "<BaseMetaCommand metaCommandRef='" + base + "'>" + (assigned.empty() ? "" : assignment) +
                               "</BaseMetaCommand>") +
           arguments(own) + "<CommandContainer name='" + name + "'><EntryList>" + list + "</EntryList>" +
           (base.empty() ? "" : "<BaseContainer containerRef='" + base + "'/>") + "</CommandContainer></MetaCommand>";
}

/// Commands behind a header of the constant 0x5A, a sequence, and an opcode.
Database database_of(const std::string &commands)
{
    return read_xtce_text(
        "<SpaceSystem name='S'><CommandMetaData><ParameterTypeSet><IntegerParameterType "
        "name='u8'><IntegerDataEncoding/>"
        "</IntegerParameterType></ParameterTypeSet><ParameterSet><Parameter name='mark' parameterTypeRef='u8' "
        "initialValue='90'><ParameterProperties dataSource='constant'/></Parameter><Parameter name='sequence' "
        "parameterTypeRef='u8' initialValue='0'/></ParameterSet>" +
            argument_types() + "<MetaCommandSet>" +
            command("Base", "", "", "opcode:u8",
                    "<ParameterRefEntry parameterRef='mark'/><ParameterRefEntry parameterRef='sequence'/>"
                    "<ArgumentRefEntry argumentRef='opcode'/>",
                    "abstract='true'") +
            commands + "</MetaCommandSet></CommandMetaData></SpaceSystem>",
        "s.xml");
}

/// The command and its arguments, "/S/C gain=4.5"; or why there is none.
std::string decoded(CommandDecoder &decoder, const Bytes &packet)
{
    const Decoded &done = decoder.decode(packet);
    std::string all = done.reason.empty() ? decoder.database().containers[done.container].path : done.reason;
    for (std::size_t i = 0; i < done.fields.size() && done.reason.empty(); i++) {
        if (decoder.role(done, done.fields[i].parameter) == CommandDecoder::Role::given) {
            const Field &field = done.fields[i];
            const Type &type = decoder.database().types[field.type];
            all += " " + decoder.decoder().name(done, i) + "=" +
                   (done.status[i] != Status::good ? "?"
                    : field.value == Kind::label   ? type.enumerators[done.values[i]].label
                    : field.value == Kind::binary  ? std::string(done.text(done.values[i]))
                    : field.value == Kind::real    ? std::to_string(std::bit_cast<double>(done.values[i])).substr(0, 5)
                                                   : std::to_string(done.values[i]));
            if (const auto counter = decoder.counter(done, i)) {
                all += " " + counter->first + "=" + std::to_string(nearest(counter->second));
            }
        }
    }
    return all;
}

std::string decoded(const Database &database, const Bytes &packet)
{
    CommandDecoder decoder(database, Header::none);
    return decoded(decoder, packet);
}

TEST(CommandDecoder, FindsTheCommandThatAssignsTheValuesOfThePacket)
{
    const Database database = database_of(command("A", "Base", "opcode=1", "x:u8", "x") +
                                          command("B", "Base", "opcode=2", "g:gain m:mode", "g m"));
    EXPECT_EQ(decoded(database, {90, 7, 1, 33}), "/S/A x=33");
    EXPECT_EQ(decoded(database, {90, 7, 2, 0, 50, 0x20}), "/S/B g=4.500 m=MODE_FINE");
    EXPECT_EQ(decoded(database, {90, 7, 2, 0, 50}), "the packet ends within m");
    EXPECT_EQ(decoded(database, {90, 7, 3, 1}),
              "no container that extends /S/Base fits; the nearest, /S/A, needs opcode == 1 (found 3)");
}

TEST(CommandDecoder, ComparesConstantsAndFixedValues)
{
    const Database database = database_of(
        command("A", "Base", "opcode=1", "x:u8",
                "<FixedValueEntry binaryValue='0123456789ABCDEFF5' sizeInBits='68'/><FixedValueEntry binaryValue='0' "
                "sizeInBits='4'/><ArgumentRefEntry argumentRef='x'/>"));
    Bytes packet = {90, 0, 1, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xFF, 0x50, 8};
    EXPECT_EQ(decoded(database, packet), "/S/A x=8");
    std::vector<std::size_t> fixed;
    for (std::size_t i = 0; i < packet.size(); i++) {
        packet[i] ^= 0x10;
        if (decoded(database, packet).substr(0, 4) != "/S/A") {
            fixed.push_back(i);
        }
        packet[i] ^= 0x10;
    }
    EXPECT_EQ(fixed, (std::vector<std::size_t>{0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
}

TEST(CommandDecoder, TheMostDerivedCommandCountsAndAnUnrestrictedCommandIsTriedLast)
{
    const Database database =
        database_of(command("Versioned", "Base", "", "version:u8", "version", "abstract='true'") +
                    command("Set", "Versioned", "opcode=4", "m:mode", "m") +
                    command("Safe", "Set", "m=SAFE", "x:u8", "x") + command("Noop", "Base", "opcode=0", "", ""));
    EXPECT_EQ(decoded(database, {90, 0, 0}), "/S/Noop");
    EXPECT_EQ(decoded(database, {90, 0, 4, 9, 0x20}), "/S/Set version=9 m=MODE_FINE");
    EXPECT_EQ(decoded(database, {90, 0, 4, 9, 0x15, 0x50}), "/S/Safe version=9 x=85");
}

TEST(CommandDecoder, CalibratorsAreInvertedWhereTheyCanBe)
{
    const Database database = database_of(command("A", "Base", "opcode=1", "c:curve s:square r:f32", "c s r"));
    EXPECT_EQ(decoded(database, {90, 0, 1, 100, 4, 0x3F, 0x80, 0, 0}), "/S/A c=5.000 s=? r=1.000");
}

TEST(CommandDecoder, AnAssignedRealNumberIsRoundedAsItIsEncoded)
{
    const Database database = database_of(command("Gain", "Base", "opcode=1", "r:f32", "r", "abstract='true'") +
                                          command("Tenth", "Gain", "r=0.1", "", ""));
    EXPECT_EQ(decoded(database, encode(database, database.command("Tenth"), {})), "/S/Tenth");
    EXPECT_NE(decoded(database, {90, 0, 1, 0, 0, 0, 0}).substr(0, 3), "/S/");
}

TEST(CommandDecoder, AnArgumentWithoutASizeHasTheRestOfThePacket)
{
    const Database database = database_of(command("A", "Base", "opcode=1", "n:u8 d:data", "d") +
                                          command("B", "Base", "opcode=2", "n:u8 d:data e:u8", "d e") +
                                          command("C", "Base", "opcode=3", "n:u8 d:data e:u8", "n d e"));
    EXPECT_EQ(decoded(database, {90, 0, 1, 'a', 'b', 'c'}), "/S/A d=abc n=3");
    EXPECT_EQ(decoded(database, {90, 0, 1}), "/S/A d= n=0");
    EXPECT_EQ(decoded(database, {90, 0, 2, 'a', 'b', 'c'}), "/S/B d=ab n=2 e=99");
    EXPECT_EQ(decoded(database, {90, 0, 2}), "the size of data is not known");
    EXPECT_EQ(decoded(database, {90, 0, 3, 2, 'a', 'b', 'c'}), "/S/C n=2 d=ab e=99");
    EXPECT_EQ(decoded(database, {90, 0, 3, 9, 'a', 'b', 'c'}),
              "the packet ends within data, a binary value of 72 bits");
}

TEST(CommandDecoder, FieldsThatTheSenderSetsInASpacePacketAreNotCompared)
{
    const char *const text =
        "<SpaceSystem name='S'><CommandMetaData><ParameterTypeSet><IntegerParameterType name='u16' initialValue='6144'>"
        "<IntegerDataEncoding sizeInBits='16'/></IntegerParameterType><IntegerParameterType name='u8' initialValue='0'>"
        "<IntegerDataEncoding/></IntegerParameterType></ParameterTypeSet><ParameterSet>"
        "<Parameter name='stream' parameterTypeRef='u16'><ParameterProperties dataSource='constant'/></Parameter>"
        "<Parameter name='a' parameterTypeRef='u8'><ParameterProperties dataSource='constant'/></Parameter>"
        "<Parameter name='b' parameterTypeRef='u8'><ParameterProperties dataSource='constant'/></Parameter>"
        "</ParameterSet><MetaCommandSet><MetaCommand name='C'><CommandContainer name='C'><EntryList>"
        "<ParameterRefEntry parameterRef='stream'/><ParameterRefEntry parameterRef='a'><LocationInContainerInBits "
        "referenceLocation='containerStart'><FixedValue>32</FixedValue></LocationInContainerInBits></ParameterRefEntry>"
        "<ParameterRefEntry parameterRef='b'><LocationInContainerInBits><FixedValue>16</FixedValue>"
        "</LocationInContainerInBits></ParameterRefEntry></EntryList></CommandContainer></MetaCommand></MetaCommandSet>"
        "</CommandMetaData></SpaceSystem>";
    const Database database = read_xtce_text(text, "s.xml");
    const Bytes plain = {0x18, 0, 0, 0, 0, 0, 0, 0}, length = {0x18, 0, 9, 9, 9, 9, 0, 0},
                checksum = {0x18, 0, 9, 9, 9, 9, 0, 9}, other = {0x19, 0, 0, 0, 0, 0, 0, 0};
    std::string matches;
    for (const Header header : {Header::none, Header::ccsds, Header::cfs}) {
        CommandDecoder decoder(database, header);
        for (const Bytes &packet : {plain, length, checksum, other}) {
            matches += decoded(decoder, packet) == "/S/C" ? "+" : "-";
        }
        matches += " ";
    }
    EXPECT_EQ(matches, "+--- ++-- +++- ");
}

} // namespace command_decoder_test

} // namespace fledge::ground
