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
using ::testing::HasSubstr;

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

TEST(Xtce, TheThreeNameSpacesAreReadAlike)
{
    for (const std::string space : {"http://www.omg.org/space/xtce", "http://www.omg.org/spec/XTCE/20180204", ""}) {
        for (const std::string prefix : {"", "xtce:"}) {
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

/// Text with random bytes changed, cut out, or repeated is read or refused; and what is read decodes.
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
                 container("R",
                           "<ArrayParameterRefEntry parameterRef='e'/><ParameterRefEntry parameterRef='d'><RepeatEntry>"
                           "<Count><DynamicValue><ParameterInstanceRef parameterRef='n'/></DynamicValue></Count>"
                           "</RepeatEntry></ParameterRefEntry>",
                           extends("P", "n", "2")));
    std::mt19937 random(25);
    long read = 0;
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
                const std::string one = text(database, fast, fast.decode(packet));
                ASSERT_EQ(one, text(database, slow, slow.decode(packet))) << xml;
                ASSERT_FALSE(one.empty() && !packet.empty()) << xml;
            }
        } catch (const Refusal &reason) {
            ASSERT_EQ(std::string(reason.what()).rfind("s.xml:", 0), 0u) << reason.what();
        }
    }
    EXPECT_GT(read, cases / 10);
}

} // namespace xtce_test

} // namespace fledge::ground
