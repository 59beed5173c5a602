// SPDX-License-Identifier: Apache-2.0
#include "flight/telemetry/telemetry.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

namespace telemetry_test {

struct Message {
    Head head;
    double x;
};
struct Mission {
    Message slow, fast;
};

const ExecRun numbers[] = {{8, 1}, {4, 2}, {8, 1}};
const TelemetryOutput outputs[] = {{numbers, 3, offsetof(Mission, slow), sizeof(Message)},
                                   {numbers, 3, offsetof(Mission, fast), sizeof(Message)}};
TelemetryRate rates[5 + COMMAND_STREAMS];
uint8_t packet[TELEMETRY_REPORT_MAX], letters[100];
TelemetryTexts texts;
const TelemetryTable table = {0x0890, 2, outputs, rates, packet, [](const void *) -> uint16_t { return 3; }, &texts};

struct Telemetry : testing::Test {
    using Packet = std::vector<uint8_t>;

    Telemetry()
    {
        telemetry_begin(&table);
        texts = {letters, sizeof letters, 0, 0};
        command_begin(&state);
    }
    static void sink(void *user, const uint8_t *bytes, uint32_t n)
    {
        static_cast<Telemetry *>(user)->packets.emplace_back(bytes, bytes + n);
    }
    /// The number of a type at a byte of a packet, whose first byte is the highest.
    template <class T> static T at(const Packet &p, size_t place)
    {
        uint64_t bits = 0;
        for (size_t i = 0; i < sizeof(T); i++) {
            bits = bits << 8 | p.at(place + i);
        }
        if constexpr (sizeof(T) == 8) {
            return std::bit_cast<T>(bits);
        } else {
            return static_cast<T>(bits);
        }
    }
    /// Run to the n-th instant, of 250 ms each: `fast` is written at each, `slow` at every second one.
    void run(int n)
    {
        for (; instant < n; instant++) {
            const int64_t t = instant * INT64_C(250000000);
            mission.fast = {head_next(mission.fast.head, t, QUALITY_GOOD), 1.0 * instant};
            if (instant % 2 == 0) {
                mission.slow = {head_next(mission.slow.head, t, QUALITY_GOOD), -1.0 * instant};
            }
            telemetry_send(&table, &mission, t, &state, sink, this);
        }
    }
    std::vector<double> values(int stream) const
    {
        std::vector<double> found;
        for (const Packet &p : packets) {
            if (p[0] == 0x08 && p[1] == stream) {
                found.push_back(at<double>(p, 16 + offsetof(Message, x)));
            }
        }
        return found;
    }

    CommandState state;
    Mission mission{};
    int64_t instant = 0;
    std::vector<Packet> packets;
};

TEST_F(Telemetry, AServiceTellsAndReportsUntilItHasNothing)
{
    static int written, done;
    static std::vector<uint16_t> stages;
    written = done = 0;
    stages.clear();
    CommandService files{};
    files.telemetry = [](const CommandContext *, void *, uint8_t *content) -> uint32_t {
        content[0] = 0xAB;
        return written++ < 2 ? 1 : 0;
    };
    files.report = [](const CommandContext *, void *, CommandReport *report) {
        report->executed = done == 0 ? COMMAND_UNDER_WAY : COMMAND_DONE;
        return done++ < 2 ? 1 : 0;
    };
    files.stream = STREAM_FILES;
    const CommandService silent{};
    const CommandService *const list[] = {&silent, &files};
    CommandServices services{};
    services.list = list;
    services.n = 2;
    services.module = [](void *m, uint32_t) { return m; };
    CommandTable commands{};
    commands.services = &services;
    const CommandContext context = {&state, &commands, &mission, 7, 0};
    telemetry_services(
        &table, &context,
        [](void *, const CommandReport *report, const uint8_t *) { stages.push_back(report->executed); }, sink, this);
    ASSERT_EQ(packets.size(), 2u);
    EXPECT_EQ(at<uint16_t>(packets[1], 0), 0x0890 + 3 + 2 + STREAM_FILES);
    EXPECT_EQ(at<uint16_t>(packets[1], 2), 0xC001);
    EXPECT_EQ(packets[1].size(), TELEMETRY_HEADER + 1u);
    EXPECT_EQ(packets[1].back(), 0xAB);
    EXPECT_EQ(stages, (std::vector<uint16_t>{COMMAND_UNDER_WAY, COMMAND_DONE}));
    EXPECT_EQ(state.counters.executed, 1u); // what is under way does not count
}

TEST_F(Telemetry, NothingIsSentUntilItIsTurnedOn)
{
    run(10);
    EXPECT_EQ(packets.size(), 0u);
    telemetry_rate(&table, COMMAND_ALL, 1, 1);
    run(12);
    EXPECT_EQ(packets.size(), 2u + 1u + 2u); // two of fast, one of slow, two of housekeeping
    telemetry_rate(&table, COMMAND_ALL, 0, 1);
    run(20);
    EXPECT_EQ(packets.size(), 5u);
}

TEST_F(Telemetry, ARateCountsWritingsNotInstants)
{
    telemetry_rate(&table, 0, 1, 2);
    telemetry_rate(&table, 1, 1, 3);
    run(12);
    EXPECT_EQ(values(0x92), (std::vector<double>{-2, -6, -10}));
    EXPECT_EQ(values(0x93), (std::vector<double>{2, 5, 8, 11}));
}

TEST_F(Telemetry, WhatWasNotSentSinceTheLastTimeIsRepeated)
{
    telemetry_rate(&table, 0, 1, 4);
    telemetry_rate(&table, 1, 1, 1);
    run(5); // three writings of slow, none of which is sent
    const auto repeated = [&](int n) {
        telemetry_repeat(&table);
        packets.clear();
        run(n);
        return values(0x92);
    };
    EXPECT_EQ(repeated(6), std::vector<double>{-4});
    EXPECT_EQ(values(0x93), std::vector<double>{5}); // once
    EXPECT_EQ(repeated(8), std::vector<double>{});   // it was sent
    EXPECT_EQ(repeated(9), std::vector<double>{-8});
    telemetry_rate(&table, 0, 0, 4);
    EXPECT_EQ(repeated(10), std::vector<double>{});
    EXPECT_EQ(repeated(12), std::vector<double>{}); // though twice nothing was sent
    telemetry_rate(&table, 0, 1, 1);
    mission.slow.head.sequence = 0;
    EXPECT_EQ(repeated(12), std::vector<double>{});
}

TEST_F(Telemetry, AMissionWithoutTextsOrDataSendsTheRest)
{
    TelemetryTable bare = table;
    bare.texts = nullptr;
    telemetry_rate(&bare, 1, 1, 1);
    mission.fast.head.sequence = 1;
    telemetry_text(&texts, 0, TELEMETRY_PRINTED, 7, 1, "one");
    telemetry_send(&bare, &mission, 0, &state, sink, this);
    EXPECT_EQ(packets.size(), 1u);
    const CommandReport report = {-1, 9, COMMAND_MODE, 1, COMMAND_OK, 0, 0, 2, 0};
    telemetry_report(&bare, &report, nullptr, sink, this);
    EXPECT_EQ(packets.at(1).size(), TELEMETRY_HEADER + sizeof report);
}

TEST_F(Telemetry, TheHeaderIsThatOfCcsds)
{
    telemetry_rate(&table, 1, 1, 1);
    run(8);
    const Packet &last = packets.back();
    const Packet header{0x08, 0x93, 0xC0, 7, 0, 16 + sizeof(Message) - 7, 0, 0, 0, 1, 0xC0, 0, 0, 0, 0, 0};
    EXPECT_EQ(Packet(last.begin(), last.begin() + 16), header); // 1.75 s
    EXPECT_EQ(last.size(), 16 + sizeof(Message));
    run(0x4003); // the sequence has 14 bits
    EXPECT_EQ(packets.back()[2], 0xC0);
    EXPECT_EQ(packets.back()[3], 2);
}

TEST_F(Telemetry, NumbersAreBigEndianAndAHostCanHaveThemNative)
{
    telemetry_rate(&table, 1, 1, 1);
    run(4);
    const Packet &last = packets.back();
    const Packet expected{0,    0, 0, 0, 0x2C, 0xB4, 0x17, 0x80, 0, 0, 0, 3, 0, 0, 0, 4, // 0.75 s, good, the fourth
                          0x40, 8, 0, 0, 0,    0,    0,    0};                           // 3.0
    EXPECT_EQ(Packet(last.begin() + 16, last.end()), expected);
    telemetry_native(&table, packet);
    EXPECT_EQ(std::memcmp(packet + 16, &mission.fast, sizeof(Message)), 0);
    EXPECT_EQ(Packet(packet, packet + 16), Packet(last.begin(), last.begin() + 16));
}

TEST_F(Telemetry, HousekeepingHasTheCountersAndTheMode)
{
    state.counters.accepted = 5;
    state.counters.reasons[COMMAND_CRC] = 2;
    state.ground = {1, 0x1234};
    telemetry_rate(&table, 2, 1, 4);
    run(9);
    ASSERT_EQ(packets.size(), 2u);
    const size_t size = offsetof(TelemetryHousekeeping, ground) + sizeof(CommandLink);
    ASSERT_EQ(packets[1].size(), 16 + size);
    EXPECT_EQ(packets[1][1], 0x90);
    const auto number = [&](size_t place) { return at<uint32_t>(packets[1], 16 + place); };
    EXPECT_EQ(at<int64_t>(packets[1], 16), 1750000000);
    EXPECT_EQ(number(offsetof(TelemetryHousekeeping, mode)), 3u);
    EXPECT_EQ(number(offsetof(TelemetryHousekeeping, commands.accepted)), 5u);
    EXPECT_EQ(number(offsetof(TelemetryHousekeeping, commands.reasons) + 4 * COMMAND_CRC), 2u);
    EXPECT_EQ(at<uint16_t>(packets[1], 16 + offsetof(TelemetryHousekeeping, ground.last)), 0x1234);
    telemetry_native(&table, packet);
    TelemetryHousekeeping h;
    std::memcpy(&h, packet + 16, size);
    EXPECT_EQ(h.commands.reasons[COMMAND_CRC], 2u);
    EXPECT_EQ(h.ground.last, 0x1234);
}

TEST_F(Telemetry, AReportHasTheBytesThatWereReadBack)
{
    const uint8_t data[] = {1, 2, 3};
    const CommandReport report = {-1, 9, COMMAND_READ, 1, COMMAND_OK, 0, 3, 2, 0};
    telemetry_report(&table, &report, data, sink, this);
    EXPECT_EQ(packets.at(0)[1], 0x91);
    const Packet expected{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0, 9, 0, 9, 0, 1,
                          0,    0,    0,    0,    0,    3,    0,    2,    0, 0, 1, 2, 3};
    EXPECT_EQ(Packet(packets[0].begin() + 16, packets[0].end()), expected);
    telemetry_native(&table, packet);
    EXPECT_EQ(std::memcmp(packet + 16, &report, sizeof report), 0);
    EXPECT_EQ(std::memcmp(packet + 16 + sizeof report, data, 3), 0);
    EXPECT_EQ(packets[0][9], 0); // no time before the first instant
}

TEST_F(Telemetry, TextsGoOutAtTheEndOfTheInstantInTheirOrder)
{
    telemetry_rate(&table, 1, 1, 1);
    telemetry_text(&texts, 0, TELEMETRY_PRINTED, 7, 70000, "one");
    telemetry_text(&texts, 0, TELEMETRY_PROCEDURE_KILLED, 8, 3, "");
    EXPECT_EQ(packets.size(), 0u);
    run(2);
    ASSERT_EQ(packets.size(), 4u); // two of fast
    EXPECT_EQ(packets[1][1], 0x94);
    const Packet first{0, 0, 0, 0, 0, 0, 0, 0, 0, 5, 0, 7, 0xFF, 0xFF, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 'o', 'n', 'e'},
        second{0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 8, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    EXPECT_EQ(Packet(packets[1].begin() + 16, packets[1].end()), first);
    EXPECT_EQ(Packet(packets[2].begin() + 16, packets[2].end()), second);
    EXPECT_EQ(packets[2][3], 1); // the sequence counts the texts
}

TEST_F(Telemetry, TextsWithoutRoomAreCounted)
{
    for (const char *text : {"sixteen letters.", "sixteen letters.", "sixteen letters.", "sixteen letters."}) {
        telemetry_text(&texts, 0, TELEMETRY_SCRIPT, 0, 0, text);
    }
    run(1);
    EXPECT_EQ(packets.size(), 2u); // 48 bytes each
    telemetry_text(&texts, 5, TELEMETRY_SCRIPT, 0, 0, std::string(1000, 'x').c_str());
    telemetry_text(&texts, 5, TELEMETRY_SCRIPT, 0, 0, "x");
    telemetry_text(&texts, 5, TELEMETRY_SCRIPT, 0, 0, "x");
    run(2);
    ASSERT_EQ(packets.size(), 4u);
    EXPECT_EQ(at<uint32_t>(packets[2], 16 + offsetof(TelemetryText, lost)), 3u);
    EXPECT_EQ(at<uint32_t>(packets[3], 16 + offsetof(TelemetryText, lost)), 0u);
}

TEST_F(Telemetry, ALongTextIsCut)
{
    std::vector<uint8_t> memory(2000);
    TelemetryTexts large{memory.data(), 2000, 0, 0};
    telemetry_text(&large, 5, TELEMETRY_SCRIPT, 0, 0, std::string(1000, 'x').c_str());
    EXPECT_EQ(large.used, sizeof(TelemetryText) + COMMAND_DATA_MAX);
}

} // namespace telemetry_test
