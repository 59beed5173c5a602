// SPDX-License-Identifier: Apache-2.0
#include "ground/database/testing/database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>
#include <random>

namespace fledge::ground {

namespace xtce_test {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

/// Why a text is refused; "" if it is read.
std::string refusal(const std::string &xml)
{
    try {
        read_xtce_text(xml, "s.xml");
    } catch (const Refusal &reason) {
        return reason.what();
    }
    return "";
}

TEST(Xtce, TheNameSpacesAreReadAlikeAndOthersAreRefused)
{
    EXPECT_THAT(refusal("<SpaceSystem xmlns='http://www.omg.org/spec/XTCE/20990101' name='S'/>"),
                HasSubstr("s.xml:1: the name space http://www.omg.org/spec/XTCE/20990101 is not read: XTCE 1.0 and 1.1 "
                          "have http://www.omg.org/space/xtce, 1.2 has"));
    EXPECT_EQ(refusal("<x:SpaceSystem name='S'/>"), "s.xml:1: the prefix x has no name space: xmlns:x is missing");
    for (const std::string space : {"http://www.omg.org/space/xtce", "http://www.omg.org/spec/XTCE/20180204",
                                    "http://www.omg.org/spec/XTCE/20250214", ""}) {
        for (const std::string prefix : {"", "xtce:"}) {
            if (space.empty() && !prefix.empty()) {
                continue;
            }
            std::string xml = "<" + prefix + "SpaceSystem name='S'";
            xml += space.empty() ? ">" : std::string(" xmlns") + (prefix.empty() ? "" : ":xtce") + "='" + space + "'>";
            for (const std::string tag : {"TelemetryMetaData", "ParameterSet"}) {
                xml += "<" + prefix + tag + ">";
            }
            xml += "</" + prefix + "ParameterSet></" + prefix + "TelemetryMetaData></" + prefix + "SpaceSystem>";
            EXPECT_EQ(refusal(xml), "");
        }
    }
}

TEST(Xtce, FormsThatAreNoStandardButCommonAreRead)
{
    const std::string xml =
        "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>" + integer("i8", 8, "encoding='signed'") +
        "<FloatParameterType name='f'><FloatDataEncoding encoding='IEEE-754'/></FloatParameterType>" + // 32 bits
        "<StringParameterType name='t'><StringDataEncoding><SizeInBits><TerminationChar/></SizeInBits>"
        "</StringDataEncoding></StringParameterType>" +
        integer("u0", 0) +
        "</ParameterTypeSet><ParameterSet><Parameter name='a' parameterTypeRef='i8'><ShortDescription>Short"
        "</ShortDescription><LongDescription>Long</LongDescription></Parameter><Parameter name='b' "
        "parameterTypeRef='f'/><Parameter name='c' parameterTypeRef='t'/></ParameterSet><ContainerSet>" +
        container("P", "a b c") + "</ContainerSet></TelemetryMetaData></SpaceSystem>";
    EXPECT_EQ(decoded(xml, {0xFE, 0x3F, 0x80, 0, 0, 'x', 0}), "a=-2 b=1 c=x");
    const Database database = read_xtce_text(xml, "s.xml");
    EXPECT_EQ(database.parameters[0].description, "Short");
    EXPECT_THAT(database.notes, ElementsAre(HasSubstr("0 bits are no encoding")));
    EXPECT_THAT(refusal(file(integer("u0", 0), "a:u0", container("P", "a"))),
                HasSubstr("u0 (s.xml:2) has no encoding"));
}

TEST(Xtce, WhatXtce13Adds)
{
    const std::string alarm = "minViolations='2'><AlarmMultiRanges><Range level='watch' maxInclusive='3'/>"
                              "</AlarmMultiRanges></DefaultAlarm></IntegerParameterType>";
    const Database database = read_xtce_text(
        file("<IntegerParameterType name='on'><IntegerDataEncoding/><DefaultAlarm " + alarm +
                 "<IntegerParameterType name='off'><IntegerDataEncoding/><DefaultAlarm disabled='true' " + alarm +
                 "<RelativeTimeParameterType name='t'><Encoding units='milliseconds'><IntegerDataEncoding/></Encoding>"
                 "</RelativeTimeParameterType><BinaryParameterType name='b'><BinaryDataEncoding><SizeInBits>"
                 "<DiscreteLookupList defaultValue='16'><DiscreteLookup value='8'><Comparison parameterRef='a' "
                 "value='1'/></DiscreteLookup></DiscreteLookupList></SizeInBits></BinaryDataEncoding>"
                 "<BinaryContextAlarmList/></BinaryParameterType>",
             "a:on c:t d:b", container("P", "a c d")),
        "s.xml");
    EXPECT_EQ(database.types[0].alarms.size(), 1u);
    EXPECT_EQ(database.types[1].alarms.size(), 0u);
    EXPECT_THAT(database.notes, ElementsAre(HasSubstr("an alarm is disabled")));
    Decoder decoder(database);
    EXPECT_EQ(text(database, decoder, decoder.decode(Bytes{1, 7, 9})), "a=1 c=7000000 d=09");
    EXPECT_EQ(text(database, decoder, decoder.decode(Bytes{2, 7, 9, 8})), "a=2 c=7000000 d=0908");
    EXPECT_THAT(refusal("<SpaceSystem name='S'><CommandMetaData><MetaCommandSet><MetaCommand name='C'><VerifierSet>"
                        "<CompleteVerifier><ArgumentRestrictionList/></CompleteVerifier></VerifierSet></MetaCommand>"
                        "</MetaCommandSet></CommandMetaData></SpaceSystem>"),
                HasSubstr("<ArgumentRestrictionList> is not known in <CompleteVerifier>"));
}

TEST(Xtce, ARelativeTimeMayBeAnArgumentInBothSpellings)
{
    for (const std::string tag : {"RelativeTimeArgumentType", "RelativeTimeAgumentType"}) { // 1.2 has the second
        EXPECT_EQ(refusal("<SpaceSystem name='S'><CommandMetaData><ArgumentTypeSet><" + tag +
                          " name='T'><Encoding><IntegerDataEncoding/></Encoding></" + tag +
                          "></ArgumentTypeSet></CommandMetaData></SpaceSystem>"),
                  "");
    }
}

TEST(Xtce, WhatIsWrongIsNamedWithItsLine)
{
    const std::string u8 = integer("u8", 8);
    const std::pair<std::string, std::string> cases[] = {
        {"", "s.xml:1: No document element found"},
        {"<SpaceSystem name='S'>\n<Header>\n</SpaceSystem>", "s.xml:3: Start-end tags mismatch"},
        {"<Spacesystem/>", "s.xml:1: the root must be SpaceSystem; found Spacesystem"},
        {"<SpaceSystem/>", "s.xml:1: <SpaceSystem> needs the attribute name"},
        {"<SpaceSystem name='S'>\n<Telemetry/></SpaceSystem>", "s.xml:2: <Telemetry> is not known in <SpaceSystem>"},
        {"<SpaceSystem name='S'>\n<SpaceSystem name='T'/>\n<SpaceSystem name='T'/></SpaceSystem>",
         "s.xml:3: /S/T is declared twice"},
        {file(u8 + "\n" + u8, "", ""), "s.xml:3: /S/u8 is declared twice; first in s.xml:2"},
        {file(u8, "a:u9", ""), "s.xml:4: there is no type u9"},
        {file(u8, "a:u8", container("P", "a b")), "s.xml:6: there is no parameter b"},
        {file(u8, "a:u8", container("P", "a", extends("Q", "a", "1"))), "there is no container Q"},
        {file(integer("u65", 65), "", ""), "must be 1 to 64; found 65"},
        {file(integer("u8", 8, "encoding='offset'"), "", ""), "the encoding offset is not known"},
        {file(integer("b", 12, "encoding='BCD'"), "", ""), "BCD has no form of 12 bits"},
        {file(integer("u8", 12, "byteOrder='leastSignificantByteFirst'"), "", ""), "whole bytes; found 12 bits"},
        {file(integer("u8", 32, "byteOrder='0,1,2,2'"), "", ""), "each significance from 0 to 3 once"},
        {file("<FloatParameterType name='f'><FloatDataEncoding sizeInBits='24'/></FloatParameterType>", "", ""),
         "IEEE754 has no form of 24 bits"},
        {file("<FloatParameterType name='f'/>", "a:f", container("P", "a")), "the type f (s.xml:2) has no encoding"},
        {file("<EnumeratedParameterType name='e'><EnumerationList>\n<Enumeration value='1' label='A' maxValue='3'/>"
              "<Enumeration value='3' label='B'/></EnumerationList></EnumeratedParameterType>",
              "", ""),
         "the values of the enumerator B are empty or another's"},
        {file(integer("u8", 8, "",
                      "<DefaultCalibrator><SplineCalibrator><SplinePoint raw='1' calibrated='2'/>"
                      "</SplineCalibrator></DefaultCalibrator>"),
              "", ""),
         "needs 2 points"},
        {file(integer("u8", 8, "",
                      "<DefaultCalibrator><MathOperationCalibrator><Operator>foo</Operator>"
                      "</MathOperationCalibrator></DefaultCalibrator>"),
              "", ""),
         "foo is not known"},
        {file(u8, "a:u8",
              container("P", "<ParameterRefEntry parameterRef='a'><LocationInContainerInBits "
                             "referenceLocation='nextEntry'><FixedValue>1</FixedValue>"
                             "</LocationInContainerInBits></ParameterRefEntry>")),
         "found nextEntry"},
        {file(u8, "a:u8", container("P", "<ParameterSegmentRefEntry parameterRef='a'/>")), "not decoded here"},
    };
    for (const auto &[xml, reason] : cases) {
        EXPECT_THAT(refusal(xml), HasSubstr(reason)) << xml;
    }
}

TEST(Xtce, LoopsAreRefused)
{
    const auto aggregate = [](const std::string &name, const std::string &member) {
        return "<AggregateParameterType name='" + name + "'><MemberList><Member name='m' typeRef='" + member +
               "'/></MemberList></AggregateParameterType>";
    };
    const std::string u8 = integer("u8", 8);
    const auto included = [](const std::string &name) { return "<ContainerRefEntry containerRef='" + name + "'/>"; };
    EXPECT_THAT(refusal(file(aggregate("A", "A"), "", "")), HasSubstr("A contains or extends itself"));
    EXPECT_THAT(refusal(file(aggregate("A", "B") + aggregate("B", "A"), "", "")), HasSubstr("extends itself"));
    EXPECT_THAT(refusal(file("<IntegerParameterType name='A' baseType='A'/>", "", "")), HasSubstr("extends itself"));
    EXPECT_THAT(refusal(file("<ArrayParameterType name='A' arrayTypeRef='A'/>", "", "")), HasSubstr("extends itself"));
    EXPECT_THAT(refusal(file(u8, "a:u8", container("P", "a", extends("P", "a", "1")))), HasSubstr("P extends or"));
    EXPECT_THAT(
        refusal(file(u8, "a:u8",
                     container("P", "a", extends("Q", "a", "1")) + container("Q", "a", extends("P", "a", "1")))),
        HasSubstr("itself"));
    EXPECT_THAT(refusal(file(u8, "a:u8", container("P", included("P")))), HasSubstr("contains itself"));
    EXPECT_THAT(refusal(file(u8, "a:u8", container("P", included("Q")) + container("Q", "a", extends("P", "a", "1")))),
                HasSubstr("contains itself"));
    const std::string command = "<MetaCommand name='C'><BaseMetaCommand metaCommandRef='C'/></MetaCommand>";
    EXPECT_THAT(refusal("<SpaceSystem name='S'><CommandMetaData><MetaCommandSet>" + command +
                        "</MetaCommandSet></CommandMetaData></SpaceSystem>"),
                HasSubstr("the command C extends itself"));
}

TEST(Xtce, DurationsHaveDaysButNoYears)
{
    const auto window = [](const std::string &duration) {
        return "<SpaceSystem name='S'><CommandMetaData><MetaCommandSet><MetaCommand name='C'><VerifierSet>"
               "<CompleteVerifier><Comparison parameterRef='/yamcs/x' value='1'/><CheckWindow timeToStopChecking='" +
               duration +
               "'/></CompleteVerifier></VerifierSet></MetaCommand></MetaCommandSet></CommandMetaData>"
               "</SpaceSystem>";
    };
    const std::pair<const char *, double> good[] = {{"P0Y0M0DT0H1M0S", 60}, {"PT1M0.5S", 60.5},
                                                    {"P1D", 86400},         {"P0Y2DT3H4M5.25S", 183845.25},
                                                    {"P0M1D", 86400},       {"PT26H", 93600}};
    for (const auto &[text, seconds] : good) {
        EXPECT_EQ(read_xtce_text(window(text), "s.xml").commands[0].verifiers[0].stop, seconds) << text;
    }
    for (const char *text : {"P1Y", "P0Y1MT1S", "P1M"}) {
        EXPECT_THAT(refusal(window(text)), HasSubstr("is no duration of days or less: years and months have no"));
    }
    for (const char *text : {"", "P", "PT", "P1", "1D", "P1DT", "PT1D", "P1H", "PT1S1S", "PT1S1H", "PT1.5H", "-PT1S",
                             "P1DT1HT1S", "P 1D", "PT.S"}) {
        EXPECT_NE(refusal(window(text)), "") << text;
    }
}

TEST(Xtce, AnEntryThatMayBeginOrEndInFrontOfTheEndIsRefused)
{
    const auto read = [](const std::string &places) {
        std::string entries;
        for (const char place : places) {
            entries += std::string("<ParameterRefEntry parameterRef='a'><LocationInContainerInBits referenceLocation="
                                   "'containerEnd'><FixedValue>") +
                       std::to_string(8 * (place - '0')) +
                       "</FixedValue></LocationInContainerInBits></ParameterRefEntry>";
        }
        return refusal(file(integer("u8", 8), "a:u8", container("P", entries)));
    };
    EXPECT_THAT(read("1"), HasSubstr("s.xml:6: this entry ends 8 bits in front of the container's end, as XTCE counts, "
                                     "and no entry is behind it. If its begin is meant, write 0;"));
    EXPECT_THAT(read("21"), HasSubstr("ends 8 bits"));
    EXPECT_EQ(read("0"), "");
    EXPECT_EQ(read("10"), ""); // the second entry shows how this database counts
    EXPECT_EQ(read("2"), "");
}

const std::string several = // each line but the first and the last has a fault, or what depends on one
    "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet><IntegerParameterType name='u8'><IntegerDataEncoding/>"
    "</IntegerParameterType>\n"
    "<IntegerParameterType name='wide'><IntegerDataEncoding sizeInBits='65'/><Bogus/></IntegerParameterType>\n"
    "<ArrayParameterType name='list' arrayTypeRef='wide'/></ParameterTypeSet><ParameterSet>\n"
    "<Parameter name='a' parameterTypeRef='u8'/><Parameter name='w' parameterTypeRef='wide'/>\n"
    "<Parameter name='x' parameterTypeRef='absent'/></ParameterSet><ContainerSet>\n"
    "<SequenceContainer name='P'><EntryList><ParameterRefEntry parameterRef='a'/></EntryList></SequenceContainer>\n"
    "<SequenceContainer name='R'><EntryList/><BaseContainer containerRef='Q'/></SequenceContainer>\n"
    "<SequenceContainer name='Q'><EntryList><ParameterRefEntry parameterRef='w'/><ParameterRefEntry "
    "parameterRef='y'/>\n<ParameterRefEntry parameterRef='z'/></EntryList></SequenceContainer>\n"
    "</ContainerSet><Bogus/></TelemetryMetaData></SpaceSystem>";

TEST(Xtce, AllFaultsAreListedOnce)
{
    EXPECT_EQ(refusal(several), "s.xml:2: <IntegerDataEncoding> must be 1 to 64; found 65\n"
                                "s.xml:2: <Bogus> is not known in <IntegerParameterType>\n"
                                "s.xml:5: there is no type absent\n"
                                "s.xml:8: there is no parameter y\n"
                                "s.xml:9: there is no parameter z\n"
                                "s.xml:10: <Bogus> is not known in <TelemetryMetaData>");
    std::string many;
    for (int i = 0; i < 1000; i++) {
        many += "p" + std::to_string(i) + ":absent ";
    }
    EXPECT_THAT(refusal(file("", many, "")), HasSubstr("\ns.xml:103: there is no type absent\nand 900 more faults"));
}

TEST(Xtce, LenientlyTheRestIsRead)
{
    const Database database = read_xtce_text(several, "s.xml", true);
    const auto names = [](const auto &things) {
        std::string all;
        for (const auto &thing : things) {
            all += thing.name + " ";
        }
        return all;
    };
    EXPECT_EQ(names(database.types), "u8 ");
    EXPECT_EQ(names(database.parameters), "a ");
    EXPECT_EQ(names(database.containers), "P ");
    std::string all;
    for (const std::string &line : database.left_out) {
        all += line + "\n";
    }
    for (const char *thing : {"/S/wide", "/S/list", "/S/w", "/S/x", "/S/Q", "/S/R", "<Bogus>"}) {
        EXPECT_THAT(all, HasSubstr(std::string("; ") + thing + " is left out\n"));
    }
    Decoder decoder(database);
    EXPECT_EQ(text(database, decoder, decoder.decode(Bytes{7})), "a=7");
    EXPECT_TRUE(read_xtce_text(file(integer("u8", 8), "", ""), "s.xml", true).left_out.empty());
    EXPECT_THROW(read_xtce_text("<SpaceSystem name='S'>", "s.xml", true), Refusal); // its contents are not known
}

TEST(Xtce, LenientlyAParameterLosesWhatIsNotKnownInItAlone)
{
    std::string xml = file(integer("u8", 8), "a:u8", container("P", "a"));
    xml.replace(xml.find("'u8'/>"), 6, "'u8'><Color>red</Color></Parameter>");
    EXPECT_EQ(refusal(xml), "s.xml:4: <Color> is not known in <Parameter>");
    const Database database = read_xtce_text(xml, "s.xml", true);
    EXPECT_THAT(database.left_out, ElementsAre("s.xml:4: <Color> is not known in <Parameter>; <Color> is left out"));
    Decoder decoder(database);
    EXPECT_EQ(text(database, decoder, decoder.decode(Bytes{7})), "a=7");
}

TEST(Xtce, HostileDatabasesAreRefusedSoon)
{
    const auto start = std::clock();
    std::string types = integer("t0", 1), labels, steps;
    for (int i = 1; i < 60; i++) {
        const std::string inner = "'m0' typeRef='t" + std::to_string(i - 1) + "'/><Member name='m1' typeRef='t" +
                                  std::to_string(i - 1) + "'/>";
        types += "<AggregateParameterType name='t" + std::to_string(i) + "'><MemberList><Member name=" + inner +
                 "</MemberList></AggregateParameterType>";
    }
    EXPECT_THAT(refusal(file(types, "a:t59", container("P", "a"))), HasSubstr("more than 2^20 members and elements"));
    EXPECT_THAT(refusal(file(integer("u1", 1) + "<ArrayParameterType name='r' arrayTypeRef='u1'><DimensionList><Size>"
                                                "<FixedValue>1000000000</FixedValue></Size></DimensionList>"
                                                "</ArrayParameterType>",
                             "a:r", container("P", "a"))),
                HasSubstr("more than 2^20 members and elements"));
    EXPECT_THAT(
        refusal(file(integer("u8", 8), "a:u8",
                     container("P", "<ParameterRefEntry parameterRef='a'><LocationInContainerInBits><FixedValue>"
                                    "9223372036854775807</FixedValue></LocationInContainerInBits>"
                                    "</ParameterRefEntry>"))),
        HasSubstr("at most 2^40; found 9223372036854775807"));
    for (int i = 0; i < 5000; i++) {
        labels += "<Enumeration value='" + std::to_string(i) + "' label='L" + std::to_string(i) + "'/>";
    }
    std::string wide = "<EnumeratedParameterType name='e0'><EnumerationList>" + labels +
                       "</EnumerationList></EnumeratedParameterType>";
    for (int i = 1; i < 5000; i++) {
        wide += "<EnumeratedParameterType name='e" + std::to_string(i) + "' baseType='e0'/>";
    }
    EXPECT_THAT(refusal(file(wide, "", "")), HasSubstr("what its types inherit, take more than 256 MB"));
    for (int i = 0; i < 2000; i++) {
        steps += "<ValueOperand>1</ValueOperand><Operator>drop</Operator>";
    }
    EXPECT_THAT(refusal(file(integer("u8", 8, "",
                                     "<DefaultCalibrator><MathOperationCalibrator>" + steps +
                                         "</MathOperationCalibrator></DefaultCalibrator>"),
                             "", "")),
                HasSubstr("a calculation has at most 1024 steps"));
    std::string points;
    for (int i = 0; i < 200'000; i++) {
        points += "<SplinePoint raw='" + std::to_string(i) + "' calibrated='" + std::to_string(i % 7) + "'/>";
    }
    EXPECT_EQ(refusal(file(
                  integer("u8", 8, "",
                          "<DefaultCalibrator><SplineCalibrator>" + points + "</SplineCalibrator></DefaultCalibrator>"),
                  "", "")),
              "");
    EXPECT_LT(refusal(file("", "a:" + std::string(100'000, 'n'), "")).size(), 2000u);
    const std::string name(100'000, 'n');
    std::string long_names;
    for (int i = 0; i < 6000; i++) {
        long_names += "<Parameter name='p" + std::to_string(i) + "' parameterTypeRef='u8'/>";
    }
    EXPECT_THAT(refusal("<SpaceSystem name='" + name + "'><TelemetryMetaData><ParameterSet>" + long_names +
                        "</ParameterSet></TelemetryMetaData></SpaceSystem>"),
                HasSubstr("its names, and what its types inherit"));
    std::string slashes;
    for (int i = 0; i < 200'000; i++) {
        slashes += "/a";
    }
    EXPECT_THAT(refusal(file("", "", container("P", "", extends("P", slashes, "1")))),
                HasSubstr("may mean too many names"));
    EXPECT_LT(std::clock() - start, 60 * CLOCKS_PER_SEC);
}

TEST(Xtce, HostileXmlIsSurvived)
{
    const std::string bomb = "<!DOCTYPE b [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;'>]>";
    EXPECT_EQ(refusal(bomb + "<SpaceSystem name='S' shortDescription='&b;'/>"), ""); // entities are not replaced
    std::string deep, end;
    for (int i = 0; i < 100'000; i++) {
        deep += "<SpaceSystem name='S'>";
        end += "</SpaceSystem>";
    }
    EXPECT_THAT(refusal(deep + end), HasSubstr("nested deeper than 64"));
    std::string conditions;
    for (int i = 0; i < 100'000; i++) {
        conditions += "<ANDedConditions>";
    }
    EXPECT_NE(refusal(file(integer("u8", 8), "a:u8",
                           container("P", "a",
                                     "<BaseContainer containerRef='P'>"
                                     "<RestrictionCriteria>" +
                                         conditions))),
              "");
    EXPECT_NE(refusal(std::string("\xFF\xFE<\0S\0", 6)), "");
    EXPECT_NE(refusal(std::string(1 << 20, '<')), "");
    const auto start = std::clock();
    std::string many;
    for (int i = 0; i < 20'000; i++) {
        many += integer("t" + std::to_string(i), 8) + "\n";
    }
    EXPECT_EQ(refusal(file(many, "", "")), "");
    EXPECT_LT(std::clock() - start, 20 * CLOCKS_PER_SEC); // not by the square of its length
}

TEST(Xtce, FilesReferToOneAnother)
{
    const std::string folder = ::testing::TempDir();
    const auto write = [&](const std::string &name, const std::string &text) {
        std::FILE *const out = std::fopen((folder + name).c_str(), "w");
        std::fputs(text.c_str(), out);
        std::fclose(out);
        return folder + name;
    };
    const std::string types = write("types.xml", file(integer("u8", 8), "", ""));
    const std::string parameters = write("parameters.xml", "<SpaceSystem name='P'><TelemetryMetaData><ParameterSet>"
                                                           "<Parameter name='a' parameterTypeRef='/S/u8'/>"
                                                           "<Parameter name='b' parameterTypeRef='../u8'/>"
                                                           "</ParameterSet></TelemetryMetaData></SpaceSystem>");
    const Database database = read_xtce({{parameters, "/S"}, {types, ""}});
    EXPECT_EQ(database.parameters[0].path, "/S/P/a");
    EXPECT_THROW(read_xtce({{parameters, ""}, {types, ""}}), Refusal);
    EXPECT_THROW(read_xtce({{folder + "absent.xml", ""}}), Refusal);
    std::remove(types.c_str());
    std::remove(parameters.c_str());
}

TEST(Xtce, AlarmsRangesUnitsAndVerifiersAreKept)
{
    const Database database = read_xtce_text(
        "<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet><FloatParameterType name='f'>"
        "<UnitSet><Unit>m</Unit><Unit power='-1'>s</Unit></UnitSet><FloatDataEncoding/>"
        "<ValidRange minInclusive='1' maxExclusive='2'/><DefaultAlarm minViolations='3'><StaticAlarmRanges>"
        "<WarningRange minInclusive='-1'/><CriticalRange maxExclusive='9'/></StaticAlarmRanges></DefaultAlarm>"
        "<ContextAlarmList><ContextAlarm><ContextMatch><Comparison parameterRef='a' value='7'/></ContextMatch>"
        "</ContextAlarm></ContextAlarmList></FloatParameterType></ParameterTypeSet><ParameterSet>"
        "<Parameter name='a' parameterTypeRef='f' shortDescription='speed'/></ParameterSet></TelemetryMetaData>"
        "<CommandMetaData><MetaCommandSet><MetaCommand name='C'><DefaultSignificance consequenceLevel='critical'/>"
        "<VerifierSet><CompleteVerifier><Comparison parameterRef='/yamcs/x' value='1'/>"
        "<CheckWindow timeToStopChecking='PT1M0.5S'/></CompleteVerifier></VerifierSet></MetaCommand></MetaCommandSet>"
        "</CommandMetaData></SpaceSystem>",
        "s.xml");
    const Type &type = database.types[0];
    EXPECT_EQ(type.units, (std::vector<std::string>{"m", "s^-1"}));
    EXPECT_TRUE(type.valid[0].holds(1) && !type.valid[0].holds(2));
    ASSERT_EQ(type.alarms.size(), 2u);
    EXPECT_EQ(type.alarms[0].when.literal.text, "7"); // those of contexts first
    EXPECT_EQ(type.alarms[1].violations, 3u);
    EXPECT_EQ(type.alarms[1].limits[1].level, Concern::critical);
    EXPECT_EQ(database.parameters[0].description, "speed");
    EXPECT_EQ(database.commands[0].consequence, "critical");
    EXPECT_EQ(database.commands[0].verifiers[0].stage, "Complete");
    EXPECT_EQ(database.commands[0].verifiers[0].stop, 60.5);
}

/// For each kind of value: constants that a value may equal, and others, which notes name.
TEST(Xtce, AConstantThatNoValueEqualsGivesANote)
{
    const std::string types =
        integer("u8", 8) +
        "<EnumeratedParameterType name='mode'><IntegerDataEncoding/><EnumerationList><Enumeration value='1' "
        "label='SAFE'/></EnumerationList></EnumeratedParameterType><BooleanParameterType name='flag' "
        "oneStringValue='ON' zeroStringValue='OFF'><IntegerDataEncoding sizeInBits='8'/></BooleanParameterType>"
        "<BinaryParameterType name='bytes'><BinaryDataEncoding><SizeInBits><FixedValue>16</FixedValue></SizeInBits>"
        "</BinaryDataEncoding></BinaryParameterType><StringParameterType name='name'><StringDataEncoding><SizeInBits>"
        "<Fixed><FixedValue>32</FixedValue></Fixed></SizeInBits></StringDataEncoding></StringParameterType>"
        "<AbsoluteTimeParameterType name='t'><Encoding><IntegerDataEncoding sizeInBits='32'/></Encoding><ReferenceTime>"
        "<Epoch>GPS</Epoch></ReferenceTime></AbsoluteTimeParameterType><AggregateParameterType name='pair'><MemberList>"
        "<Member name='n' typeRef='u8'/></MemberList></AggregateParameterType>";
    const auto notes = [&](const std::string &parameter, const std::string &value, const std::string &more = "") {
        return read_xtce_text(
                   file(
                       types, "n:u8 m:mode f:flag b:bytes s:name t:t g:pair",
                       container("P", "n m f b s t g", "", "abstract='true'") +
                           container("Q", "n",
                                     "<BaseContainer containerRef='P'><RestrictionCriteria><Comparison parameterRef='" +
                                         parameter + "' value='" + value + "' " + more +
                                         "/></RestrictionCriteria></BaseContainer>")),
                   "s.xml")
            .notes;
    };
    const std::string raw = "useCalibratedValue='false'";
    const std::vector<std::vector<std::string>> values = {{"n", "0x1F"},
                                                          {"n", "2.5"},
                                                          {"m", "SAFE"},
                                                          {"m", "9"},
                                                          {"m", "1", raw},
                                                          {"f", "ON"},
                                                          {"f", "true"},
                                                          {"f", "1"},
                                                          {"b", "f00d"},
                                                          {"s", "any\xC3\xA9"},
                                                          {"t", "2026-02-28T01:00:00Z"},
                                                          {"t", "12"},
                                                          {"g.n", "3"}};
    for (const auto &value : values) {
        EXPECT_TRUE(notes(value[0], value[1], value.size() > 2 ? raw : "").empty()) << value[0] << " " << value[1];
    }
    const std::vector<std::vector<std::string>> others = {{"n", "abc"},        {"n", ""},       {"m", "SAVE"},
                                                          {"m", "SAFE", raw},  {"f", "OPEN"},   {"b", "xyz"},
                                                          {"t", "2026-02-30"}, {"t", "monday"}, {"g.n", "three"}};
    for (const auto &value : others) {
        EXPECT_THAT(notes(value[0], value[1], value.size() > 2 ? raw : ""),
                    ElementsAre(MatchesRegex("s.xml:[0-9]+: '" + value[1] + "' is no value of " + value[0] +
                                             "( as a raw number)?: nothing equals it")));
    }
}

/// Text with random bytes changed, removed, or repeated is read or refused; a database that is read decodes. A lenient
/// reader finds no other faults, and items that were left out stay out.
TEST(Xtce, ChangedFilesAndPacketsAreSurvived)
{
    const char *const given = std::getenv("FLEDGE_CASES");
    const long cases = given != nullptr ? std::atol(given) : 300;
    const std::string whole =
        file(integer("u8", 8) + integer("s12", 12, "encoding='twosComplement'") +
                 integer("le", 32, "byteOrder='1,0,3,2'",
                         "<DefaultCalibrator><PolynomialCalibrator><Term coefficient='2' "
                         "exponent='1'/></PolynomialCalibrator></DefaultCalibrator>") +
                 "<StringParameterType name='t'><StringDataEncoding><Variable maxSizeInBits='80'><DynamicValue>"
                 "<ParameterInstanceRef parameterRef='n'/><LinearAdjustment slope='8'/></DynamicValue><LeadingSize "
                 "sizeInBitsOfSizeTag='8'/></Variable></StringDataEncoding></StringParameterType>"
                 "<AggregateParameterType name='g'><MemberList><Member name='x' typeRef='u8'/><Member name='y' "
                 "typeRef='s12'/></MemberList></AggregateParameterType><ArrayParameterType name='r' arrayTypeRef='g'>"
                 "<DimensionList><Dimension><StartingIndex><FixedValue>0</FixedValue></StartingIndex><EndingIndex>"
                 "<DynamicValue><ParameterInstanceRef parameterRef='n'/></DynamicValue></EndingIndex></Dimension>"
                 "</DimensionList></ArrayParameterType>",
             "n:u8 a:s12 b:le c:t d:g e:r",
             container("P", "n a b", "", "abstract='true'") + container("Q", "c d", extends("P", "n", "1")) +
                 container("T", "<ParameterRefEntry parameterRef='n'/><ParameterRefEntry parameterRef='a'>"
                                "<LocationInContainerInBits referenceLocation='containerEnd'><FixedValue>3</FixedValue>"
                                "</LocationInContainerInBits></ParameterRefEntry>") +
                 container("U", "b", extends("T", "n", "3")) +
                 container("R",
                           "<ArrayParameterRefEntry parameterRef='e'/><ParameterRefEntry parameterRef='d'><RepeatEntry>"
                           "<Count><DynamicValue><ParameterInstanceRef parameterRef='n'/></DynamicValue></Count>"
                           "</RepeatEntry></ParameterRefEntry>",
                           extends("P", "n", "2")));
    std::mt19937 random(25);
    long read = 0, lenient = 0;
    for (long i = 0; i < cases; i++) {
        std::string xml = whole;
        for (unsigned j = i == 0 ? 0 : random() % 4; j > 0; j--) {
            const std::size_t at = random() % xml.size(), n = random() % 20;
            switch (random() % 4) {
            case 0: xml[at] = static_cast<char>(random()); break;
            case 1: xml.erase(at, n); break;
            case 2: xml.insert(at, xml.substr(random() % xml.size(), 10 * n)); break;
            case 3: xml[at] = "0123456789-abnPQRt"[random() % 18]; break;
            }
        }
        try {
            const Database database = read_xtce_text(xml, "s.xml");
            Decoder fast(database), slow(database, false);
            read++;
            for (int j = 0; j < 20; j++) {
                Bytes packet(random() % 64);
                for (auto &byte : packet) {
                    byte = static_cast<std::uint8_t>(random() % (random() % 2 ? 256 : 4));
                }
                const std::string planned = text(database, fast, fast.decode(packet));
                ASSERT_EQ(planned, text(database, slow, slow.decode(packet))) << xml;
                ASSERT_FALSE(planned.empty() && !packet.empty()) << xml;
            }
            ASSERT_TRUE(read_xtce_text(xml, "s.xml", true).left_out.empty());
        } catch (const Refusal &reason) {
            ASSERT_EQ(std::string(reason.what()).rfind("s.xml:", 0), 0u) << reason.what();
            try {
                const Database rest = read_xtce_text(xml, "s.xml", true);
                ASSERT_FALSE(rest.left_out.empty()) << xml;
                Decoder(rest).decode(Bytes{1, 2, 3, 4, 5, 6, 7});
                lenient++;
            } catch (const Refusal &fatal) { // no XML
                ASSERT_EQ(std::string(fatal.what()), reason.what());
            }
        }
    }
    EXPECT_GT(read, cases / 10);
    EXPECT_GT(lenient, cases / 50);
}

} // namespace xtce_test

} // namespace fledge::ground
