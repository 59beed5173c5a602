// SPDX-License-Identifier: Apache-2.0
// Every command, right and wrong, as bytes that are put together here; and random bytes.
#include "flight/command/command.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace command_test {

using Bytes = std::vector<uint8_t>;

/// The parameters of a module of configuration, of a module with an initial value, and of a long one.
struct Config {
    double mass;
    uint32_t count;
    int16_t limit[2];
    double rows[3];
};
struct Start {
    double angle;
    double gain;
};
struct Long {
    double table[150];
};

const ExecRun config_runs[] = {{8, 1}, {4, 1}, {2, 2}, {8, 3}}, doubles2[] = {{8, 2}}, doubles150[] = {{8, 150}};
const CommandRule config_rules[] = {
    {"mass", "> 0 kg", 0, 1, 1, COMMAND_ALL_ROWS, FLEDGE_HAS_LO | FLEDGE_LO_OPEN, FLEDGE_F64, 0.0, 0.0},
    {"count", "<= 3", 8, 1, 1, COMMAND_ALL_ROWS, FLEDGE_HAS_HI, FLEDGE_U32, 0.0, 3.0},
    {"rows", "<= 1", 16, 3, 1, 8, FLEDGE_HAS_HI, FLEDGE_F64, 0.0, 1.0}};
const CommandRule start_rules[] = {{"gain", "", 8, 1, 1, COMMAND_ALL_ROWS, 0, FLEDGE_F64, 0.0, 0.0},
                                   {"angle", "", 0, 1, 1, COMMAND_ALL_ROWS, COMMAND_START, FLEDGE_F64, 0.0, 0.0}};
const CommandRule long_rules[] = {
    {"table", "<= 10", 0, 150, 1, COMMAND_ALL_ROWS, FLEDGE_HAS_HI, FLEDGE_F64, 0.0, 10.0}};
const CommandBlock blocks[] = {{config_runs, config_rules, sizeof(Config), 4, 3, 1, 0},
                               {doubles2, start_rules, sizeof(Start), 1, 2, 0, 0},
                               {doubles150, long_rules, sizeof(Long), 1, 1, 0, 0}};

struct Mission {
    Config config{2.0, 2, {1, 2}, {0.5, 0.6, 7.0}};
    Start start{0.1, 1.0};
    Long large{};
    std::string log; ///< what commands did
    int closed = -1; ///< the mode whose condition does not hold
};

uint8_t staged[sizeof(Long)], queue[3 * COMMAND_MAX];

void note(void *mission, const std::string &what)
{
    static_cast<Mission *>(mission)->log += what + ";";
}

/// Records the requests to a host of procedures, which answers with `verdict`.
uint8_t slots[2 * 600];
std::string requests;
CommandReason verdict;

CommandProcedures procedures = {slots,
                                600,
                                2,
                                1,
                                [](const CommandContext *c, uint16_t slot, uint32_t n, uint32_t turns) {
                                    requests += "start " + std::to_string(slot) + " " + std::to_string(n) + " " +
                                                std::to_string(turns) + " " + std::to_string(c->sequence) + " " +
                                                std::to_string(c->t) + ";";
                                    return verdict;
                                },
                                [](const CommandContext *c, uint16_t slot) {
                                    requests +=
                                        "stop " + std::to_string(slot) + " " + std::to_string(c->sequence) + ";";
                                    return verdict;
                                },
                                [](const CommandContext *, const uint8_t *text, uint32_t n, uint32_t turns) {
                                    requests += std::string(text, text + n) + " " + std::to_string(turns) + ";";
                                    return verdict;
                                }};

CommandTable table = {
    0x1855,
    0xABCD,
    3,
    2,
    2,
    4,
    blocks,
    staged,
    queue,
    sizeof queue,
    [](void *mission, uint16_t block) -> void * {
        auto &m = *static_cast<Mission *>(mission);
        void *const memory[] = {&m.config, &m.start, &m.large};
        return memory[block];
    },
    [](void *m, uint16_t mode) { note(m, "enter " + std::to_string(mode)); },
    [](void *m, uint16_t block, int64_t t) { note(m, "publish " + std::to_string(block) + " " + std::to_string(t)); },
    [](void *m, uint16_t event, int on) { note(m, "arm " + std::to_string(event) + " " + std::to_string(on)); },
    [](void *m, int64_t t) { note(m, "reset " + std::to_string(t)); },
    [](void *m, uint16_t output, int on, uint16_t every) {
        note(m, "telemetry " + std::to_string(output) + " " + std::to_string(on) + " " + std::to_string(every));
    },
    &procedures,
    nullptr,
    [](void *m, uint16_t mode) -> int { return mode != static_cast<Mission *>(m)->closed; },
    nullptr};

/// A packet with a good header around these bytes, by the layout in command.h.
Bytes packet(uint8_t code, const Bytes &rest, uint16_t stream = 0x1855, uint16_t sequence = 7)
{
    const auto length = static_cast<uint16_t>(8 + rest.size() - 7);
    Bytes p{uint8_t(stream >> 8),
            uint8_t(stream),
            uint8_t(0xC0 | sequence >> 8),
            uint8_t(sequence),
            uint8_t(length >> 8),
            uint8_t(length),
            code,
            0};
    p.insert(p.end(), rest.begin(), rest.end());
    uint8_t sum = 0xFF;
    for (const uint8_t byte : p) {
        sum ^= byte;
    }
    p[7] = sum;
    return p;
}

Bytes operator+(Bytes a, const Bytes &b)
{
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

template <class T> Bytes big(T value)
{
    Bytes bytes(sizeof value);
    std::memcpy(bytes.data(), &value, sizeof value);
    if (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__) {
        std::reverse(bytes.begin(), bytes.end());
    }
    return bytes;
}

const Bytes version{0xAB, 0xCD};

struct Command : testing::Test {
    struct Got {
        CommandReport report;
        Bytes data;
    };

    Command()
    {
        command_begin(&state);
        table.procedures = &procedures;
        procedures.evaluates = 1;
        verdict = COMMAND_OK;
        requests.clear();
    }

    static void sink(void *user, const CommandReport *report, const uint8_t *data)
    {
        static_cast<Command *>(user)->reports.push_back({*report, Bytes(data, data + report->n)});
    }
    CommandReason accept(const Bytes &bytes)
    {
        // On the heap, so that the sanitizer sees a read beyond its end.
        const Bytes copy = bytes;
        return command_accept(&state, &table, link, copy.data(), static_cast<uint32_t>(copy.size()), sink, this);
    }
    /// The reason of the acceptance, or else that of the execution.
    CommandReason command(const Bytes &bytes)
    {
        const CommandReason reason = accept(bytes);
        if (reason != COMMAND_OK) {
            return reason;
        }
        execute();
        return static_cast<CommandReason>(reports.back().report.reason);
    }
    void execute() { command_execute(&state, &table, &mission, t += 5, sink, this); }

    CommandState state;
    CommandLink *link = nullptr; ///< a software bus
    Mission mission;
    std::vector<Got> reports;
    int64_t t = 95;
};

TEST_F(Command, APduGoesToItsServiceInNoOrderAndWithoutAReport)
{
    static Bytes arrived;
    arrived.clear();
    CommandService files{};
    files.arrive = [](const CommandContext *, void *, const uint8_t *bytes, uint32_t n) {
        arrived.insert(arrived.end(), bytes, bytes + n);
    };
    const CommandService *const list[] = {&files};
    CommandServices services{};
    services.list = list;
    services.n = 1;
    services.module = [](void *m, uint32_t) { return m; };
    services.check = command_service_check;
    services.execute = command_service_execute;
    services.run = command_service_run;
    link = &state.ground;
    EXPECT_EQ(accept(packet(19, {1, 2}, 0x1855, 0)), COMMAND_ABSENT); // of flight without the service
    table.services = &services;
    reports.clear();
    EXPECT_EQ(accept(packet(19, {1, 2}, 0x1855, 0)), COMMAND_OK);
    EXPECT_EQ(accept(packet(19, {3}, 0x1855, 0)), COMMAND_OK);
    EXPECT_EQ(accept(packet(19, {}, 0x1855, 0)), COMMAND_LENGTH);
    EXPECT_TRUE(arrived.empty());
    execute();
    EXPECT_EQ(arrived, (Bytes{1, 2, 3}));
    EXPECT_EQ(reports.size(), 1u); // of the one refused
    EXPECT_EQ(state.counters.accepted + state.counters.executed + link->begun, 0u);
    table.services = nullptr;
}

TEST_F(Command, AServiceHasItsCodesAndWhatASenderMayNotGiveItMayNotStore)
{
    static std::string did;
    did.clear();
    CommandService other{}, store{};
    other.first = COMMAND_FILE_SEND;
    other.n = 1;
    store.first = COMMAND_STORE;
    store.n = 1;
    store.check = [](const uint8_t *, uint32_t) { return COMMAND_OK; };
    store.unwrap = [](const CommandContext *, void *, const uint8_t *unit, uint32_t n, CommandPackets give,
                      void *user) { give(user, unit, n, 1u << COMMAND_MODE); };
    store.wrap = [](const CommandContext *, void *, const uint8_t *bytes, uint32_t n, CommandBytes give, void *user) {
        give(user, bytes, n);
    };
    const CommandService *const list[] = {&other, &store}; // the second speaks frames
    CommandServices services{};
    services.list = list;
    services.n = 2;
    services.module = [](void *m, uint32_t place) { return did += std::to_string(place), m; };
    services.check = command_service_check;
    const CommandContext context = {&state, &table, &mission, 100, 0};
    const auto receive = [&](const Bytes &bytes) {
        const CommandReason taken =
            command_receive(&context, bytes.data(), static_cast<uint32_t>(bytes.size()), sink, this);
        return std::pair{taken, static_cast<CommandReason>(reports.back().report.reason)};
    };
    const auto stored = [&](uint8_t code) {
        return packet(COMMAND_STORE, version + Bytes(COMMAND_STORED - 10) + packet(code, version + Bytes{0, 1}));
    };
    using Reasons = std::pair<CommandReason, CommandReason>;
    EXPECT_EQ(receive(packet(2, version + Bytes{0, 1}, 0x1855, 1)), Reasons(COMMAND_OK, COMMAND_OK)); // no services
    table.services = &services;
    EXPECT_EQ(receive(packet(2, version + Bytes{0, 1}, 0x1855, 2)), Reasons(COMMAND_OK, COMMAND_OK)); // no frames
    services.unwrap = command_service_unwrap;
    state.waiting = 0;
    for (const auto &[bytes, reason] : {std::pair{packet(2, version + Bytes{0, 1}, 0x1855, 8), COMMAND_ROLE},
                                        {stored(COMMAND_MODE), COMMAND_ROLE},
                                        {packet(0, {}, 0x1855, 8), COMMAND_OK},
                                        {packet(COMMAND_UNIT, version + Bytes(6)), COMMAND_ABSENT}}) {
        EXPECT_EQ(receive(bytes), Reasons(COMMAND_OK, reason)) << int{bytes[6]};
    }
    state.ground = {};
    EXPECT_EQ(receive(stored(COMMAND_ARM)), Reasons(COMMAND_OK, COMMAND_OK));
    EXPECT_EQ(did, "11111"); // all units are the second one's
    Bytes sent;
    command_service_wrap(
        &context, version.data(), 2,
        [](void *user, const uint8_t *bytes, uint32_t n) { static_cast<Bytes *>(user)->assign(bytes, bytes + n); },
        &sent);
    EXPECT_EQ(sent, version);
    table.services = nullptr;
}

TEST_F(Command, ALinkFromTheGroundTakesACommandOnceAndABusAsOftenAsItComes)
{
    const auto noop = [](uint16_t sequence) { return packet(0, {}, 0x1855, sequence); };
    EXPECT_EQ(command(noop(5)), COMMAND_OK);
    EXPECT_EQ(command(noop(5)), COMMAND_OK); // of another sender on the bus
    EXPECT_EQ(state.ground.begun, 0u);
    link = &state.ground;
    EXPECT_EQ(command(noop(16380)), COMMAND_OK); // the first may have any
    EXPECT_EQ(command(noop(16380)), COMMAND_SEQUENCE);
    EXPECT_EQ(reports.back().report.detail, 16380u);
    EXPECT_EQ(reports.back().report.sequence, 16380u);
    EXPECT_EQ(command(noop(16379)), COMMAND_SEQUENCE);
    EXPECT_EQ(command(noop(16381)), COMMAND_OK);
    EXPECT_EQ(command(noop(2)), COMMAND_OK); // others were lost, and the count began again
    EXPECT_EQ(command(noop(16381)), COMMAND_SEQUENCE);
    EXPECT_EQ(command(noop(2 + 8191)), COMMAND_OK);
    EXPECT_EQ(command(noop(2)), COMMAND_SEQUENCE);
    EXPECT_EQ(command(noop(0)), COMMAND_OK);
    EXPECT_EQ(command(noop(8192)), COMMAND_SEQUENCE); // as far behind as ahead
    EXPECT_EQ(state.counters.reasons[COMMAND_SEQUENCE], 5u);
    EXPECT_EQ(state.counters.executed, 7u);
    command_begin(&state);
    EXPECT_EQ(command(noop(1)), COMMAND_OK); // of a flight that begins anew
}

TEST_F(Command, WhatALinkBroughtInVainMayComeAgain)
{
    link = &state.ground;
    const Bytes mode = packet(2, version + Bytes{0, 1}, 0x1855, 3), wrong = packet(2, version + Bytes{0, 9}, 0x1855, 2);
    EXPECT_EQ(command(packet(0, {}, 0x1855, 1)), COMMAND_OK);
    EXPECT_EQ(command(wrong), COMMAND_PLACE);
    EXPECT_EQ(command(wrong), COMMAND_PLACE);
    while (accept(packet(0, {}, 0x1855, static_cast<uint16_t>(state.ground.last + 1))) == COMMAND_OK) {
    }
    EXPECT_EQ(reports.back().report.reason, COMMAND_BUSY);
    const Bytes again = packet(0, {}, 0x1855, static_cast<uint16_t>(state.ground.last + 1));
    execute();
    EXPECT_EQ(command(again), COMMAND_OK);
    EXPECT_EQ(command(mode), COMMAND_SEQUENCE); // it is late by now
    EXPECT_EQ(mission.log, "");
}

TEST_F(Command, ModesEventsResetAndTelemetryDoWhatTheySay)
{
    EXPECT_EQ(command(packet(2, version + Bytes{0, 1})), COMMAND_OK);
    EXPECT_EQ(command(packet(8, version + Bytes{0, 1, 0, 0})), COMMAND_OK);
    EXPECT_EQ(command(packet(8, version + Bytes{0, 0, 0, 1})), COMMAND_OK);
    EXPECT_EQ(command(packet(6, version + Bytes{0, 0})), COMMAND_OK);
    EXPECT_EQ(command(packet(7, version)), COMMAND_OK);
    EXPECT_EQ(command(packet(10, version + Bytes{0, 3, 0, 1, 0, 9})), COMMAND_OK);
    EXPECT_EQ(command(packet(10, version + Bytes{0xFF, 0xFF, 0, 0, 0, 1})), COMMAND_OK);
    EXPECT_EQ(command(packet(0, {})), COMMAND_OK);
    EXPECT_EQ(mission.log, "enter 1;arm 1 0;arm 0 1;publish 0 115;reset 120;telemetry 3 1 9;telemetry 65535 0 1;");
    for (const Got &got : reports) {
        EXPECT_EQ(got.report.detail, 0u);
        EXPECT_EQ(got.report.n, 0u);
    }
    EXPECT_EQ(state.counters.accepted, 8u);
    EXPECT_EQ(state.counters.executed, 8u);
    EXPECT_EQ(state.counters.refused, 0u);
    EXPECT_EQ(command(packet(1, {})), COMMAND_OK);
    EXPECT_EQ(state.counters.accepted, 0u);
    EXPECT_EQ(state.counters.executed, 0u);
}

TEST_F(Command, BothReportsHaveSequenceCodeAndTime)
{
    EXPECT_EQ(accept(packet(2, version + Bytes{0, 1}, 0x1855, 0x2345)), COMMAND_OK);
    EXPECT_EQ(mission.log, "");
    execute();
    execute();
    ASSERT_EQ(reports.size(), 2u);
    EXPECT_EQ(reports[0].report.t, -1);
    EXPECT_EQ(reports[1].report.t, 100);
    for (int i = 0; i < 2; i++) {
        EXPECT_EQ(reports[i].report.executed, i);
        EXPECT_EQ(reports[i].report.sequence, 0x2345);
        EXPECT_EQ(reports[i].report.code, 2);
        EXPECT_EQ(reports[i].report.detail, 0);
        EXPECT_EQ(reports[i].data, Bytes{});
    }
    accept(packet(0, {}));
    EXPECT_EQ(reports[2].report.t, 105);
}

TEST_F(Command, ParametersAreWrittenAndReadBackBigEndian)
{
    const Bytes place{0, 0, 0, 0, 0, 12}; // limit, and the first row
    const Bytes data = big<int16_t>(-3) + big<int16_t>(700) + big(0.25);
    EXPECT_EQ(command(packet(3, version + place + data)), COMMAND_OK);
    EXPECT_EQ(mission.config.limit[0], -3);
    EXPECT_EQ(mission.config.limit[1], 700);
    EXPECT_EQ(mission.config.rows[0], 0.25);
    EXPECT_EQ(mission.config.count, 2u);
    EXPECT_EQ(mission.config.rows[1], 0.6);
    EXPECT_EQ(mission.log, "publish 0 100;"); // as it is of the configuration
    EXPECT_EQ(command(packet(9, version + place + Bytes{0, 12})), COMMAND_OK);
    EXPECT_EQ(reports.back().data, data);
    EXPECT_EQ(reports.back().report.n, 12);
    EXPECT_EQ(command(packet(3, version + Bytes{0, 1, 0, 0, 0, 8} + big(4.0))), COMMAND_OK);
    EXPECT_EQ(mission.start.gain, 4.0);
    EXPECT_EQ(mission.log, "publish 0 100;");
}

TEST_F(Command, WhatBreaksARuleChangesNothing)
{
    const Config before = mission.config;
    const auto write = [&](uint8_t offset, const Bytes &data) {
        return command(packet(3, version + Bytes{0, 0, 0, 0, 0, offset} + data));
    };
    EXPECT_EQ(write(0, big(0.0)), COMMAND_RULE);
    EXPECT_EQ(reports.back().report.detail, 0);
    EXPECT_EQ(write(8, big<uint32_t>(4)), COMMAND_RULE);
    EXPECT_EQ(reports.back().report.detail, 1);
    EXPECT_EQ(write(8, big<uint32_t>(3)), COMMAND_RULE); // the third row counts then
    EXPECT_EQ(reports.back().report.detail, 2);
    EXPECT_EQ(write(16, big(std::numeric_limits<double>::quiet_NaN())), COMMAND_RULE);
    EXPECT_EQ(std::memcmp(&mission.config, &before, sizeof before), 0);
    EXPECT_EQ(mission.log, "");
    EXPECT_EQ(state.counters.accepted, 4u);
    EXPECT_EQ(state.counters.executed, 0u);
    EXPECT_EQ(state.counters.reasons[COMMAND_RULE], 4u);
}

TEST_F(Command, AnInitialValueChangesOnlyBeforeTheFirstInstant)
{
    const auto angle = [&](double x) {
        return command(packet(3, version + Bytes{0, 1, 0, 0, 0, 0} + big(x) + big(9.0)));
    };
    t = -5;
    EXPECT_EQ(angle(0.5), COMMAND_OK);
    EXPECT_EQ(mission.start.angle, 0.5);
    EXPECT_EQ(state.t, 0);
    for (int i = 0; i < 2; i++) { // after the instant 0, and after another one
        EXPECT_EQ(angle(0.7), COMMAND_INITIAL);
        EXPECT_EQ(mission.start.angle, 0.5);
        EXPECT_EQ(angle(0.5), COMMAND_OK); // no change of it
    }
    EXPECT_EQ(mission.start.gain, 9.0);
    // Also one of its first or last byte alone, whatever the byte order, and by a command for it alone.
    for (const double x : {std::nextafter(0.5, 1.0), -0.5}) {
        EXPECT_EQ(angle(x), COMMAND_INITIAL) << x;
        EXPECT_EQ(command(packet(3, version + Bytes{0, 1, 0, 0, 0, 0} + big(x))), COMMAND_INITIAL) << x;
        EXPECT_EQ(reports.back().report.detail, 1);
        EXPECT_EQ(mission.start.angle, 0.5);
    }
}

/// The commands that stage a block in parts of 512 bytes and less.
std::vector<Bytes> stages(uint8_t module, const Bytes &block)
{
    std::vector<Bytes> packets;
    for (std::size_t at = 0; at < block.size(); at += 512) {
        const auto end = std::min(block.size(), at + 512);
        packets.push_back(packet(4, version + Bytes{0, module, 0, 0, uint8_t(at >> 8), uint8_t(at)} +
                                        Bytes(block.begin() + long(at), block.begin() + long(end))));
    }
    return packets;
}

Bytes commit(uint8_t module, const Bytes &block)
{
    return packet(5, version + Bytes{0, module} + big(command_crc(block.data(), uint32_t(block.size()))));
}

TEST_F(Command, AStagedBlockCountsAsAWholeWhenItIsCommitted)
{
    Bytes block;
    for (int i = 0; i < 150; i++) {
        block = block + big(i / 100.0);
    }
    auto parts = stages(2, block);
    ASSERT_EQ(parts.size(), 3u);
    std::swap(parts[0], parts[2]); // their order does not matter
    for (const Bytes &part : parts) {
        EXPECT_EQ(command(part), COMMAND_OK);
        EXPECT_EQ(mission.large.table[149], 0.0);
    }
    EXPECT_EQ(command(commit(2, block)), COMMAND_OK);
    EXPECT_EQ(mission.large.table[149], 1.49);
    EXPECT_EQ(mission.large.table[1], 0.01);
    EXPECT_EQ(command(commit(2, block)), COMMAND_NOT_STAGED);

    // All at one instant.
    block[0] = 0x3F;
    block[1] = 0xE0; // 0.5
    parts = stages(2, block);
    for (const Bytes &part : {parts[1], parts[0]}) {
        EXPECT_EQ(accept(part), COMMAND_OK);
    }
    execute();
    for (const Bytes &part : {parts[2], commit(2, block)}) {
        EXPECT_EQ(accept(part), COMMAND_OK);
    }
    execute();
    EXPECT_EQ(mission.large.table[0], 0.5);
}

TEST_F(Command, AStagedBlockThatIsNotTheCommittedOneStaysOut)
{
    Bytes block(sizeof(Long), 0);
    block[0] = 0x3F; // a small number
    auto parts = stages(2, block);
    EXPECT_EQ(command(commit(2, block)), COMMAND_NOT_STAGED);
    EXPECT_EQ(command(parts[1]), COMMAND_OK);
    EXPECT_EQ(command(commit(2, block)), COMMAND_CRC); // a part is missing
    EXPECT_EQ(command(commit(1, block)), COMMAND_NOT_STAGED);
    EXPECT_EQ(command(parts[0]), COMMAND_OK);
    EXPECT_EQ(command(commit(2, block)), COMMAND_OK);
    EXPECT_GT(mission.large.table[0], 0.0);

    Bytes large = big(11.0);
    for (int i = 1; i < 150; i++) {
        large = large + big(i / 16.0 + 0.1);
    }
    const double before = mission.large.table[0];
    for (const Bytes &part : stages(2, large)) {
        EXPECT_EQ(command(part), COMMAND_OK);
    }
    EXPECT_EQ(command(commit(2, large)), COMMAND_RULE);
    EXPECT_EQ(mission.large.table[0], before);
    std::copy_n(big(9.0).begin(), 8, large.begin());
    EXPECT_EQ(command(stages(2, large)[0]), COMMAND_OK); // the rest is still staged
    EXPECT_EQ(command(commit(2, large)), COMMAND_OK);
    EXPECT_EQ(mission.large.table[0], 9.0);
    EXPECT_EQ(mission.large.table[70], 70 / 16.0 + 0.1) << "a refused commit leaves what is staged as it was";
}

TEST_F(Command, ACommitThatWouldChangeAnInitialValueLeavesWhatIsStaged)
{
    execute(); // the first instant
    const Bytes wrong = big(0.2) + big(3.5), right = big(0.1) + big(3.5);
    EXPECT_EQ(command(stages(1, wrong)[0]), COMMAND_OK);
    EXPECT_EQ(command(commit(1, wrong)), COMMAND_INITIAL);
    EXPECT_EQ(mission.start.gain, 1.0);
    EXPECT_EQ(command(packet(4, version + Bytes{0, 1, 0, 0, 0, 0} + big(0.1))), COMMAND_OK);
    EXPECT_EQ(command(commit(1, right)), COMMAND_OK);
    EXPECT_EQ(mission.start.angle, 0.1);
    EXPECT_EQ(mission.start.gain, 3.5);
}

TEST_F(Command, AResetForgetsWhatIsStaged)
{
    const Bytes block(sizeof(Long), 0);
    EXPECT_EQ(command(stages(2, block)[0]), COMMAND_OK);
    EXPECT_EQ(command(packet(7, version)), COMMAND_OK);
    EXPECT_EQ(command(commit(2, block)), COMMAND_NOT_STAGED);
    EXPECT_EQ(command(stages(2, block)[0]), COMMAND_OK);
    EXPECT_EQ(command(commit(2, block)), COMMAND_OK);
}

TEST_F(Command, EveryWrongPacketIsRefusedWithItsReason)
{
    const Bytes mode = packet(2, version + Bytes{0, 1});
    const auto refused = [&](CommandReason reason, const Bytes &bytes, const char *what) {
        SCOPED_TRACE(what);
        const auto before = state.counters;
        EXPECT_EQ(accept(bytes), reason);
        EXPECT_EQ(state.counters.refused, before.refused + 1);
        EXPECT_EQ(state.counters.reasons[reason], before.reasons[reason] + 1);
        EXPECT_EQ(state.counters.accepted, before.accepted);
        EXPECT_EQ(state.waiting, 0u);
        EXPECT_EQ(reports.back().report.reason, reason);
    };
    const auto on = [](Bytes packet, std::size_t at, uint8_t bits) { return packet[at] ^= bits, packet; };
    refused(COMMAND_LENGTH, {}, "nothing");
    refused(COMMAND_LENGTH, Bytes(mode.begin(), mode.begin() + 7), "less than a header");
    refused(COMMAND_LENGTH, mode + Bytes{0}, "longer than it says");
    refused(COMMAND_LENGTH, Bytes(mode.begin(), mode.end() - 1), "shorter than it says");
    refused(COMMAND_LENGTH, packet(2, version + Bytes{0}), "an argument too short");
    refused(COMMAND_LENGTH, packet(2, version + Bytes{0, 1, 0, 0}), "an argument too many");
    refused(COMMAND_LENGTH, packet(0, version), "an argument of a command without any");
    refused(COMMAND_LENGTH, packet(3, version + Bytes{0, 1, 0, 0, 0, 0}), "no bytes to write");
    refused(COMMAND_LENGTH, packet(3, version + Bytes{0, 2, 0, 0, 0, 0} + Bytes(520)), "too many bytes");
    for (std::size_t i = 0; i < mode.size(); i++) {
        if (i != 4 && i != 5) {
            refused(COMMAND_CHECKSUM, on(mode, i, 0x10), "a wrong bit");
        }
    }
    refused(COMMAND_STREAM, packet(2, version + Bytes{0, 1}, 0x1856), "another stream");
    refused(COMMAND_STREAM, packet(2, version + Bytes{0, 1}, 0x0855), "telemetry");
    for (const uint8_t bits : {0x40, 0x80, 0xC0}) { // neither bit of its flags may miss
        refused(COMMAND_STREAM, on(on(mode, 2, bits), 7, bits), "a part of a packet");
    }
    refused(COMMAND_UNKNOWN, packet(COMMAND_CODES, version), "no such code");
    refused(COMMAND_ABSENT, packet(18, version + Bytes{0, 1}), "of a service that is not there");
    refused(COMMAND_VERSION, packet(2, {0xAB, 0xCE, 0, 1}), "another version");
    refused(COMMAND_PLACE, packet(2, version + Bytes{0, 2}), "no such mode");
    refused(COMMAND_PLACE, packet(8, version + Bytes{0, 2, 0, 1}), "no such event");
    refused(COMMAND_VALUE, packet(8, version + Bytes{0, 1, 0, 2}), "neither armed nor not");
    refused(COMMAND_PLACE, packet(10, version + Bytes{0, 5, 0, 1, 0, 1}), "no such output");
    refused(COMMAND_VALUE, packet(10, version + Bytes{0, 0, 0, 1, 0, 0}), "a rate of 0");
    refused(COMMAND_VALUE, packet(10, version + Bytes{0, 0, 0, 2, 0, 1}), "neither on nor off");
    refused(COMMAND_PLACE, packet(6, version + Bytes{0, 3}), "no such module");
    refused(COMMAND_VALUE, packet(6, version + Bytes{0, 1}), "it publishes nothing");
    refused(COMMAND_PLACE, packet(5, version + Bytes{0, 3, 0, 0}), "no such module to commit");
    for (const uint8_t code : {3, 4}) {
        const auto bytes = [&](uint8_t module, uint8_t offset, std::size_t n) {
            return packet(code, version + Bytes{0, module, 0, 0, 0, offset} + Bytes(n));
        };
        refused(COMMAND_PLACE, bytes(3, 0, 8), "no such module");
        refused(COMMAND_PLACE, bytes(1, 16, 8), "behind the block");
        refused(COMMAND_PLACE, bytes(1, 8, 16), "beyond its end");
        refused(COMMAND_PLACE, bytes(1, 4, 8), "from within a number");
        refused(COMMAND_PLACE, bytes(1, 0, 4), "to within a number");
        refused(COMMAND_PLACE, bytes(0, 9, 3), "from within a count");
        refused(COMMAND_PLACE, packet(code, version + Bytes{0, 1, 0xFF, 0xFF, 0xFF, 0xF8} + Bytes(8)), "far");
    }
    refused(COMMAND_PLACE, packet(11, version + Bytes{0, 2, 0, 0, 0, 0} + Bytes(8)), "no such slot");
    refused(COMMAND_PLACE, packet(11, version + Bytes{0, 1, 0, 0, 2, 81} + Bytes(8)), "beyond the end of the slot");
    refused(COMMAND_PLACE, packet(11, version + Bytes{0, 1, 0xFF, 0xFF, 0xFF, 0xF8} + Bytes(8)), "far");
    refused(COMMAND_LENGTH, packet(11, version + Bytes{0, 0, 0, 0, 0, 0}), "no bytecode");
    refused(COMMAND_PLACE, packet(12, version + Bytes{0, 2, 0, 0, 0, 9, 1, 1, 0, 0, 0, 1}), "no such slot");
    refused(COMMAND_PLACE, packet(12, version + Bytes{0, 1, 0, 0, 2, 89, 1, 1, 0, 0, 0, 1}), "longer than a slot");
    refused(COMMAND_VALUE, packet(12, version + Bytes{0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1}), "no length");
    refused(COMMAND_VALUE, packet(12, version + Bytes{0, 1, 0, 0, 0, 9, 1, 1, 0, 0, 0, 0}), "no turns");
    refused(COMMAND_LENGTH, packet(12, version + Bytes{0, 1, 0, 0, 0, 9, 1, 1, 0, 0}), "a start without its end");
    refused(COMMAND_PLACE, packet(13, version + Bytes{0, 2}), "no such slot to stop");
    refused(COMMAND_VALUE, packet(14, version + Bytes{0, 1, 0, 0, 0, 9, 'x'}), "a word that must be 0");
    refused(COMMAND_VALUE, packet(14, version + Bytes{0, 0, 0, 0, 0, 0, 'x'}), "a text without turns");
    procedures.evaluates = 0;
    refused(COMMAND_ABSENT, packet(14, version + Bytes{0, 0, 0, 0, 0, 9, 'x'}), "no compiler");
    table.procedures = nullptr;
    for (const Bytes &unit : {packet(11, version + Bytes{0, 0, 0, 0, 0, 0} + Bytes(8)),
                              packet(12, version + Bytes{0, 1, 0, 0, 0, 9, 1, 1, 0, 0, 0, 1}),
                              packet(13, version + Bytes{0, 0}), packet(14, version + Bytes{0, 0, 0, 0, 0, 9, 'x'})}) {
        refused(COMMAND_ABSENT, unit, "no interpreter");
    }
    refused(COMMAND_PLACE, packet(9, version + Bytes{0, 1, 0, 0, 0, 0, 0, 0}), "nothing to read");
    refused(COMMAND_PLACE, packet(9, version + Bytes{0, 2, 0, 0, 0, 0, 2, 8}), "too much to read");
    execute();
    EXPECT_EQ(mission.log, "");
}

TEST_F(Command, AProcedureStartsWhenItIsStagedAsAWhole)
{
    Bytes code(600);
    for (std::size_t i = 0; i < code.size(); i++) {
        code[i] = uint8_t(i * 7);
    }
    const Bytes low(code.begin(), code.begin() + 512), high(code.begin() + 512, code.end());
    const Bytes start =
        packet(12, version + Bytes{0, 1, 0, 0, 2, 88} + big(command_crc(code.data(), 600)) + Bytes{0, 1, 0, 0});
    EXPECT_EQ(command(packet(11, version + Bytes{0, 1, 0, 0, 2, 0} + high)), COMMAND_OK);
    EXPECT_EQ(command(start), COMMAND_CRC); // a part is missing
    EXPECT_EQ(command(packet(11, version + Bytes{0, 1, 0, 0, 0, 0} + low)), COMMAND_OK);
    EXPECT_EQ(requests, "");
    EXPECT_EQ(command(start), COMMAND_OK);
    EXPECT_EQ(requests, "start 1 600 65536 7 115;");
    EXPECT_EQ(command(packet(13, version + Bytes{0, 1})), COMMAND_OK);
    EXPECT_EQ(command(packet(14, version + Bytes{0, 0, 0, 0, 1, 0} + Bytes{'f', '.', 'K'})), COMMAND_OK);
    EXPECT_EQ(requests, "start 1 600 65536 7 115;stop 1 7;f.K 256;");
    verdict = COMMAND_RUNNING;
    EXPECT_EQ(command(start), COMMAND_RUNNING);
    EXPECT_EQ(state.counters.reasons[COMMAND_RUNNING], 1u);
    EXPECT_EQ(mission.log, "");
}

TEST_F(Command, AProcedureWritesByTheRulesOfCommands)
{
    const CommandContext context = {&state, &table, &mission, 100, 7};
    uint16_t detail = 99;
    const auto write = [&](uint16_t module, uint32_t at, double x) {
        return command_write(&context, module, at, reinterpret_cast<const uint8_t *>(&x), 8, &detail);
    };
    execute();
    EXPECT_EQ(write(0, 0, 5.0), COMMAND_OK);
    EXPECT_EQ(mission.config.mass, 5.0);
    EXPECT_EQ(mission.log, "publish 0 100;"); // at the instant
    EXPECT_EQ(write(0, 0, -1.0), COMMAND_RULE);
    EXPECT_EQ(detail, 0);
    EXPECT_EQ(mission.config.mass, 5.0);
    EXPECT_EQ(write(1, 0, 0.5), COMMAND_INITIAL);
    EXPECT_EQ(write(1, 8, 0.5), COMMAND_OK);
    EXPECT_EQ(write(1, 4, 0.5), COMMAND_PLACE);
    EXPECT_EQ(write(3, 0, 0.5), COMMAND_PLACE);
    for (const uint32_t n : {0u, COMMAND_DATA_MAX + 8u}) {
        EXPECT_EQ(command_write(&context, 2, 0, Bytes(600).data(), n, &detail), COMMAND_PLACE) << n;
    }
    EXPECT_EQ(command_enter(&context, 1), COMMAND_OK);
    EXPECT_EQ(command_enter(&context, 2), COMMAND_PLACE);
    EXPECT_TRUE(command_may_enter(&context, 2)); // no condition forbids it
    EXPECT_EQ(mission.log, "publish 0 100;enter 1;");
    EXPECT_EQ(state.counters.executed, 3u);
    EXPECT_EQ(state.counters.refused, 7u);
    EXPECT_EQ(reports.size(), 0u);
}

TEST_F(Command, AnInitialValueBehindWhatIsWrittenDoesNotMatter)
{
    const CommandRule rules[] = {{"gain", "", 8, 1, 1, COMMAND_ALL_ROWS, COMMAND_START, FLEDGE_F64, 0.0, 0.0}};
    const CommandBlock own[] = {blocks[0], {doubles2, rules, sizeof(Start), 1, 1, 0, 0}};
    CommandTable other = table;
    other.blocks = own;
    other.n_blocks = 2;
    const CommandContext context = {&state, &other, &mission, 100, 0};
    uint16_t detail = 0;
    const double x = 9.0;
    state.t = 0;
    for (const auto &[at, reason] : {std::pair{0u, COMMAND_OK}, {8u, COMMAND_INITIAL}}) {
        EXPECT_EQ(command_write(&context, 1, at, reinterpret_cast<const uint8_t *>(&x), 8, &detail), reason);
    }
    EXPECT_EQ(mission.start.angle, 9.0);
    EXPECT_EQ(mission.start.gain, 1.0);
}

TEST_F(Command, AModeIsRefusedAtTheInstantAtWhichItsConditionDoesNotHold)
{
    const CommandContext context = {&state, &table, &mission, 100, 0};
    EXPECT_EQ(accept(packet(2, version + Bytes{0, 1})), COMMAND_OK) << "the condition is evaluated later";
    mission.closed = 1;
    execute();
    EXPECT_EQ(reports.back().report.reason, COMMAND_GUARDED);
    EXPECT_EQ(reports.back().report.executed, COMMAND_DONE);
    EXPECT_EQ(command(packet(2, version + Bytes{0, 0})), COMMAND_OK);
    EXPECT_EQ(mission.log, "enter 0;");
    EXPECT_EQ(command_enter(&context, 1), COMMAND_GUARDED);
    EXPECT_EQ(state.counters.reasons[COMMAND_GUARDED], 2u);
    EXPECT_EQ(state.counters.refused, 2u);
    mission.closed = -1;
    EXPECT_EQ(command(packet(2, version + Bytes{0, 1})), COMMAND_OK);
    EXPECT_EQ(command_enter(&context, 1), COMMAND_OK);
    EXPECT_EQ(mission.log, "enter 0;enter 1;enter 1;");
}

TEST_F(Command, AFullQueueRefusesAndGoesOn)
{
    const Bytes longest = packet(4, version + Bytes{0, 2, 0, 0, 0, 0} + Bytes(512));
    for (int i = 0; i < 3; i++) {
        EXPECT_EQ(accept(longest), COMMAND_OK);
    }
    EXPECT_EQ(accept(packet(0, {})), COMMAND_BUSY);
    execute();
    EXPECT_EQ(accept(packet(0, {})), COMMAND_OK);
    EXPECT_EQ(state.counters.reasons[COMMAND_BUSY], 1u);
}

TEST_F(Command, RandomBytesNeverChangeTheMissionUnlessTheyAreAccepted)
{
    std::mt19937 random(4711);
    const std::vector<Bytes> good{packet(2, version + Bytes{0, 1}),
                                  packet(3, version + Bytes{0, 1, 0, 0, 0, 8} + big(3.0)),
                                  packet(4, version + Bytes{0, 2, 0, 0, 0, 8} + big(3.0)),
                                  packet(5, version + Bytes{0, 2, 1, 1}),
                                  packet(6, version + Bytes{0, 0}),
                                  packet(7, version),
                                  packet(8, version + Bytes{0, 1, 0, 1}),
                                  packet(9, version + Bytes{0, 0, 0, 0, 0, 8, 0, 8}),
                                  packet(10, version + Bytes{0, 1, 0, 1, 0, 1}),
                                  packet(11, version + Bytes{0, 1, 0, 0, 0, 8} + big(3.0)),
                                  packet(12, version + Bytes{0, 1, 0, 0, 0, 8, 1, 1, 0, 0, 0, 1}),
                                  packet(13, version + Bytes{0, 1}),
                                  packet(14, version + Bytes{0, 0, 0, 0, 0, 1, 'x'})};
    int accepted = 0;
    for (int i = 0; i < 200000; i++) {
        Bytes bytes;
        if (i % 2) {
            bytes.resize(random() % 40);
            for (uint8_t &byte : bytes) {
                byte = static_cast<uint8_t>(random());
            }
        } else { // a good one with some wrong bytes behind the header, and often with a good checksum
            bytes = good[random() % good.size()];
            for (auto n = 1 + random() % 3; n > 0; n--) {
                bytes[6 + random() % (bytes.size() - 6)] = static_cast<uint8_t>(random() % 4);
            }
            if (random() % 4) {
                bytes = packet(bytes[6], Bytes(bytes.begin() + 8, bytes.end()));
            }
        }
        const Mission before = mission;
        const auto counters = state.counters;
        const bool taken = accept(bytes) == COMMAND_OK;
        execute();
        accepted += taken;
        if (!taken) {
            ASSERT_EQ(std::memcmp(&mission.config, &before.config, sizeof before.config), 0);
            ASSERT_EQ(std::memcmp(&mission.start, &before.start, sizeof before.start), 0);
            ASSERT_EQ(std::memcmp(&mission.large, &before.large, sizeof before.large), 0);
            ASSERT_EQ(mission.log, "");
            ASSERT_EQ(state.counters.refused, counters.refused + 1);
        }
        for (int k = 0; k < 3; k++) { // whatever is accepted keeps the rules
            uint32_t element;
            ASSERT_EQ(
                command_check(blocks[k].rules, blocks[k].n_rules, table.parameters(&mission, uint16_t(k)), &element),
                nullptr);
        }
        mission.log.clear();
        reports.clear();
    }
    EXPECT_GT(accepted, 5000);
    EXPECT_LT(accepted, 100000);
}

TEST(CommandRules, VectorsHaveALengthAndInertiasAreThoseOfBodies)
{
    struct Block {
        double before;
        double axes[2][3];
        double scale[2];
        double inertia[2][3][3];
    };
    const Block good{
        0.0,
        {{0.0, 0.0, 1.0}, {1.0, 1.0, 1.0}},
        {1.0, 2.0},
        {{{3.0, 0.0, 0.0}, {0.0, 4.0, 0.0}, {0.0, 0.0, 5.0}}, {{5.0, 0.0, 0.0}, {0.0, 4.0, 0.0}, {0.0, 0.0, 3.0}}}};
    const CommandRule rules[] = {
        {"axes", "", offsetof(Block, axes), 6, 3, COMMAND_ALL_ROWS, COMMAND_NON_ZERO, FLEDGE_F64, 0.0, 0.0},
        {"scale", "", offsetof(Block, scale), 2, 1, COMMAND_ALL_ROWS, COMMAND_NON_ZERO, FLEDGE_F64, 0.0, 0.0},
        {"inertia", "", offsetof(Block, inertia), 18, 9, COMMAND_ALL_ROWS, COMMAND_INERTIA, FLEDGE_F64, 0.0, 0.0}};
    const auto broken = [&](const auto &change) -> std::pair<std::string, uint32_t> {
        Block block = good;
        change(block);
        uint32_t element = 99;
        const CommandRule *rule = command_check(rules, 3, &block, &element);
        return rule ? std::pair{std::string(rule->name), element} : std::pair{std::string(), 0u};
    };
    using Broken = std::pair<std::string, uint32_t>;
    EXPECT_EQ(broken([](Block &) {}), Broken("", 0));
    EXPECT_EQ(broken([](Block &b) { b.axes[0][2] = 0.0; }), Broken("axes", 0));
    EXPECT_EQ(broken([](Block &b) { b.axes[1][0] = b.axes[1][1] = b.axes[1][2] = 0.0; }), Broken("axes", 3));
    EXPECT_EQ(broken([](Block &b) { b.axes[1][0] = b.axes[1][2] = 0.0; }), Broken("", 0));
    EXPECT_EQ(broken([](Block &b) { b.scale[1] = 0.0; }), Broken("scale", 1));
    EXPECT_EQ(broken([](Block &b) { b.inertia[0][0][0] = 10.0; }), Broken("inertia", 0));
    EXPECT_EQ(broken([](Block &b) { b.inertia[1][2][2] = -3.0; }), Broken("inertia", 9));
}

TEST(CommandCrc, IsThatOfCcsds)
{
    // The check value of CRC-16/CCITT-FALSE, which CCSDS 131.0-B defines.
    EXPECT_EQ(command_crc(reinterpret_cast<const uint8_t *>("123456789"), 9), 0x29B1);
}

} // namespace command_test
