// SPDX-License-Identifier: Apache-2.0
// Stored commands through the code that executes all commands: packets that are put together here, and what they do.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/services/stored_commands.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace stored_commands_test {

using namespace service_testing;

struct Mission {
    StoredCommands stored;
    std::string log; ///< the modes that were entered, as letters
};

const CommandService *const kinds[] = {&stored_commands_service};
const CommandServices services =
    command_services(kinds, 1, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->stored; });
uint8_t queue[4 * COMMAND_MAX];
const CommandTable table = [] {
    CommandTable made = command_table(&services, queue, sizeof queue);
    made.n_modes = 26;
    made.enter = [](void *m, uint16_t mode) { static_cast<Mission *>(m)->log += static_cast<char>('a' + mode); };
    made.reset = [](void *m, int64_t) { stored_commands_reset(&static_cast<Mission *>(m)->stored); };
    return made;
}();

Bytes command(int code, const Bytes &arguments, uint16_t version = 0x1234)
{
    return packet(code, big(version, 2) + arguments);
}

Bytes mode(char name)
{
    return command(COMMAND_MODE, big(static_cast<uint64_t>(name - 'a'), 2));
}

Bytes store(uint16_t list, uint16_t step, int64_t time, const Bytes &stored)
{
    const Bytes body = big(list, 2) + big(step, 2) + big(static_cast<uint64_t>(time), 8) + stored;
    return command(COMMAND_STORE, big(command_crc(body.data(), static_cast<uint32_t>(body.size())), 2) + body);
}

Bytes control(ListAction action, uint16_t list, uint16_t crc = 0)
{
    return command(COMMAND_CONTROL, big(list, 2) + big(action, 2) + big(crc, 2));
}

class Stored : public testing::Test {
protected:
    Stored() { command_begin(&state_); }

    static void note(void *self, const CommandReport *report, const uint8_t *data)
    {
        auto &me = *static_cast<Stored *>(self);
        me.reports_.push_back(*report);
        me.data_.assign(data, data + report->n);
    }

    CommandReason accept(const Bytes &p)
    {
        return command_accept(&state_, &table, nullptr, p.data(), static_cast<uint32_t>(p.size()), note, this);
    }

    /// The instant t: the commands that came, those that are stored, the module's update. Returns what they did.
    std::string at(int64_t t)
    {
        mission_.log.clear();
        command_execute(&state_, &table, &mission_, t, note, this);
        stored_commands_update(&mission_.stored, {t, 0});
        return mission_.log;
    }

    /// Send a command, and return what became of it at the instant t.
    CommandReason send(const Bytes &p, int64_t t = 0)
    {
        const CommandReason reason = accept(p);
        if (reason == COMMAND_OK) {
            at(t);
            return static_cast<CommandReason>(own().back().reason);
        }
        return reason;
    }

    /// The reports of what is not of a list.
    std::vector<CommandReport> own() const
    {
        std::vector<CommandReport> found;
        std::copy_if(reports_.begin(), reports_.end(), std::back_inserter(found),
                     [](const CommandReport &r) { return r.origin == 0; });
        return found;
    }

    /// The last event as text: which, and its list and step.
    std::string last_event() const
    {
        const FlightEvent &e = mission_.stored.out.event;
        return std::to_string(e.id) + ":" + std::to_string(static_cast<int>(e.arguments[0])) + "," +
               std::to_string(static_cast<int>(e.arguments[1]));
    }

    const StoredState &shown() const { return mission_.stored.out.state; }

    void set_clock(int64_t t, int64_t time)
    {
        mission_.stored.in.clock.head = {t, QUALITY_GOOD, 1};
        mission_.stored.in.clock.time = time;
    }

    Mission mission_{};
    CommandState state_{};
    std::vector<CommandReport> reports_;
    Bytes data_;
};

TEST_F(Stored, AnAbsoluteCommandIsExecutedOnceAtTheFirstInstantFromItsTimeOn)
{
    EXPECT_EQ(send(store(0, 1, 100, mode('x'))), COMMAND_OK);
    EXPECT_EQ(shown().stored, 1u);
    EXPECT_EQ(shown().next, 100);
    EXPECT_EQ(at(99), "");
    EXPECT_EQ(at(103), "x");
    EXPECT_EQ(at(200), "");
    EXPECT_EQ(shown().stored, 0u);
    EXPECT_EQ(shown().released, 1u);
    EXPECT_EQ(shown().next, -1);
    const CommandReport &accepted = reports_[2], &executed = reports_[3];
    EXPECT_EQ(accepted.executed, 0);
    EXPECT_EQ(executed.executed, 1);
    EXPECT_EQ(executed.t, 103);
    for (const CommandReport &report : {accepted, executed}) {
        EXPECT_EQ(report.code, COMMAND_MODE);
        EXPECT_EQ(report.origin, 1); // list 0
        EXPECT_EQ(report.sequence, 9);
    }
}

TEST_F(Stored, TheOrderOfWhatIsDueAtOnceIsTimeThenListThenStep)
{
    for (const auto &[list, step, time, name] : {std::tuple{0, 3, 50, 'f'}, {0, 1, 50, 'e'}, {0, 9, 40, 'a'}}) {
        send(store(static_cast<uint16_t>(list), static_cast<uint16_t>(step), time, mode(name)));
    }
    send(store(2, 0, 50, mode('c')));
    send(store(3, 0, 51, mode('b')));
    send(store(4, 0, 49, mode('f')));
    EXPECT_EQ(send(control(LIST_START, 2), 0), COMMAND_CONFLICT);
    EXPECT_EQ(send(control(LIST_START, 4), 1), COMMAND_CONFLICT) << "one of two at that time has another mode";
    EXPECT_EQ(send(control(LIST_START, 2), 1), COMMAND_OK);
    EXPECT_EQ(send(control(LIST_START, 3), 0), COMMAND_CONFLICT);
    EXPECT_EQ(send(store(0, 7, 51, mode('d')), 1), COMMAND_CONFLICT);
    EXPECT_EQ(send(store(0, 7, 51, mode('c')), 1), COMMAND_OK) << "the same mode";
    accept(mode('z')); // of the ground, which goes first
    EXPECT_EQ(at(60), "zaefc");
    EXPECT_EQ(at(61), "c");
    for (int i = 0; i < 6; i++) {
        send(store(0, static_cast<uint16_t>(i), 100, mode(static_cast<char>('a' + i))), 61);
    }
    EXPECT_EQ(at(100), "abcd"); // no more at once
    EXPECT_EQ(at(101), "ef");
}

TEST_F(Stored, ASequenceRunsFromItsStartAsOftenAsItIsStarted)
{
    send(store(5, 0, 0, mode('a')));
    send(store(5, 2, 20, mode('c')));
    send(store(5, 1, 20, mode('b')));
    EXPECT_EQ(at(1000), "");
    for (const int64_t t : {1000, 3000}) {
        accept(control(LIST_START, 5));
        EXPECT_EQ(at(t), "a"); // in the instant of its start
        EXPECT_EQ(shown().running, 1u << 5);
        EXPECT_EQ(last_event(), "1:5,0");
        EXPECT_EQ(send(control(LIST_START, 5), t + 1), COMMAND_RUNNING);
        EXPECT_EQ(at(t + 19), "");
        EXPECT_EQ(at(t + 20), "bc");
        EXPECT_EQ(last_event(), "2:5,0");
        EXPECT_EQ(mission_.stored.out.event.head.t, t + 20);
        EXPECT_EQ(shown().running, 0u);
    }
    EXPECT_EQ(shown().stored, 3u);
}

TEST_F(Stored, StopHoldAndRelease)
{
    send(store(1, 0, 10, mode('a')));
    send(store(1, 1, 20, mode('b')));
    EXPECT_EQ(send(control(LIST_HOLD, 1)), COMMAND_RUNNING); // it does not run
    send(control(LIST_START, 1), 100);
    EXPECT_EQ(send(control(LIST_RELEASE, 1), 101), COMMAND_RUNNING); // it is not held
    EXPECT_EQ(send(control(LIST_HOLD, 1), 105), COMMAND_OK);
    EXPECT_EQ(send(control(LIST_HOLD, 1), 106), COMMAND_RUNNING); // it is held
    EXPECT_EQ(shown().held, 2u);
    EXPECT_EQ(at(500), "");
    EXPECT_EQ(send(control(LIST_RELEASE, 1), 505), COMMAND_OK); // 400 later
    EXPECT_EQ(at(509), "");
    EXPECT_EQ(at(510), "a");
    EXPECT_EQ(send(control(LIST_STOP, 1), 511), COMMAND_OK);
    EXPECT_EQ(last_event(), "2:1,0");
    EXPECT_EQ(send(control(LIST_STOP, 1), 512), COMMAND_RUNNING);
    EXPECT_EQ(at(900), "");
    // List 0 can be held, too, and all lists at once.
    send(store(0, 0, 950, mode('d')), 900);
    EXPECT_EQ(send(control(LIST_HOLD, COMMAND_ALL), 901), COMMAND_OK);
    EXPECT_EQ(at(960), "");
    accept(control(LIST_RELEASE, COMMAND_ALL));
    EXPECT_EQ(at(970), "d");
}

TEST_F(Stored, WhatComesDueOnAnInhibitedListIsReportedAndNotExecuted)
{
    send(store(1, 0, 10, mode('a')));
    send(store(1, 1, 20, mode('b')));
    send(control(LIST_START, 1), 100);
    send(control(LIST_INHIBIT, 1), 101);
    EXPECT_EQ(shown().inhibited, 2u);
    EXPECT_EQ(at(115), "");
    EXPECT_EQ(reports_.back().reason, COMMAND_INHIBITED);
    EXPECT_EQ(reports_.back().origin, 2);
    EXPECT_EQ(reports_.back().code, COMMAND_MODE);
    EXPECT_EQ(shown().skipped, 1u);
    EXPECT_EQ(last_event(), "4:1,0");
    EXPECT_EQ(mission_.stored.out.event.severity, EVENT_LOW);
    send(control(LIST_ALLOW, COMMAND_ALL), 116);
    EXPECT_EQ(at(120), "b");
    send(control(LIST_INHIBIT, 1), 130);
    EXPECT_EQ(send(control(LIST_START, 1), 131), COMMAND_INHIBITED);
}

TEST_F(Stored, InsertReplaceDeleteAndReport)
{
    send(store(3, 7, 20, mode('b')));
    send(store(3, 8, 10, mode('a')));
    send(store(3, 7, 30, mode('c'))); // in place of the first
    EXPECT_EQ(shown().stored, 2u);
    EXPECT_EQ(send(command(COMMAND_LIST, big(3, 2))), COMMAND_OK);
    const Bytes first = store(3, 8, 10, mode('a')), second = store(3, 7, 30, mode('c'));
    const Bytes expected = big(10, 8) + big(8, 2) + big(12, 2) + Bytes{first[10], first[11]} + big(COMMAND_MODE, 2) +
                           big(30, 8) + big(7, 2) + big(12, 2) + Bytes{second[10], second[11]} + big(COMMAND_MODE, 2);
    EXPECT_EQ(data_, expected);
    const uint16_t crc = command_crc(expected.data(), static_cast<uint32_t>(expected.size()));
    EXPECT_EQ(send(control(LIST_START, 3, static_cast<uint16_t>(crc ^ 1u))), COMMAND_CRC);
    EXPECT_EQ(send(control(LIST_START, 3, crc)), COMMAND_OK);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(3, 2) + big(8, 2)), 1), COMMAND_OK);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(3, 2) + big(8, 2)), 1), COMMAND_PLACE);
    EXPECT_EQ(at(20), "");
    send(store(3, 9, 25, mode('d')), 21); // into a sequence that runs
    EXPECT_EQ(at(30), "dc");
    EXPECT_EQ(send(command(COMMAND_DELETE, big(COMMAND_ALL, 2) + big(COMMAND_ALL, 2)), 31), COMMAND_OK);
    EXPECT_EQ(shown().stored, 0u);
    EXPECT_EQ(send(control(LIST_START, 3), 32), COMMAND_PLACE); // nothing is there
    for (const uint16_t step : {0, 1}) {
        send(store(3, step, 20, mode('b')), 33);
        send(store(2, step, 20, mode('b')), 33);
    }
    EXPECT_EQ(send(command(COMMAND_DELETE, big(3, 2) + big(COMMAND_ALL, 2)), 33), COMMAND_OK); // of one list
    EXPECT_EQ(shown().stored, 2u);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(3, 2) + big(COMMAND_ALL, 2)), 33), COMMAND_OK); // there are none left
    EXPECT_EQ(send(command(COMMAND_DELETE, big(COMMAND_ALL, 2) + big(1, 2)), 33), COMMAND_OK); // of one step
    EXPECT_EQ(send(command(COMMAND_DELETE, big(COMMAND_ALL, 2) + big(1, 2)), 33), COMMAND_OK);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(2, 2) + big(1, 2)), 33), COMMAND_PLACE);
    EXPECT_EQ(shown().stored, 1u);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(2, 2) + big(0, 2)), 33), COMMAND_OK);
    for (uint16_t i = 0; i < STORED_COMMANDS; i++) {
        EXPECT_EQ(send(store(4, i, i, mode('a')), 33), COMMAND_OK);
    }
    EXPECT_EQ(send(store(4, 99, 1, mode('a')), 33), COMMAND_BUSY);
    EXPECT_EQ(send(store(4, 5, 1, mode('b')), 33), COMMAND_OK); // its place is there
    EXPECT_EQ(send(command(COMMAND_LIST, big(4, 2)), 33), COMMAND_OK);
    EXPECT_EQ(data_.size(), 16u * STORED_COMMANDS);
}

TEST_F(Stored, ACommandThatGroundCouldNotSendIsNotStored)
{
    Bytes damaged = mode('a');
    damaged.back() ^= 1;
    EXPECT_EQ(send(store(1, 0, 0, damaged)), COMMAND_CHECKSUM);
    EXPECT_EQ(send(store(1, 0, 0, command(COMMAND_MODE, big(26, 2)))), COMMAND_PLACE);
    EXPECT_EQ(send(store(1, 0, 0, command(COMMAND_MODE, big(0, 2), 0x4321))), COMMAND_VERSION);
    EXPECT_EQ(send(store(1, 0, 0, command(99, {}))), COMMAND_UNKNOWN);
    Bytes other = mode('a');
    other[1] ^= 1; // the stream of another process
    other[7] ^= 1;
    EXPECT_EQ(send(store(1, 0, 0, other)), COMMAND_STREAM);
    EXPECT_EQ(send(store(1, 0, 0, Bytes(7))), COMMAND_LENGTH);
    EXPECT_EQ(send(store(1, 0, 0, Bytes(COMMAND_STORED_MAX + 1))), COMMAND_LENGTH);
    EXPECT_EQ(send(store(STORED_LISTS, 0, 0, mode('a'))), COMMAND_PLACE);
    EXPECT_EQ(send(store(1, 0, -1, mode('a'))), COMMAND_VALUE);
    EXPECT_EQ(send(store(1, COMMAND_ALL, 0, mode('a'))), COMMAND_VALUE);
    Bytes wrong = store(1, 0, 5, mode('a'));
    wrong[23]++; // another time, with a checksum that is right
    wrong[7] ^= static_cast<uint8_t>(5 ^ 6);
    EXPECT_EQ(send(wrong), COMMAND_CRC);
    EXPECT_EQ(send(control(LIST_START, STORED_LISTS)), COMMAND_PLACE);
    EXPECT_EQ(send(control(LIST_START, COMMAND_ALL)), COMMAND_VALUE);
    EXPECT_EQ(send(control(LIST_START, 0)), COMMAND_VALUE);
    EXPECT_EQ(send(control(LIST_STOP, 0)), COMMAND_VALUE);
    EXPECT_EQ(send(control(LIST_INHIBIT, 0)), COMMAND_OK);
    EXPECT_EQ(send(control(static_cast<ListAction>(LIST_ALLOW + 1), 1)), COMMAND_VALUE);
    EXPECT_EQ(send(command(COMMAND_LIST, big(COMMAND_ALL, 2))), COMMAND_PLACE);
    EXPECT_EQ(send(command(COMMAND_DELETE, big(STORED_LISTS, 2) + big(0, 2))), COMMAND_PLACE);
    EXPECT_EQ(shown().stored, 0u);
}

TEST_F(Stored, AStoredCommandPassesTheChecksOfItsInstantAndIsRefusedAsOthersAre)
{
    send(store(1, 0, 0, control(LIST_START, 2))); // the list 2 has nothing
    send(store(1, 1, 0, mode('a')));
    accept(control(LIST_START, 1));
    EXPECT_EQ(at(10), "a"); // it goes on
    const CommandReport &refused = reports_[reports_.size() - 3];
    EXPECT_EQ(refused.reason, COMMAND_PLACE);
    EXPECT_EQ(refused.origin, 2);
    EXPECT_EQ(refused.executed, 1);
    EXPECT_EQ(state_.counters.reasons[COMMAND_PLACE], 1u);
}

TEST_F(Stored, WhatWasDamagedInMemoryIsNotExecuted)
{
    send(store(1, 0, 5, mode('a')));
    send(store(1, 1, 6, mode('b')));
    send(control(LIST_START, 1), 10);
    mission_.stored.par.commands[0].time++;
    EXPECT_EQ(at(20), "b");
    EXPECT_EQ(shown().skipped, 1u);
    EXPECT_EQ(last_event(), "5:1,0"); // not that the list has ended at the same instant, which is less grave
    EXPECT_EQ(mission_.stored.out.event.count, 3u);
    mission_.stored.par.commands[1].size = 0xFFFF;
    send(control(LIST_START, 1), 30);
    EXPECT_EQ(at(40), "");
    EXPECT_EQ(reports_.back().reason, COMMAND_CRC);
}

TEST_F(Stored, ACommandOfAListThatIsNoneIsNeverDue)
{
    send(store(1, 0, 5, mode('a')));
    send(store(0, 0, 7, mode('b')));
    send(control(LIST_START, 1), 1);
    mission_.stored.par.commands[0].list = STORED_LISTS;
    EXPECT_EQ(at(20), "b");
    EXPECT_EQ(shown().next, -1);
    send(store(2, 0, 50, mode('c')), 21);
    EXPECT_EQ(shown().running, 0u) << "nothing is left of it";
}

TEST_F(Stored, ItIsDueWhenItsFirstCommandIsOrAtEachInstantUntilTheClockIsKnown)
{
    send(store(0, 0, 70, mode('b')));
    EXPECT_EQ(stored_commands_service.next(&mission_.stored), 70);
    mission_.stored.par.clocked = 1;
    EXPECT_EQ(stored_commands_service.next(&mission_.stored), 0);
    set_clock(5, 45);
    at(5);
    EXPECT_EQ(stored_commands_service.next(&mission_.stored), 30);
}

TEST_F(Stored, SequencesStartOneAnotherAndThemselves)
{
    send(store(1, 0, 0, mode('a')));
    send(store(1, 1, 5, control(LIST_START, 2)));
    send(store(2, 0, 0, mode('b')));
    send(store(2, 1, 5, control(LIST_START, 1))); // for ever, every 10
    std::string all;
    send(control(LIST_START, 1), 100);
    for (int64_t t = 101; t < 130; t++) {
        all += at(t);
    }
    EXPECT_EQ(all, "babab");
    // One without delays does not stop flight.
    send(command(COMMAND_DELETE, big(COMMAND_ALL, 2) + big(COMMAND_ALL, 2)), 130);
    send(store(1, 0, 0, mode('a')), 130);
    send(store(1, 1, 0, control(LIST_START, 1)), 130);
    send(control(LIST_START, 1), 131);
    EXPECT_EQ(at(132), "aa");
}

TEST_F(Stored, AResetOfFlightStopsSequencesAndKeepsTheStore)
{
    send(store(1, 0, 10, mode('a')));
    send(store(0, 0, 150, mode('b')));
    send(store(0, 1, 195, mode('c')));
    send(store(0, 2, 300, mode('d')));
    send(control(LIST_START, 1), 100);
    mission_.stored.par.late = 10e-9;
    stored_commands_reset(&mission_.stored); // flight does not run until 200
    command_begin(&state_);
    EXPECT_EQ(at(200), "c"); // 5 ns late; the other one was by 50
    EXPECT_EQ(shown().skipped, 1u);
    EXPECT_EQ(reports_[reports_.size() - 3].reason, COMMAND_LATE);
    EXPECT_EQ(at(300), "d");
    EXPECT_EQ(shown().running, 0u);
    EXPECT_EQ(shown().stored, 1u);
}

TEST_F(Stored, AStoredResetOfFlight)
{
    send(store(0, 0, 50, command(COMMAND_RESET_FLIGHT, {})));
    send(store(0, 1, 50, mode('a')));
    send(store(1, 0, 0, mode('b')));
    send(store(1, 1, 100, mode('c')));
    send(control(LIST_START, 1), 10);
    EXPECT_EQ(at(50), "a"); // once
    EXPECT_EQ(at(200), "");
}

TEST_F(Stored, WhereTheClockJumpsEachCommandIsExecutedAtMostOnce)
{
    mission_.stored.par.clocked = 1;
    for (uint16_t i = 0; i < 4; i++) {
        send(store(0, i, 1100 + 100 * i, mode(static_cast<char>('a' + i))));
    }
    send(store(1, 0, 300, mode('z')));
    send(control(LIST_START, 1), 1);
    EXPECT_EQ(at(5000), "z"); // no clock yet: list 0 waits, sequences do not
    EXPECT_EQ(shown().head.quality, QUALITY_DEGRADED);
    set_clock(5000, 1000);
    EXPECT_EQ(at(5001), ""); // the update sees the clock
    EXPECT_EQ(shown().next, 5100);
    EXPECT_EQ(at(5100), "a");
    set_clock(5100, 800); // back by 300: nothing twice, the rest waits
    EXPECT_EQ(at(5100), "");
    EXPECT_EQ(at(5200), "");
    EXPECT_EQ(at(5500), "b");
    set_clock(5500, 90000); // forward
    mission_.stored.par.late = 1e-3;
    EXPECT_EQ(at(5500), "");
    EXPECT_EQ(at(5501), "cd"); // late by less than a ms
    send(store(0, 0, 91000, mode('e')), 5502);
    set_clock(5502, 5000000);
    EXPECT_EQ(at(5502), "");
    EXPECT_EQ(at(5503), "");
    EXPECT_EQ(reports_.back().reason, COMMAND_LATE);
    EXPECT_EQ(mission_.stored.out.event.id, STORED_COMMANDS_LATE);
    EXPECT_GT(mission_.stored.out.event.arguments[2], mission_.stored.par.late);
    EXPECT_EQ(shown().stored, 1u);
}

/// Stored commands with a non-volatile memory, and a table that brings all of them back after a reset of the computer.
class Kept : public Stored {
protected:
    Kept() { mission_.stored.par.slot = 1; }

    /// Instants up to t, each with an answer of the memory to the request of `delay_` instants before.
    std::string until(int64_t t)
    {
        std::string done;
        for (; now_ < t; now_++) {
            const NvmPacket &request = mission_.stored.out.request;
            if (request.code != NVM_NOTHING && request.number != reply_.number && late_++ >= delay_) {
                late_ = 0;
                reply_.number = request.number;
                if (request.code == NVM_STORE) {
                    std::copy_n(request.data, NVM_WORDS, slot_);
                }
                std::copy_n(slot_, NVM_WORDS, reply_.data);
            }
            reply_.head.quality = QUALITY_GOOD;
            mission_.stored.in.reply = reply_;
            done += at(now_);
        }
        return done;
    }

    /// The parameters come back some instants after the start.
    void reset_computer(int64_t down, int64_t loads)
    {
        const auto par = mission_.stored.par;
        now_ += down;
        mission_.stored = {};
        mission_.stored.par.slot = 1;
        mission_.log.clear();
        command_begin(&state_);
        EXPECT_EQ(until(now_ + loads), "");
        mission_.stored.par = par;
    }

    NvmPacket reply_{};
    uint32_t slot_[NVM_WORDS] = {};
    int delay_ = 2, late_ = 0;
    int64_t now_ = 0;
};

TEST_F(Kept, WhatATableBringsBackIsExecutedOnce)
{
    for (const int64_t loads : {0, 1, 5, 30}) { // sooner and later than the memory answers
        mission_.stored = {};
        mission_.stored.par.slot = 1;
        std::fill(std::begin(slot_), std::end(slot_), 0);
        reply_ = {};
        now_ = 0;
        for (const auto &[time, name] :
             std::vector<std::pair<int64_t, char>>{{100, 'a'}, {100, 'b'}, {150, 'c'}, {190, 'd'}, {300, 'e'}}) {
            EXPECT_EQ(accept(store(0, static_cast<uint16_t>(name - 'a'), time, mode(name))), COMMAND_OK);
        }
        EXPECT_EQ(until(101), "");
        EXPECT_EQ(until(110), "ab") << "once the memory has them";
        EXPECT_EQ(until(160), "c");
        reset_computer(50, loads);
        for (const auto &[time, name] : std::vector<std::pair<int64_t, char>>{{100, 'a'}, {100, 'b'}, {150, 'c'}}) {
            const Bytes again = store(0, static_cast<uint16_t>(name - 'a'), time, mode(name));
            StoredCommand &c = mission_.stored.par.commands[10 + name - 'a'];
            c.time = time;
            c.list = 0;
            c.step = static_cast<uint16_t>(name - 'a');
            c.size = static_cast<uint16_t>(again.size() - COMMAND_STORED);
            c.crc = static_cast<uint16_t>(again[10] << 8 | again[11]);
            std::copy(again.begin() + COMMAND_STORED, again.end(), c.packet);
        }
        EXPECT_EQ(until(290), "d") << "it came due while the computer was down; " << loads;
        EXPECT_EQ(until(400), "e");
        EXPECT_EQ(mission_.stored.out.event.count, 1u) << "OVER";
    }
}

TEST_F(Kept, WhatTheGroundStoresForAnEarlierTimeIsNotOver)
{
    EXPECT_EQ(accept(store(0, 0, 100, mode('a'))), COMMAND_OK);
    EXPECT_EQ(until(120), "a");
    EXPECT_EQ(accept(store(0, 7, 50, mode('b'))), COMMAND_OK);
    EXPECT_EQ(until(130), "b");
}

TEST_F(Kept, OnlyListZeroIsKept)
{
    EXPECT_EQ(accept(store(3, 0, 0, mode('s'))), COMMAND_OK);
    EXPECT_EQ(accept(store(3, 1, 8, mode('t'))), COMMAND_OK);
    EXPECT_EQ(accept(store(0, 0, 5, mode('a'))), COMMAND_OK);
    EXPECT_EQ(until(3), "");
    EXPECT_EQ(accept(control(LIST_START, 3)), COMMAND_OK);
    EXPECT_EQ(until(30), "sat");
    EXPECT_EQ(shown().stored, 2u);
    EXPECT_EQ(accept(store(0, 4, 5, mode('b'))), COMMAND_OK); // a later step of the time that the memory has
    EXPECT_EQ(until(31), "");
    EXPECT_EQ(until(40), "b");
}

TEST_F(Kept, AMemoryThatRefusesIsNotWaitedForEither)
{
    reply_.refused = 1;
    EXPECT_EQ(accept(store(0, 0, 5, mode('a'))), COMMAND_OK);
    EXPECT_EQ(until(8), "");
    EXPECT_EQ(until(12), "a");
}

TEST_F(Kept, AMemoryThatDoesNotAnswerIsNotWaitedFor)
{
    delay_ = 1000;
    EXPECT_EQ(accept(store(0, 0, 5, mode('a'))), COMMAND_OK);
    EXPECT_EQ(accept(store(3, 0, 0, mode('s'))), COMMAND_OK);
    EXPECT_EQ(accept(control(LIST_START, 3)), COMMAND_OK);
    EXPECT_EQ(until(8), "s") << "a sequence has nothing to wait for";
    EXPECT_EQ(until(12), "a");
}

TEST_F(Stored, WithoutTheServiceItsCommandsAreRefused)
{
    CommandTable without = table;
    without.services = nullptr;
    const Bytes p = control(LIST_START, 1);
    EXPECT_EQ(command_accept(&state_, &without, nullptr, p.data(), static_cast<uint32_t>(p.size()), note, this),
              COMMAND_ABSENT);
}

/// A plain reading of the rules, against random stores, starts, holds and deletions.
TEST_F(Stored, RandomListsRunAsTheRulesSay)
{
    struct Entry {
        int list, step;
        int64_t time;
        char name;
    };
    std::mt19937 draw(25);
    const auto below = [&](int n) { return static_cast<int>(draw() % static_cast<unsigned>(n)); };
    std::vector<Entry> entries;
    std::vector<int64_t> begun(4, -1), held(4, -1);
    std::vector<std::pair<int64_t, int>> done(4, {0, 0});
    const auto due = [&](const Entry &e) -> int64_t { // -1: not as things stand
        const auto i = static_cast<size_t>(e.list);
        const bool waits = held[i] >= 0 || (i > 0 && (begun[i] < 0 || std::pair{e.time, e.step} < done[i]));
        return waits ? -1 : i > 0 ? begun[i] + e.time : e.time;
    };
    const auto conflicts = [&](const Entry &e) {
        return due(e) >= 0 && std::any_of(entries.begin(), entries.end(), [&](const Entry &o) {
                   return o.list != e.list && o.name != e.name && due(o) == due(e);
               });
    };
    int executed = 0, refused = 0;
    for (int64_t t = 1; t < 4000; t++) {
        const int list = below(4), step = below(6);
        bool refuse = false;
        if (below(4) == 0) {
            const Entry e{list, step, list == 0 ? t + 1 + below(30) : below(30), static_cast<char>('a' + below(26))};
            const auto same = [&](const Entry &o) { return o.list == e.list && o.step == e.step; };
            refuse = conflicts(e);
            if (!refuse) {
                std::erase_if(entries, same);
                entries.push_back(e);
            }
            accept(store(static_cast<uint16_t>(e.list), static_cast<uint16_t>(e.step), e.time, mode(e.name)));
        } else if (below(3) == 0 && list > 0) {
            accept(control(LIST_START, static_cast<uint16_t>(list)));
            const auto has = [&](const Entry &o) { return o.list == list; };
            const auto before = std::tuple{begun[list], held[list], done[list]};
            if (begun[list] < 0 && std::any_of(entries.begin(), entries.end(), has)) {
                begun[list] = t;
                held[list] = -1;
                done[list] = {0, 0};
                refuse =
                    std::any_of(entries.begin(), entries.end(), [&](const Entry &e) { return has(e) && conflicts(e); });
                if (refuse) {
                    std::tie(begun[list], held[list], done[list]) = before;
                }
            }
        } else if (below(4) == 0) {
            const bool hold = held[list] < 0;
            accept(control(hold ? LIST_HOLD : LIST_RELEASE, static_cast<uint16_t>(list)));
            if (list == 0 || begun[list] >= 0) {
                begun[list] += hold ? 0 : list > 0 ? t - held[list] : 0;
                held[list] = hold ? t : -1;
            }
        } else if (below(6) == 0) {
            accept(command(COMMAND_DELETE, big(static_cast<uint64_t>(list), 2) + big(static_cast<uint64_t>(step), 2)));
            std::erase_if(entries, [&](const Entry &o) { return o.list == list && o.step == step; });
        }
        const auto end_lists = [&] {
            for (int i = 1; i < 4; i++) {
                const auto left = [&](const Entry &o) {
                    return o.list == i && std::pair{o.time, o.step} >= done[static_cast<size_t>(i)];
                };
                if (std::none_of(entries.begin(), entries.end(), left)) {
                    begun[static_cast<size_t>(i)] = held[static_cast<size_t>(i)] = -1;
                }
            }
        };
        end_lists();
        std::string expected;
        for (int n = 0; n < COMMAND_AT_ONCE; n++) {
            const Entry *best = nullptr;
            std::tuple<int64_t, int, int64_t, int> order;
            for (const Entry &e : entries) {
                const std::tuple place{due(e), e.list, e.time, e.step};
                if (due(e) >= 0 && due(e) <= t && (!best || place < order)) {
                    best = &e;
                    order = place;
                }
            }
            if (!best) {
                break;
            }
            expected += best->name;
            const Entry taken = *best;
            if (taken.list > 0) {
                done[static_cast<size_t>(taken.list)] = {taken.time, taken.step + 1};
            } else {
                std::erase_if(entries, [&](const Entry &o) { return o.list == 0 && o.step == taken.step; });
            }
            end_lists();
        }
        reports_.clear();
        ASSERT_EQ(at(t), expected) << t;
        ASSERT_EQ(!own().empty() && own().back().reason == COMMAND_CONFLICT, refuse) << t;
        refused += refuse;
        executed += static_cast<int>(expected.size());
    }
    EXPECT_GT(executed, 500);
    EXPECT_GT(refused, 20);
}

} // namespace stored_commands_test
