// SPDX-License-Identifier: Apache-2.0
// The fault protection through the code that executes all commands: against a second one of a few lines, on random
// units, rules and numbers, and one by one.
#include "flight/services/testing/flight_software.h"

extern "C" {
#include "flight/services/fault_protection.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace fault_protection_test {

using namespace service_testing;

constexpr int numbers = 6;

struct Output {
    Head head;
    double x[numbers];
};

struct Mission {
    FaultProtection protection;
    Output output;
    std::string log; ///< the modes that were requested, and the lists that were started
    int closed = -1; ///< the mode whose condition does not hold
};

const CommandService lists = command_service(
    COMMAND_STORE, 4, [](const uint8_t *, uint32_t) { return COMMAND_OK; },
    [](const CommandContext *context, void *, const uint8_t *packet, CommandReport *, uint8_t *) {
        static_cast<Mission *>(context->mission)->log += "l" + std::to_string(packet[11]) + " ";
        return COMMAND_OK;
    });
const CommandService *const kinds[] = {&fault_protection_service, &lists};
const CommandServices services = command_services(
    kinds, 2, [](void *m, uint32_t) -> void * { return &static_cast<Mission *>(m)->protection; },
    [](const void *m, uint16_t place, uint32_t *size) -> const void * {
        const auto *mission = static_cast<const Mission *>(m);
        *size = place == 0 ? sizeof(Output) : sizeof(UnitTable);
        return place == 0 ? static_cast<const void *>(&mission->output) : &mission->protection.out.table;
    });

/// Flight software with nothing else in it.
struct Craft {
    std::vector<uint8_t> queue = std::vector<uint8_t>(4 * COMMAND_MAX);
    CommandTable table = command_table(&services, queue.data(), queue.size());
    CommandState state{};
    Mission mission{};
    std::vector<CommandReport> reports;
    uint16_t sequence = 0;
    int64_t t = 0;

    Craft()
    {
        table.n_outputs = 2;
        table.n_modes = 9;
        table.enter = [](void *m, uint16_t mode) {
            static_cast<Mission *>(m)->log += "m" + std::to_string(mode) + " ";
        };
        command_begin(&state);
        fault_protection_reset(&mission.protection);
    }

    FaultProtection &protection() { return mission.protection; }
    const UnitTable &shown() { return protection().out.table; }
    const FlightEvent &event() { return protection().out.event; }

    void unit(int place, UnitState start, uint32_t kind, uint32_t loads = 0, bool warm = false)
    {
        protection().par.units[place] = {"", start, kind, loads, warm};
    }

    /// x[number] in [low, high], else the unit (-1: none) becomes something.
    FaultRule &rule(int place, int number, double low, double high, int unit = -1, UnitState becomes = UNIT_FAULTED)
    {
        FaultRule &added = protection().par.rules[place];
        added = {};
        added.check.low = low;
        added.check.high = high;
        added.check.kind = MONITOR_LIMITS;
        added.check.on = 1;
        added.check.offset = static_cast<uint32_t>(offsetof(Output, x) + sizeof(double) * static_cast<size_t>(number));
        added.check.type = FLEDGE_F64;
        added.check.n = 1;
        added.unit = static_cast<uint32_t>(unit + 1);
        added.becomes = unit < 0 ? UNIT_ABSENT : becomes;
        return added;
    }

    /// Send command 27; it is executed at the next instant. Returns whether it is accepted.
    CommandReason send(uint16_t unit, uint16_t to, uint16_t even = 0)
    {
        uint8_t packet[COMMAND_MAX];
        const uint16_t arguments[] = {unit, to, even};
        const uint32_t n = monitor_command(&table, COMMAND_UNIT, arguments, 3, ++sequence, packet);
        return command_accept(&state, &table, nullptr, packet, n, &Craft::keep, this);
    }

    void sees(int number, double x)
    {
        mission.output.x[number] = x;
        mission.output.head = {t, QUALITY_GOOD, mission.output.head.sequence + 1};
    }

    /// The next instant; returns what it did.
    std::string at()
    {
        mission.log.clear();
        t += 10;
        command_execute(&state, &table, &mission, t, &Craft::keep, this);
        fault_protection_update(&protection(), {t, 10});
        return mission.log;
    }
    std::string at(double x, int number = 0)
    {
        sees(number, x);
        return at();
    }

    std::string states(int n)
    {
        std::string all;
        for (int i = 0; i < n; i++) {
            all += "-OPRF"[shown().state[i]];
        }
        return all;
    }

    static void keep(void *self, const CommandReport *report, const uint8_t *)
    {
        static_cast<Craft *>(self)->reports.push_back(*report);
    }
};

// ---- against a second one

/// The same by its description, with no more than one does on paper.
struct Paper {
    struct Unit {
        char start, now;
        int kind;
        bool warm;
    };
    struct Rule {
        int number;
        char kind; ///< limits, delta, expected
        double low, high;
        int64_t hold;
        int count, unit;
        char becomes;
        int mode, list, limit;
    };
    struct Watch {
        bool any = false, wrong = false, fired = false;
        double last = 0.0;
        int64_t since = -1;
        int times = 0;
    };
    std::vector<Unit> units;
    std::vector<Rule> rules;
    std::map<int, Watch> watches;
    std::map<int, int> responded;
    std::set<std::pair<int, char>> waiting;
    std::vector<double> x;
    bool written = false;

    int in_use(int kind, bool at_start) const
    {
        return static_cast<int>(std::count_if(units.begin(), units.end(), [&](const Unit &u) {
            return u.kind == kind && (at_start ? u.start : u.now) == 'P';
        }));
    }
    bool lost(int kind) const { return in_use(kind, true) > 0 && in_use(kind, false) == 0; }
    void change(int unit, char to)
    {
        Unit &changed = units[static_cast<size_t>(unit)];
        const bool leaves = changed.now == 'P' && to != 'P';
        changed.now = to;
        if (leaves && in_use(changed.kind, false) < in_use(changed.kind, true)) {
            const auto heir = std::find_if(units.begin(), units.end(), [&](const Unit &u) {
                return &u != &changed && u.kind == changed.kind && u.now == 'R';
            });
            if (heir != units.end()) {
                heir->now = 'P';
            }
        }
    }
    void clear(int unit)
    {
        Unit &changed = units[static_cast<size_t>(unit)];
        if (changed.now == 'F') {
            changed.now = in_use(changed.kind, false) < in_use(changed.kind, true) ? 'P' : 'R';
        }
        for (size_t i = 0; i < rules.size(); i++) {
            if (rules[i].unit == unit) {
                responded[static_cast<int>(i)] = 0;
            }
        }
    }
    bool command(int unit, char to, bool even)
    {
        const Unit &changed = units[static_cast<size_t>(unit)];
        if (to == '-') {
            clear(unit);
            return true;
        }
        const bool spare = std::any_of(units.begin(), units.end(), [&](const Unit &u) {
            return &u != &changed && u.kind == changed.kind && (u.now == 'P' || u.now == 'R');
        });
        if (changed.now == 'P' && to != 'P' && !spare && !even) {
            return false;
        }
        change(unit, to);
        return true;
    }
    void evaluate(int place, int64_t t, bool fresh)
    {
        const Rule &rule = rules[static_cast<size_t>(place)];
        Watch &watch = watches[place];
        if (rule.unit >= 0) {
            const Unit &unit = units[static_cast<size_t>(rule.unit)];
            const bool power = unit.now == 'P' || (unit.now == 'R' && unit.warm);
            if (unit.now == '-' || unit.now == 'F' || unit.now == rule.becomes || (rule.becomes == 'F' && !power)) {
                watch = {};
                return;
            }
        }
        if (!written) {
            return;
        }
        const double value = x[static_cast<size_t>(rule.number)];
        if (fresh || !watch.any) {
            const double now = rule.kind == 'd' ? value - watch.last : value;
            const double high = rule.kind == 'e' ? rule.low : rule.high;
            watch.wrong = !(now >= rule.low && now <= high) && (rule.kind != 'd' || watch.any);
            watch.last = value;
            watch.any = true;
        }
        if (!watch.wrong) {
            watch.fired = false;
            watch.since = -1;
            watch.times = 0;
            return;
        }
        watch.since = watch.since < 0 ? t : watch.since;
        watch.times++;
        if (watch.fired || t - watch.since < rule.hold || watch.times < rule.count) {
            return;
        }
        watch.fired = true;
        if (rule.limit > 0 && responded[place] >= rule.limit) {
            return;
        }
        responded[place] = std::min(15, responded[place] + 1);
        if (rule.mode >= 0) {
            waiting.insert({place, 'a'});
        }
        if (rule.list > 0) {
            waiting.insert({place, 'b'});
        }
        if (rule.unit >= 0 && rule.becomes != '-') {
            change(rule.unit, rule.becomes);
        }
    }
    std::string at(int64_t t, bool fresh)
    {
        written = written || fresh;
        for (size_t i = 0; i < rules.size(); i++) {
            evaluate(static_cast<int>(i), t, fresh);
        }
        std::string log;
        for (int i = 0; i < COMMAND_AT_ONCE && !waiting.empty(); i++) {
            const auto [place, what] = *waiting.begin();
            waiting.erase(waiting.begin());
            const Rule &rule = rules[static_cast<size_t>(place)];
            log += what == 'a' ? "m" + std::to_string(rule.mode) + " " : "l" + std::to_string(rule.list) + " ";
        }
        return log;
    }
};

/// What one flight has had.
struct Count {
    int responses = 0, refused = 0, lost = 0, stopped = 0;
};

void fly_random(unsigned seed, Count &count)
{
    std::mt19937 chance(seed);
    const auto pick = [&](int n) { return static_cast<int>(chance() % static_cast<unsigned>(n)); };
    Craft craft;
    Paper paper;
    paper.x.resize(numbers);
    const std::string letters = "-OPRF";
    const int n_units = 1 + pick(12), n_kinds = 1 + pick(4), n_rules = 1 + pick(20);
    for (int i = 0; i < n_units; i++) {
        const int start = pick(8) < 4 ? 2 : pick(5), kind = pick(n_kinds), warm = pick(2);
        craft.unit(i, static_cast<UnitState>(start), static_cast<uint32_t>(kind), 1u << i, warm != 0);
        paper.units.push_back(
            {letters[static_cast<size_t>(start)], letters[static_cast<size_t>(start)], kind, warm != 0});
    }
    for (int i = 0; i < n_rules; i++) {
        const int number = pick(numbers), kind = 1 + pick(3), unit = pick(n_units + 2) - 2;
        const int becomes = unit < 0 ? 0 : pick(3) > 0 ? 4 : pick(5);
        const double low = pick(4) - 2, high = low + pick(3);
        FaultRule &rule = craft.rule(i, number, low, high, unit < 0 ? -1 : unit);
        rule.becomes = static_cast<UnitState>(becomes);
        rule.check.kind = static_cast<MonitorKind>(kind);
        rule.check.hold = 10 * pick(4);
        rule.check.count = static_cast<uint32_t>(pick(4));
        rule.check.list = static_cast<uint32_t>(pick(2) * pick(9));
        rule.mode = static_cast<uint32_t>(pick(2) * pick(9));
        rule.limit = static_cast<uint32_t>(pick(4));
        paper.rules.push_back({number, "-lde"[kind], low, high, rule.check.hold, static_cast<int>(rule.check.count),
                               std::max(unit, -1), letters[static_cast<size_t>(becomes)],
                               static_cast<int>(rule.mode) - 1, static_cast<int>(rule.check.list),
                               static_cast<int>(rule.limit)});
    }
    for (int step = 0; step < 400; step++) {
        const bool fresh = pick(4) > 0;
        if (fresh) {
            const int number = pick(numbers);
            const double x = pick(20) == 0 ? std::numeric_limits<double>::quiet_NaN() : pick(7) - 3;
            craft.sees(number, x);
            paper.x[static_cast<size_t>(number)] = x;
        }
        if (pick(15) == 0) {
            const int unit = pick(n_units), to = pick(5), even = pick(2);
            const bool there = paper.units[static_cast<size_t>(unit)].now != '-';
            ASSERT_EQ(craft.send(static_cast<uint16_t>(unit), static_cast<uint16_t>(to), static_cast<uint16_t>(even)),
                      COMMAND_OK);
            const bool good = there && paper.command(unit, letters[static_cast<size_t>(to)], even != 0);
            count.refused += there && !good;
            craft.reports.clear();
            const std::string log = paper.at(craft.t + 10, fresh);
            ASSERT_EQ(craft.at(), log) << "step " << step;
            ASSERT_EQ(craft.reports.front().reason, !there ? COMMAND_PLACE : good ? COMMAND_OK : COMMAND_LAST);
        } else if (pick(60) == 0) {
            ASSERT_EQ(craft.send(COMMAND_ALL, 0), COMMAND_OK);
            for (int i = 0; i < n_units; i++) {
                paper.clear(i);
            }
            paper.responded.clear();
            const std::string log = paper.at(craft.t + 10, fresh);
            ASSERT_EQ(craft.at(), log) << "step " << step;
        } else {
            const std::string log = paper.at(craft.t + 10, fresh);
            ASSERT_EQ(craft.at(), log) << "step " << step;
        }
        std::string states;
        uint32_t used = 0, powered = 0, lost = 0, stopped = 0;
        for (size_t i = 0; i < paper.units.size(); i++) {
            const Paper::Unit &unit = paper.units[i];
            states += unit.now;
            used |= (unit.now == 'P' ? 1u : 0u) << i;
            powered |= (unit.now == 'P' || (unit.now == 'R' && unit.warm) ? 1u : 0u) << i;
            lost |= (paper.lost(unit.kind) ? 1u : 0u) << unit.kind;
        }
        for (size_t i = 0; i < paper.rules.size(); i++) {
            const int had = paper.responded[static_cast<int>(i)], limit = paper.rules[i].limit;
            stopped |= (limit > 0 && had >= limit ? 1u : 0u) << i;
            ASSERT_EQ(craft.protection().mem.responded[i], had) << "step " << step << ", rule " << i;
        }
        ASSERT_EQ(craft.states(n_units), states) << "step " << step;
        ASSERT_EQ(craft.shown().used, used);
        ASSERT_EQ(craft.shown().powered, powered);
        ASSERT_EQ(craft.shown().lost, lost);
        ASSERT_EQ(craft.shown().stopped, stopped);
    }
    count.responses += static_cast<int>(craft.shown().responses);
    count.lost += craft.shown().lost != 0;
    count.stopped += craft.shown().stopped != 0;
}

TEST(FaultProtection, UnitsAndResponsesAreThoseOnPaper)
{
    Count count;
    for (unsigned seed = 0; seed < 300 && !testing::Test::HasFatalFailure(); seed++) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        fly_random(seed, count);
    }
    EXPECT_GT(count.responses, 2000);
    EXPECT_GT(count.refused, 50);
    EXPECT_GT(count.lost, 20);
    EXPECT_GT(count.stopped, 50);
}

// ---- one by one

/// Two star trackers, the second one cold; x[0] and x[1] are their misfits.
struct Pair : testing::Test {
    Craft craft;
    Pair()
    {
        craft.unit(0, UNIT_PRIMARY, 0, 0b01);
        craft.unit(1, UNIT_REDUNDANT, 0, 0b10);
        craft.rule(0, 0, -1.0, 1.0, 0).check.hold = 20;
        craft.rule(1, 1, -1.0, 1.0, 1).check.hold = 20;
        FaultRule &safe = craft.rule(2, 0, 0.0, 0.0);
        safe.check.kind = MONITOR_EXPECTED;
        safe.check.output = 1;
        safe.check.offset = offsetof(UnitTable, lost);
        safe.check.type = FLEDGE_U32;
        safe.mode = 1 + 4;
    }
};

TEST_F(Pair, SaysThatAModeMayNotBeEntered)
{
    craft.table.may_enter = [](void *m, uint16_t mode) -> int { return mode != static_cast<Mission *>(m)->closed; };
    craft.mission.closed = 6;
    craft.rule(3, 1, -1.0, 1.0).mode = 1 + 6;
    craft.rule(4, 1, -1.0, 1.0).mode = 1 + 5;
    craft.sees(1, 5.0);
    EXPECT_EQ(craft.at(0.0), "m5 ");
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_GUARDED);
    EXPECT_EQ(craft.event().severity, EVENT_MEDIUM);
    EXPECT_EQ(craft.event().arguments[0], 3.0);
    EXPECT_EQ(craft.event().arguments[1], 6.0);
    EXPECT_EQ(craft.event().count, 3u) << "two rules have fired";
    EXPECT_EQ(craft.state.counters.reasons[COMMAND_GUARDED], 1u);
    const auto refused = std::find_if(craft.reports.begin(), craft.reports.end(),
                                      [](const CommandReport &r) { return r.reason == COMMAND_GUARDED; });
    ASSERT_NE(refused, craft.reports.end());
    EXPECT_EQ(refused->origin, COMMAND_OF_RULE + 3);
}

TEST_F(Pair, TheOtherOneTakesOverAndSafeModeFollowsTheLastOne)
{
    craft.sees(1, 5.0);
    EXPECT_EQ(craft.at(0.0), "");
    EXPECT_EQ(craft.states(3), "PR-");
    EXPECT_EQ(craft.shown().loads, 3u);
    EXPECT_EQ(craft.shown().powered, 1u);
    EXPECT_EQ(craft.shown().fired_at, -1);
    craft.at(2.0);
    craft.at();
    EXPECT_EQ(craft.states(2), "PR");
    EXPECT_EQ(craft.at(), "");
    EXPECT_EQ(craft.states(2), "FP");
    EXPECT_EQ(craft.shown().powered, 2u);
    EXPECT_EQ(craft.shown().fired, 1u);
    EXPECT_EQ(craft.shown().fired_at, craft.t);
    EXPECT_EQ(craft.shown().left[0], 1);
    EXPECT_EQ(craft.shown().reduced, 0u);
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_FIRED);
    EXPECT_EQ(craft.event().arguments[1], 2.0);
    EXPECT_EQ(craft.event().arguments[3], 1.0);
    craft.at(); // x[1] was wrong all the time: it counts from then on
    EXPECT_EQ(craft.at(), "");
    EXPECT_EQ(craft.states(2), "FF");
    EXPECT_EQ(craft.shown().lost, 1u);
    EXPECT_EQ(craft.shown().powered, 0u);
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_LOST);
    EXPECT_EQ(craft.event().severity, EVENT_HIGH);
    EXPECT_EQ(craft.at(), "m4 ");
    EXPECT_EQ(craft.reports.back().origin, COMMAND_OF_RULE + 2);
    EXPECT_EQ(craft.at(), "");
}

TEST_F(Pair, TheGroundSwapsAndIsRefusedTheLastOneUnlessItSaysSo)
{
    craft.at(0.0);
    craft.send(0, UNIT_REDUNDANT);
    craft.at();
    EXPECT_EQ(craft.states(2), "RP");
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_SET);
    craft.send(0, UNIT_OFF);
    craft.at();
    craft.send(1, UNIT_OFF);
    craft.at();
    EXPECT_EQ(craft.reports.back().reason, COMMAND_LAST);
    EXPECT_EQ(craft.states(2), "OP");
    craft.send(1, UNIT_OFF, 1);
    craft.at();
    EXPECT_EQ(craft.states(2), "OO");
    EXPECT_EQ(craft.send(COMMAND_ALL, UNIT_OFF), COMMAND_VALUE);
    EXPECT_EQ(craft.send(0, 5), COMMAND_VALUE);
    EXPECT_EQ(craft.send(0, 1, 2), COMMAND_VALUE);
    EXPECT_EQ(craft.send(32, 1), COMMAND_PLACE);
    EXPECT_EQ(craft.send(2, 1), COMMAND_OK);
    craft.at();
    EXPECT_EQ(craft.reports.back().reason, COMMAND_PLACE);
}

TEST_F(Pair, AResetOfFlightKeepsWhatIsFaultedAndATimeThatBeginsAnewDoesNot)
{
    for (int i = 0; i < 4; i++) {
        craft.at(2.0);
    }
    fault_protection_reset(&craft.protection());
    craft.at(2.0);
    EXPECT_EQ(craft.states(2), "FP");
    craft.t = 0;
    craft.at(0.0);
    EXPECT_EQ(craft.states(2), "PR");
}

TEST_F(Pair, ALimitEndsResponsesUntilItIsCleared)
{
    craft.rule(0, 0, -1.0, 1.0).limit = 2;
    craft.protection().par.rules[0].check.list = 3;
    craft.at(0.0);
    for (const char *expected : {"l3 ", "l3 ", "", ""}) {
        EXPECT_EQ(craft.at(2.0), expected);
        craft.at(0.0);
    }
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_STOPPED);
    EXPECT_EQ(craft.shown().stopped, 1u);
    craft.send(COMMAND_ALL, 0);
    EXPECT_EQ(craft.at(2.0), "l3 ");
}

TEST_F(Pair, ARuleThatNamesNoNumberIsReportedAsBadAndOneThatIsOffForgets)
{
    craft.protection().par.rules[0].check.output = 2;
    craft.at(2.0);
    EXPECT_EQ(craft.shown().bad, 1u);
    EXPECT_EQ(craft.shown().head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_BAD);
    craft.at(2.0);
    EXPECT_EQ(craft.shown().bad, 1u);
    EXPECT_EQ(craft.event().count, 1u) << "it is reported once";
    craft.protection().par.rules[0].check.on = 0;
    craft.at();
    EXPECT_EQ(craft.shown().bad, 0u);
    EXPECT_EQ(craft.event().count, 1u);
    EXPECT_EQ(fault_protection_service.next(&craft.protection()), 0);
    craft.protection().par.rules[1].check.on = craft.protection().par.rules[2].check.on = 0;
    EXPECT_EQ(fault_protection_service.next(&craft.protection()), INT64_MAX);
}

TEST_F(Pair, ATableThatIsDamagedNamesNothing)
{
    craft.rule(0, 0, -1.0, 1.0, UNITS_MAX);
    const int none = UNIT_FAULTED + 5;
    FaultRule &rule = craft.rule(1, 0, -1.0, 1.0, 0);
    std::memcpy(&rule.becomes, &none, sizeof none);
    std::memcpy(&craft.protection().par.units[2].start, &none, sizeof none);
    EXPECT_EQ(craft.at(5.0), "");
    EXPECT_EQ(craft.shown().responses, 0u);
    EXPECT_EQ(craft.states(3), "PR-");
    EXPECT_EQ(craft.send(2, UNIT_PRIMARY), COMMAND_OK);
    craft.at();
    EXPECT_EQ(craft.reports.back().reason, COMMAND_PLACE);
}

TEST_F(Pair, ResponsesAreCountedUpTo15AndOneThatNamesNoModeIsRefusedAsACommand)
{
    craft.table.may_enter = [](void *, uint16_t) -> int { return 0; };
    craft.rule(0, 0, -1.0, 1.0).mode = 1 + 20;
    for (int i = 0; i < FAULT_LIMIT + 3; i++) {
        EXPECT_EQ(craft.at(2.0), "");
        craft.at(0.0);
    }
    EXPECT_EQ(craft.protection().mem.responded[0], FAULT_LIMIT);
    EXPECT_EQ(craft.shown().responses, FAULT_LIMIT + 3u);
    EXPECT_EQ(craft.event().id, FAULT_PROTECTION_FIRED); // and not that a condition forbids the mode
    EXPECT_EQ(craft.state.counters.reasons[COMMAND_PLACE], FAULT_LIMIT + 3u);
}

// ---- non-volatile memory

/// Slots behind an interconnect that answers at the next update.
struct Memory {
    std::map<uint32_t, std::vector<uint32_t>> slots;
    NvmPacket reply{};
    int stores = 0;

    void answer(const NvmPacket &request)
    {
        reply.head = {0, QUALITY_GOOD, reply.head.sequence + 1};
        if (request.code == NVM_NOTHING || request.number == reply.number) {
            return;
        }
        reply.number = request.number;
        reply.refused = request.slot > 3;
        std::vector<uint32_t> &slot = slots[request.slot];
        slot.resize(NVM_WORDS);
        if (request.code == NVM_STORE && reply.refused == 0) {
            slot.assign(request.data, request.data + NVM_WORDS);
            stores++;
        }
        std::copy(slot.begin(), slot.end(), reply.data);
    }
    /// n instants of a craft with this memory
    void fly(Craft &craft, int n)
    {
        for (int i = 0; i < n; i++) {
            craft.protection().in.reply = reply;
            craft.at();
            answer(craft.protection().out.request);
        }
    }
};

TEST_F(Pair, TheNonVolatileMemoryBringsTheStatesOverAResetOfTheComputer)
{
    Memory memory;
    craft.protection().par.slot = 3;
    const auto built = craft.protection().par;
    memory.fly(craft, 5);
    EXPECT_EQ(craft.shown().kept, 1u);
    EXPECT_EQ(memory.stores, 1);
    craft.sees(0, 2.0);
    while (craft.states(2) == "PR" && craft.t < 1000) {
        memory.fly(craft, 1);
    }
    EXPECT_EQ(craft.shown().kept, 0u);
    memory.fly(craft, 4);
    EXPECT_EQ(craft.states(2), "FP");
    EXPECT_EQ(craft.shown().kept, 1u);
    EXPECT_EQ(memory.stores, 2) << "one for each change";
    const std::vector<uint32_t> before = memory.slots[2];
    Craft more; // one more is ready than are needed
    more.protection().par = built;
    more.unit(2, UNIT_REDUNDANT, 0);
    memory.fly(more, 6);
    EXPECT_EQ(more.states(3), "FPR");
    memory.slots[2] = before;
    Craft anew;
    anew.protection().par = built;
    memory.fly(anew, 1);
    EXPECT_EQ(anew.states(2), "PR") << "the answer is under way";
    EXPECT_EQ(anew.shown().waits, 1u);
    EXPECT_EQ(unit_used(&anew.shown(), 0), 0);
    memory.fly(anew, 4);
    EXPECT_EQ(anew.states(2), "FP");
    EXPECT_EQ(anew.shown().waits, 0u);
    EXPECT_EQ(unit_used(&anew.shown(), 1), 1);
    EXPECT_EQ(anew.protection().mem.responded[0], 1);
    EXPECT_EQ(anew.event().id, FAULT_PROTECTION_RESTORED);
    EXPECT_EQ(anew.shown().kept, 1u);

    Craft both; // the other one fails, too, before the answer has come: then none is left
    both.protection().par = built;
    both.send(1, UNIT_FAULTED);
    memory.fly(both, 6);
    EXPECT_EQ(both.states(2), "FF");
    EXPECT_EQ(both.shown().lost, 1u);

    Craft third; // which has one more, that the memory does not know
    third.protection().par = built;
    third.unit(2, UNIT_REDUNDANT, 0);
    memory.fly(third, 6);
    EXPECT_EQ(third.states(3), "FFP");

    memory.slots[2][0] ^= 1u << 9;
    Craft damaged;
    damaged.protection().par = built;
    memory.fly(damaged, 6);
    EXPECT_EQ(damaged.states(2), "PR");
    EXPECT_EQ(damaged.event().id, FAULT_PROTECTION_DAMAGED);
    EXPECT_EQ(damaged.shown().kept, 1u);

    Craft without; // such a slot
    without.protection().par = built;
    without.protection().par.slot = 9;
    memory.fly(without, 6);
    EXPECT_EQ(without.shown().kept, 0u);
    EXPECT_EQ(without.shown().waits, 0u);
    EXPECT_EQ(without.states(2), "PR");

    Craft alone; // whose memory is silent: it does not wait for ever
    alone.protection().par = built;
    for (int i = 0; i < FAULT_PATIENCE; i++) {
        EXPECT_EQ(alone.shown().waits, i > 0 ? 1u : 0u);
        alone.at();
    }
    EXPECT_EQ(alone.shown().waits, 0u);
}

} // namespace fault_protection_test
