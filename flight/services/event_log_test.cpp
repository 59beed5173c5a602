// SPDX-License-Identifier: Apache-2.0
// The log of events through the code that executes commands.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/services/event_log.h"
}

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

namespace event_log_test {

using namespace service_testing;

constexpr uint16_t outputs = 30;

struct Mission {
    EventLog log;
    FlightEvent written[outputs];
};

const CommandService *const kinds[] = {&event_log_service};
uint8_t queue[COMMAND_MAX];

struct Sent {
    uint32_t number;
    uint16_t output;
    uint32_t id;
    uint16_t severity;
    uint32_t before;
    int64_t t;
    double first;
};

class Log : public testing::Test {
protected:
    Log()
    {
        for (uint16_t i = 0; i < outputs; i++) {
            places_[i] = i;
        }
        services_.events = places_;
        services_.n_events = 4;
        table_.n_outputs = outputs;
        table_.reset = [](void *m, int64_t) {
            auto &mission = *static_cast<Mission *>(m);
            event_log_reset(&mission.log);
            std::memset(mission.written, 0, sizeof mission.written);
        };
        command_begin(&state_);
        event_log_reset(&mission_.log);
    }

    void publish(int output, uint32_t id, EventSeverity severity, double first = 0.0)
    {
        FlightEvent event{};
        event.id = id;
        event.severity = severity;
        event.arguments[0] = first;
        event_publish(&mission_.written[output], t_, event);
    }

    /// The end of the instant; returns the numbers of the events that it sends.
    std::string ends(bool updates = true)
    {
        if (updates) {
            event_log_update(&mission_.log, {t_, 10});
        }
        std::string numbers;
        sent_.clear();
        const CommandContext context{&state_, &table_, &mission_, t_, 0};
        uint8_t content[COMMAND_DATA_MAX];
        while (const uint32_t n = event_log_service.telemetry(&context, &mission_.log, content)) {
            EXPECT_EQ(n, 56u);
            take(content);
            numbers += std::to_string(sent_.back().number) + " ";
        }
        t_ += 10;
        return numbers;
    }

    void take(const uint8_t *p)
    {
        Sent packet{static_cast<uint32_t>(number(p + 8, 4)),
                    static_cast<uint16_t>(number(p + 16, 2)),
                    static_cast<uint32_t>(number(p + 20, 4)),
                    static_cast<uint16_t>(number(p + 18, 2)),
                    static_cast<uint32_t>(number(p + 12, 4)),
                    static_cast<int64_t>(number(p, 8)),
                    0.0};
        const uint64_t bits = number(p + 24, 8);
        std::memcpy(&packet.first, &bits, sizeof bits);
        sent_.push_back(packet);
    }

    CommandReason command(uint8_t code)
    {
        const Bytes p = packet(code, big(0x1234, 2), 0);
        const auto ignore = [](void *, const CommandReport *, const uint8_t *) {};
        const CommandReason reason =
            command_accept(&state_, &table_, nullptr, p.data(), static_cast<uint32_t>(p.size()), ignore, nullptr);
        command_execute(&state_, &table_, &mission_, t_, ignore, nullptr);
        return reason;
    }

    const EventLogState &shown()
    {
        ends();
        return mission_.log.out.state;
    }

    uint16_t places_[outputs];
    CommandServices services_ = command_services(
        kinds, 1, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->log; },
        [](const void *m, uint16_t place, uint32_t *size) -> const void * {
            *size = sizeof(FlightEvent);
            return &static_cast<const Mission *>(m)->written[place];
        });
    CommandTable table_ = command_table(&services_, queue, sizeof queue);
    CommandState state_{};
    Mission mission_{};
    std::vector<Sent> sent_;
    int64_t t_ = 100;
};

TEST_F(Log, EachEventIsSentOnceAtTheEndOfItsInstant)
{
    EXPECT_EQ(ends(), "");
    publish(2, 7, EVENT_MEDIUM, 0.25);
    publish(1, 9, EVENT_INFO);
    EXPECT_EQ(ends(false), "1 2 ");
    EXPECT_EQ(sent_[0].output, 1);
    EXPECT_EQ(sent_[0].id, 9u);
    EXPECT_EQ(sent_[1].output, 2);
    EXPECT_EQ(sent_[1].id, 7u);
    EXPECT_EQ(sent_[1].severity, EVENT_MEDIUM);
    EXPECT_EQ(sent_[1].first, 0.25);
    EXPECT_EQ(sent_[1].t, 110);
    EXPECT_EQ(sent_[1].before, 0u);
    EXPECT_EQ(ends(), "");
    publish(2, 8, EVENT_LOW);
    EXPECT_EQ(ends(), "3 ");
    t_ -= 10;
    publish(2, 9, EVENT_LOW); // at the same time, after it was seen
    EXPECT_EQ(ends(), "4 ");
    EXPECT_EQ(sent_[0].id, 9u);
    EXPECT_EQ(shown().kept, 4u);
    EXPECT_EQ(shown().logged, 4u);
    EXPECT_EQ(event_log_service.stream, STREAM_EVENTS);
}

TEST_F(Log, OfOneInstantTheGravestIsLoggedAndTheOthersAreCounted)
{
    publish(0, 1, EVENT_INFO);
    publish(0, 2, EVENT_HIGH);
    publish(0, 3, EVENT_LOW);
    publish(1, 4, EVENT_LOW);
    publish(1, 5, EVENT_LOW);
    EXPECT_EQ(ends(), "1 2 ");
    EXPECT_EQ(sent_[0].id, 2u);
    EXPECT_EQ(sent_[0].before, 2u);
    EXPECT_EQ(sent_[1].id, 5u); // of equal ones the last
    EXPECT_EQ(sent_[1].before, 1u);
    publish(0, 4, EVENT_LOW);
    EXPECT_EQ(ends(), "3 ");
    EXPECT_EQ(sent_[0].before, 0u);
    for (uint32_t i = 0; i < 2; i++) {
        mission_.written[0] = {}; // its module was reset
        EXPECT_EQ(ends(), "");
        publish(0, 5, EVENT_LOW);
        EXPECT_EQ(ends(), std::to_string(4 + i) + " ");
        EXPECT_EQ(sent_[0].before, 0u);
    }
    mission_.written[0] = {};
    publish(0, 6, EVENT_LOW); // where the last one had the same sequence
    EXPECT_EQ(ends(), "6 ");
    EXPECT_EQ(shown().replaced, 3u);
}

TEST_F(Log, WhatIsNotGraveEnoughIsCountedByTheRulesOfItsOutput)
{
    mission_.log.par.least = EVENT_MEDIUM;
    mission_.log.par.filters[5] = {0, 1, EVENT_INFO, 0};
    mission_.log.par.filters[6] = {1, 2, 5, 0};
    mission_.log.par.filters[7] = {1, 3, EVENT_INFO, 0};
    for (int i = 0; i < 4; i++) {
        publish(i, 1, EVENT_LOW);
    }
    EXPECT_EQ(ends(), "1 ");
    EXPECT_EQ(sent_[0].output, 3);
    for (int i = 0; i < 4; i++) {
        publish(i, 1, i == 0 ? EVENT_MEDIUM : EVENT_HIGH);
    }
    EXPECT_EQ(ends(), "2 3 4 ");
    EXPECT_EQ(shown().below, 4u);
    event_log_reset(&mission_.log);
    std::memset(mission_.written, 0, sizeof mission_.written);
    EXPECT_EQ(shown().below, 0u);
}

TEST_F(Log, TooManyInATimeAreSuppressedAndCounted)
{
    mission_.log.par.most = 2;
    mission_.log.par.window = 50e-9;
    mission_.log.par.filters[0] = {1, 1, 0, 3};
    std::string first, second;
    for (int i = 0; i < 10; i++) {
        publish(0, static_cast<uint32_t>(i), EVENT_INFO);
        publish(1, static_cast<uint32_t>(i), EVENT_INFO);
        ends();
        for (const Sent &packet : sent_) {
            (packet.output == 0 ? first : second) +=
                std::to_string(packet.id) + ":" + std::to_string(packet.before) + " ";
        }
    }
    EXPECT_EQ(first, "0:0 1:0 5:3 6:0 ");
    EXPECT_EQ(second, "0:0 1:0 2:0 5:2 6:0 7:0 ");
    EXPECT_EQ(shown().suppressed, 10u);
    mission_.log.par.window = 300e-9;
    std::string third; // the window begins with the first event, at 210
    for (int i = 0; i < 40; i++) {
        publish(2, static_cast<uint32_t>(i), EVENT_INFO);
        ends();
        for (const Sent &packet : sent_) {
            third += std::to_string(packet.id) + " ";
        }
    }
    EXPECT_EQ(third, "0 1 30 31 ");
    EXPECT_EQ(shown().suppressed, 46u);
}

TEST_F(Log, TheLastAreSentAgainByCommand)
{
    EXPECT_EQ(command(COMMAND_EVENTS), COMMAND_OK);
    EXPECT_EQ(ends(), ""); // there is none
    for (uint32_t i = 1; i <= 40; i++) {
        publish(0, i, EVENT_INFO);
        ends();
    }
    EXPECT_EQ(command(COMMAND_EVENTS), COMMAND_OK);
    EXPECT_EQ(mission_.log.out.state.kept, 32u);
    EXPECT_EQ(ends(), "9 10 11 12 ");
    EXPECT_EQ(sent_[0].id, 9u);
    EXPECT_EQ(ends(false), ""); // four at each update
    publish(1, 77, EVENT_INFO); // in place of number 9; a new one comes first
    EXPECT_EQ(ends(), "41 13 14 15 16 ");
    std::string rest;
    for (int i = 0; i < 8; i++) {
        rest += ends();
    }
    EXPECT_EQ(rest, "17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39 40 ");
    command(COMMAND_EVENTS);
    for (int i = 0; i < 20; i++) { // those that are overwritten meanwhile are left out
        for (int output = 0; output < 4; output++) {
            publish(output, 1, EVENT_INFO);
        }
        const std::string numbers = ends();
        EXPECT_EQ(sent_.size(), i < 7 ? 8u : 4u) << i << ": " << numbers;
        EXPECT_EQ(sent_.back().number, static_cast<uint32_t>(i < 7 ? 17 + 4 * i : 45 + 4 * i));
    }
}

TEST_F(Log, AResetOfFlightKeepsTheRecordsAndTheirNumbers)
{
    publish(0, 1, EVENT_HIGH);
    ends();
    command(COMMAND_RESET_FLIGHT);
    EXPECT_EQ(mission_.log.out.state.logged, 0u);
    publish(0, 2, EVENT_HIGH);
    EXPECT_EQ(ends(), "2 ");
    EXPECT_EQ(sent_[0].before, 0u);
    command(COMMAND_EVENTS);
    EXPECT_EQ(ends(), "1 2 ");
    command(COMMAND_EVENTS);
    command(COMMAND_RESET_FLIGHT);
    EXPECT_EQ(ends(), ""); // what was to be sent again is forgotten,
    command(COMMAND_EVENTS);
    EXPECT_EQ(ends(), "1 2 ");
    event_log_update(&mission_.log, {t_, 10});
    command(COMMAND_RESET_FLIGHT);
    command(COMMAND_EVENTS);
    EXPECT_EQ(ends(false), ""); // and there was no update since
}

TEST_F(Log, AnotherRunBeginsWithoutRecords)
{
    for (const int64_t begins : {5, 5, 0, 0}) { // the same event as in the one before
        t_ = begins;
        event_log_reset(&mission_.log);
        mission_.written[0] = {};
        publish(0, 3, EVENT_HIGH);
        EXPECT_EQ(ends(), "1 ") << begins;
    }
}

TEST_F(Log, OutputsBeyondItsMemoryAreReported)
{
    services_.n_events = outputs;
    publish(outputs - 1, 1, EVENT_HIGH);
    publish(EVENT_SOURCES, 1, EVENT_HIGH);
    publish(EVENT_SOURCES - 1, 1, EVENT_HIGH);
    EXPECT_EQ(ends(), "1 ");
    EXPECT_EQ(shown().unseen, outputs - EVENT_SOURCES);
    EXPECT_EQ(shown().head.quality, QUALITY_DEGRADED);
}

} // namespace event_log_test
