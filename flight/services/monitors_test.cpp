// SPDX-License-Identifier: Apache-2.0
// Monitors through the code that executes all commands: they start lists of a service that the test has.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/services/monitors.h"
}

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace monitors_test {

using namespace service_testing;

struct Output {
    Head head;
    double x[3];
    int32_t mode;
    uint16_t word;
    uint16_t spare;
};

struct Mission {
    Monitors monitors;
    Output output;
    std::string log; ///< the lists that were started
};

CommandReason refuse = COMMAND_OK;

/// Notes what is to be started.
const CommandService lists = command_service(
    COMMAND_STORE, 4, [](const uint8_t *packet, uint32_t) { return packet[11] < 9 ? COMMAND_OK : COMMAND_PLACE; },
    [](const CommandContext *context, void *, const uint8_t *packet, CommandReport *, uint8_t *) {
        static_cast<Mission *>(context->mission)->log += static_cast<char>('0' + packet[11]);
        return refuse;
    });
const CommandService *const kinds[] = {&monitors_service, &lists};
const CommandServices services = command_services(
    kinds, 2, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->monitors; },
    [](const void *m, uint16_t place, uint32_t *size) -> const void * {
        *size = place == 2 ? sizeof(Output) : sizeof(Head);
        return &static_cast<const Mission *>(m)->output;
    });
uint8_t queue[2 * COMMAND_MAX];

class Watch : public testing::Test {
protected:
    Watch()
    {
        table_.n_outputs = 3;
        command_begin(&state_);
        monitors_reset(&mission_.monitors);
    }

    static Monitor limits(double low, double high, uint32_t list, uint32_t at = offsetof(Output, x))
    {
        Monitor monitor{};
        monitor.low = low;
        monitor.high = high;
        monitor.kind = MONITOR_LIMITS;
        monitor.on = 1;
        monitor.output = 2;
        monitor.offset = at;
        monitor.type = FLEDGE_F64;
        monitor.n = 1;
        monitor.list = list;
        return monitor;
    }

    Monitor &monitor(int i) { return mission_.monitors.par.monitors[i]; }
    const MonitorState &shown() const { return mission_.monitors.out.state; }
    const FlightEvent &event() const { return mission_.monitors.out.event; }

    /// The last instant left x; returns the lists that are started at the next one.
    std::string sees(double x)
    {
        mission_.output.x[0] = x;
        mission_.output.head = {t_, QUALITY_GOOD, mission_.output.head.sequence + 1};
        return at();
    }

    std::string at()
    {
        mission_.log.clear();
        t_ += 10;
        command_execute(
            &state_, &table_, &mission_, t_,
            [](void *self, const CommandReport *report, const uint8_t *) {
                static_cast<Watch *>(self)->reports_.push_back(*report);
            },
            this);
        monitors_update(&mission_.monitors, {t_, 10});
        return mission_.log;
    }

    CommandTable table_ = command_table(&services, queue, sizeof queue);
    CommandState state_{};
    Mission mission_{};
    std::vector<CommandReport> reports_;
    int64_t t_ = 0;
};

TEST_F(Watch, ALimitThatIsBrokenStartsASequenceOnceUntilItHeldAgain)
{
    monitor(3) = limits(-1.0, 2.0, 5);
    EXPECT_EQ(at(), ""); // nothing was written yet
    EXPECT_EQ(sees(2.0), "");
    EXPECT_EQ(sees(2.1), "5");
    EXPECT_EQ(shown().wrong, 8u);
    EXPECT_EQ(shown().held, 8u);
    EXPECT_EQ(event().id, MONITORS_FIRED);
    EXPECT_EQ(event().severity, EVENT_MEDIUM);
    EXPECT_EQ(event().arguments[0], 3.0);
    EXPECT_EQ(event().arguments[1], 2.1);
    EXPECT_EQ(event().head.t, t_);
    EXPECT_EQ(sees(3.0), "");
    EXPECT_EQ(sees(1.0), "");
    EXPECT_EQ(event().id, MONITORS_RIGHT);
    EXPECT_EQ(event().head.sequence, 2u);
    EXPECT_EQ(sees(-1.5), "5");
    EXPECT_EQ(sees(0.0), "");
    EXPECT_EQ(sees(std::numeric_limits<double>::quiet_NaN()), "5");
    EXPECT_EQ(shown().fired, 3u);
    ASSERT_EQ(reports_.size(), 6u); // accepted and executed
    EXPECT_EQ(reports_[1].origin, COMMAND_OF_MONITOR + 3);
    EXPECT_EQ(reports_[1].code, COMMAND_CONTROL);
    EXPECT_EQ(reports_[1].reason, COMMAND_OK);
}

TEST_F(Watch, PersistenceIsATimeAndACountOfInstants)
{
    monitor(0) = limits(0.0, 1.0, 1);
    monitor(0).hold = 20;
    monitor(1) = limits(0.0, 1.0, 2);
    monitor(1).count = 4;
    EXPECT_EQ(sees(5.0), "");
    EXPECT_EQ(sees(5.0), "");
    EXPECT_EQ(sees(0.5), ""); // from the beginning
    EXPECT_EQ(sees(5.0), "");
    EXPECT_EQ(at(), ""); // no writing: what was wrong still is
    EXPECT_EQ(at(), "1");
    EXPECT_EQ(at(), "2");
    EXPECT_EQ(at(), "");
}

TEST_F(Watch, AChangeFromWritingToWriting)
{
    monitor(0) = limits(-0.5, 0.5, 1);
    monitor(0).kind = MONITOR_DELTA;
    EXPECT_EQ(sees(100.0), ""); // there is none yet
    EXPECT_EQ(sees(100.5), "");
    EXPECT_EQ(at(), "");
    EXPECT_EQ(sees(101.1), "1");
    EXPECT_EQ(sees(101.1), "");
    EXPECT_EQ(sees(100.0), "1");
}

TEST_F(Watch, AnExpectedValueOfAnyTypeAndAMeasure)
{
    monitor(0) = limits(7.0, 0.0, 1, offsetof(Output, word));
    monitor(0).kind = MONITOR_EXPECTED;
    monitor(0).type = FLEDGE_U16;
    monitor(1) = limits(-2.0, 0.0, 2, offsetof(Output, mode));
    monitor(1).kind = MONITOR_EXPECTED;
    monitor(1).type = FLEDGE_ENUM;
    monitor(2) = limits(0.0, 5.0, 3);
    monitor(2).n = 3;
    monitor(2).measure = EXEC_NORM;
    mission_.output.word = 7;
    mission_.output.mode = -2;
    mission_.output.x[1] = 4.0;
    EXPECT_EQ(sees(3.0), ""); // 5
    mission_.output.word = 8;
    EXPECT_EQ(sees(3.0), "1");
    mission_.output.mode = -1;
    EXPECT_EQ(sees(3.1), "23");
}

TEST_F(Watch, BitsOfAWholeNumber)
{
    monitor(0) = limits(0.0, 0.0, 1, offsetof(Output, word));
    monitor(0).kind = MONITOR_BITS;
    monitor(0).type = FLEDGE_U16;
    monitor(0).bits = 0x8005;
    monitor(1) = limits(0.0, 0.0, 2, offsetof(Output, mode));
    monitor(1).kind = MONITOR_BITS;
    monitor(1).type = FLEDGE_I32;
    monitor(1).bits = 0x80000000;
    mission_.output.word = 0x7FFA;
    mission_.output.mode = 0x7FFFFFFF;
    EXPECT_EQ(sees(0.0), "");
    mission_.output.word = 0x0104;
    EXPECT_EQ(sees(0.0), "1");
    mission_.output.word = 0x8000;
    mission_.output.mode = -0x7FFFFFFF;
    EXPECT_EQ(sees(0.0), "2") << "the first was wrong all the time";
    mission_.output.word = 2;
    EXPECT_EQ(sees(0.0), "");
    mission_.output.word = 1;
    EXPECT_EQ(sees(0.0), "1");
    for (const FledgeType type : {FLEDGE_F64, FLEDGE_F32, FLEDGE_U64, FLEDGE_ENUM}) {
        monitor(2) = limits(0.0, 0.0, 3);
        monitor(2).kind = MONITOR_BITS;
        monitor(2).type = type;
        monitor(2).bits = 1;
        EXPECT_EQ(sees(std::nan("")), "");
        EXPECT_EQ(shown().bad, 0b100u) << type;
    }
}

TEST_F(Watch, OneThatIsOffForgetsAndOneThatNamesNoNumberIsReportedAsBad)
{
    monitor(0) = limits(0.0, 1.0, 1);
    EXPECT_EQ(sees(5.0), "1");
    monitor(0).on = 0;
    EXPECT_EQ(at(), "");
    EXPECT_EQ(shown().on, 0u);
    monitor(0).on = 1;
    EXPECT_EQ(at(), "1");
    for (int i = 1; i < 7; i++) {
        monitor(i) = limits(0.0, 1.0, 1);
    }
    monitor(1).output = 3;
    monitor(2).offset = sizeof(Output);
    monitor(3).n = 0xFFFFFFFFu;
    monitor(4).type = FLEDGE_CHAR;
    monitor(5).output = 1; // which is shorter
    monitor(6).n = 0;
    at();
    EXPECT_EQ(shown().bad, 0x7Eu);
    EXPECT_EQ(event().id, MONITORS_BAD);
    EXPECT_EQ(event().arguments[0], 6.0);
    EXPECT_EQ(event().count, 2u + 6u);
    at();
    EXPECT_EQ(event().count, 2u + 6u); // it is reported once
    EXPECT_EQ(shown().head.quality, QUALITY_DEGRADED);
}

TEST_F(Watch, AKindThatIsNoneChecksNothing)
{
    monitor(0) = limits(0.0, 1.0, 1);
    EXPECT_EQ(sees(5.0), "1");
    monitor(0).kind = MONITOR_NOTHING;
    EXPECT_EQ(at(), "");
    EXPECT_EQ(shown().wrong, 0u);
    monitor(0).kind = static_cast<MonitorKind>(MONITOR_BITS + 1); // of a damaged table
    EXPECT_EQ(sees(6.0), "");
    EXPECT_EQ(shown().wrong + shown().bad, 0u);
    monitor(0).kind = MONITOR_LIMITS;
    EXPECT_EQ(sees(5.0), "1"); // as if it were new
    monitor(0) = limits(0.0, 0.0, 1, offsetof(Output, word));
    monitor(0).kind = MONITOR_BITS;
    monitor(0).type = FLEDGE_U16;
    monitor(0).measure = EXEC_NORM; // which has no bits
    EXPECT_EQ(sees(0.0), "");
    EXPECT_EQ(shown().bad, 1u);
}

TEST_F(Watch, OneWithoutAListIsAnEventAlone)
{
    monitor(0) = limits(0.0, 1.0, 0);
    EXPECT_EQ(sees(5.0), "");
    EXPECT_EQ(event().id, MONITORS_FIRED);
    EXPECT_EQ(shown().fired, 1u);
    EXPECT_TRUE(reports_.empty());
}

TEST_F(Watch, MoreThanAnInstantStartsFollowAtTheNextAndARefusalIsReported)
{
    for (int i = 0; i < 6; i++) {
        monitor(i) = limits(0.0, 1.0, static_cast<uint32_t>(i) + 1);
    }
    monitor(15) = limits(0.0, 1.0, 9);
    EXPECT_EQ(sees(5.0), "1234");
    EXPECT_EQ(at(), "56");
    EXPECT_EQ(reports_.back().reason, COMMAND_PLACE);
    EXPECT_EQ(reports_.back().origin, COMMAND_OF_MONITOR + 15);
    monitors_reset(&mission_.monitors);
    EXPECT_EQ(at(), "1234"); // a reset forgets what has fired
}

TEST_F(Watch, ItIsDueAtEachInstantWhileOneIsOn)
{
    EXPECT_EQ(monitors_service.next(&mission_.monitors), INT64_MAX);
    monitor(9).on = 1;
    EXPECT_EQ(monitors_service.next(&mission_.monitors), 0);
}

} // namespace monitors_test
