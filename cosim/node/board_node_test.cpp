// SPDX-License-Identifier: Apache-2.0
// The node of a board, with flight in this process: the inputs of flight at each of its instants,
// and its messages to others, against a look-up in all that was written.
#include "cosim/node/board_node.h"

#include <cstring>
#include <map>
#include <random>

#include <gtest/gtest.h>

namespace board_node_test {

using namespace fledge;
using namespace fledge::cosim;
using namespace std::chrono_literals;

// Flight: its two inputs, and an output that tells both and changes at every second tick.
struct Number {
    Head head;
    double x;
    double y;
};
struct Flight {
    Number a, b, out, inner;
};
Flight flight;
std::vector<std::pair<Ns, Flight>> seen;
Ns restarted; // the time of its last start

constexpr const char *TEXT = "fledge/Head head  # head\n"
                             "float64 x  # x [m] a number\n"
                             "float64 y  # y [m] another\n"
                             "================================================================================\n"
                             "MSG: fledge/Head\n"
                             "int64 t  # t [ns] time of validity\n"
                             "int32 quality  # quality [-] how far it may be trusted\n"
                             "uint32 sequence  # sequence [-] counts the writings\n";

void begin()
{
    flight = {};
    flight.out.x = 42; // what it holds before its first tick
    seen.clear();
}

void tick(std::int64_t t)
{
    seen.emplace_back(t, flight);
    if (seen.size() % 2) {
        flight.out = {{t, QUALITY_GOOD, flight.out.head.sequence + 1}, flight.a.x, flight.b.x};
    }
}

RegisterLane lane(std::uint32_t address, bool from_flight)
{
    RegisterLane l{};
    l.name = "message";
    l.form = REGISTER_MESSAGE;
    l.flags = from_flight ? std::uint32_t{REGISTER_FROM_FLIGHT} : 0u;
    l.address = address;
    l.descriptors = REGISTER_NOWHERE;
    l.capacity = sizeof(Number) + 4;
    l.stride = 48;
    l.depth = 4;
    l.count = 1;
    l.interrupt = -1;
    return l;
}

/// A queue of four packets.
RegisterLane packets(std::uint32_t address, bool from_flight, std::uint32_t capacity)
{
    RegisterLane l = lane(address, from_flight);
    l.form = REGISTER_PACKET;
    l.flags |= REGISTER_VARIABLE | REGISTER_QUEUED;
    l.descriptor = {0, 16, 16, 0, 16, 0};
    l.capacity = capacity;
    l.stride = capacity + 8;
    return l;
}

const RegisterRun RUNS[] = {{8, 1}, {4, 2}, {8, 2}};
const RegisterMessage TYPE = {"Number", sizeof(Number), 3, RUNS};
const RegisterLane LANES[] = {lane(32, false), lane(256, false), lane(480, true), packets(704, false, COMMAND_MAX),
                              packets(2880, true, TELEMETRY_REPORT_MAX)};
const RegisterBoard BOARD = {"board", 1, 0, 5184, 1, 0, -1, REGISTER_NOWHERE, 0, 0, 5, LANES, nullptr};
const RegisterBoard *const BOARDS[] = {&BOARD};
const MissionMessage MESSAGES[] = {
    {"world.m.a", "Number", offsetof(Flight, a), sizeof(Number), MISSION_IN},
    {"world.m.b", "Number", offsetof(Flight, b), sizeof(Number), MISSION_IN},
    {"flight.n.out", "Number", offsetof(Flight, out), sizeof(Number), MISSION_OUT},
    {"flight.n.inner", "Number", offsetof(Flight, inner), sizeof(Number), MISSION_INSIDE},
};
const MissionLane ROWS[] = {
    {&TYPE, 0, 0, 0, 0, 0, FLEDGE_F64}, {&TYPE, 1, 0, 1, 0, 0, FLEDGE_F64}, {&TYPE, 2, 0, 2, 0, 0, FLEDGE_F64}};
std::uint8_t room[COMMAND_MAX];
const MissionIo IO = {MESSAGES, BOARDS, ROWS, 4, 1, 3, nullptr, {0, 3}, {0, 4}, room, sizeof room};
// Two parameters of flight: x and y of `inner`.
const ExecRun NUMBERS[] = {{8, 2}};
const CommandBlock BLOCKS[] = {{NUMBERS, nullptr, 16, 1, 0, 0, 0}};
std::uint8_t staged[16], waiting[128], packet[TELEMETRY_REPORT_MAX];
TelemetryRate rates[3 + COMMAND_STREAMS];
const CommandTable COMMANDS = {
    0x1880,
    0x1234,
    1,
    0,
    0,
    0,
    BLOCKS,
    staged,
    waiting,
    sizeof waiting,
    [](void *mission, std::uint16_t) -> void * { return &static_cast<Flight *>(mission)->inner.x; },
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    nullptr};
const TelemetryTable TELEMETRY = {0x0880, 0, nullptr, rates, packet, [](const void *) -> std::uint16_t { return 0; },
                                  nullptr};
CommandState state;
MissionStart begun;
const MissionTopic TOPICS[] = {{"/world/m/a", 0, 0, 0},
                               {"/world/m/b", 0, MISSION_NEXT_EXCHANGE, 1},
                               {"/flight/n/out", 0, 0, 0},
                               {"/flight/n/inner", 0, 0, 0}};
const MissionDefinition DEFINITIONS[] = {{"Number", "fledge/msg/Number", TEXT}};
const ExecRate RATES[] = {{30, 10}, {50, 0}};
const MissionExecutive EXECUTIVE = {"/flight/mode", "/flight/activity", nullptr, nullptr, nullptr, nullptr, nullptr};

MissionHost host(std::uint16_t reset)
{
    MissionHost h{};
    h.name = "numbers";
    h.mission = &flight;
    h.init = begin;
    h.restart = [](std::int64_t t) {
        restarted = t;
        begin();
    };
    h.tick = tick;
    h.io = &IO;
    h.topics = TOPICS;
    h.definitions = DEFINITIONS;
    h.rates = RATES;
    h.n_rates = 2;
    h.start = &begun;
    h.reset = reset;
    h.down = 100;
    h.commands = &COMMANDS;
    h.telemetry = &TELEMETRY;
    h.executive = &EXECUTIVE;
    h.state = &state;
    return h;
}

Payload payload(const Number &n)
{
    return make_payload(std::as_bytes(std::span(&n, 1)));
}

Number number(const Payload &p)
{
    Number n;
    read_payload(p, parse_schema(TEXT), std::as_writable_bytes(std::span(&n, 1)));
    return n;
}

/// Flight in this process, whose snapshot is the memory of its computer: all of the mission, and the registers.
struct Backend final : registers::InProcess {
    using InProcess::InProcess;

    bool saves() const override { return snapshots; }
    std::vector<std::byte> save(std::chrono::nanoseconds) override
    {
        std::vector<std::byte> bytes;
        ticks = seen.size();
        for (const std::span<std::byte> part : parts()) {
            bytes.insert(bytes.end(), part.begin(), part.end());
        }
        return bytes;
    }
    void restore(std::span<const std::byte> bytes, std::chrono::nanoseconds) override
    {
        for (const std::span<std::byte> part : parts()) {
            std::copy_n(bytes.begin(), part.size(), part.begin());
            bytes = bytes.subspan(part.size());
        }
        seen.resize(ticks);
    }
    std::vector<std::span<std::byte>> parts()
    {
        auto *words = const_cast<std::uint32_t *>(windows().front().words);
        return {std::as_writable_bytes(std::span(words, BOARD.size / 4)),
                std::as_writable_bytes(std::span(&flight, 1)),
                std::as_writable_bytes(std::span(&state, 1)),
                std::as_writable_bytes(std::span(&begun, 1)),
                std::as_writable_bytes(std::span(rates)),
                std::as_writable_bytes(std::span(&ticks, 1)),
                std::as_writable_bytes(std::span(staged)),
                std::as_writable_bytes(std::span(waiting))};
    }
    bool snapshots = false;
    std::size_t ticks = 0; ///< of flight, which decide what it puts out
};

class BoardNodeTest : public ::testing::Test {
protected:
    explicit BoardNodeTest(std::uint16_t reset = MISSION_NO_RESET)
        : mission_(host(reset)), backend_(BOARDS, [this] { fly_(); }), node_(mission_, backend_, 1ms)
    {
    }

    void exchange()
    {
        ::Tick due;
        const RegisterWindow *w = backend_.windows().data();
        MissionIoCounts counts{};
        ASSERT_TRUE(register_clock_due(w, &due));
        mission_host_exchange(&mission_, w, due.t, &counts);
        register_clock_finish(w);
    }

    void start()
    {
        node_.initialize({});
        node_.match({{7, "/flight/n/out", {}}, {8, "/flight/n/inner", {}}, {9, "/world/m/a", {}}});
        node_.start({{1, "/world/m/a", {}}, {2, "/world/m/b", {}}});
    }

    const MissionHost mission_;
    std::function<void()> fly_ = [this] { exchange(); };
    Backend backend_;
    BoardNode node_;
};

TEST_F(BoardNodeTest, SaysWhatFlightWouldSay)
{
    const Initialized answer = node_.initialize({});
    EXPECT_EQ(answer.rates, (std::vector<Rate>{{30, 10}, {50, 0}}));
    EXPECT_FALSE(answer.any_time || answer.saves);
    const Schema schema = make_schema("Number", TEXT);
    auto desired = node_.desired();
    ASSERT_EQ(desired.size(), 3u);
    EXPECT_EQ(desired.back().topic, "/flight/commands");
    EXPECT_TRUE(desired.back().optional);
    desired.pop_back();
    EXPECT_EQ(desired, (std::vector<Subscription>{{"/world/m/a", Latency::same_instant, false, schema},
                                                  {"/world/m/b", Latency::next_exchange, true, schema}}));
    // What the board does not carry is not offered, nor what flight only reads.
    const auto publications =
        node_.match({{7, "/flight/n/out", {}}, {8, "/flight/n/inner", {}}, {9, "/world/m/a", {}}});
    ASSERT_EQ(publications.size(), 1u);
    EXPECT_EQ(publications[0].channel, 7u);
    EXPECT_EQ(publications[0].schema, schema);
    EXPECT_EQ(number(publications[0].initial).x, 42); // as after its reset
    EXPECT_TRUE(seen.empty());                        // and nothing ran
}

TEST_F(BoardNodeTest, FlightSeesWhatIsThereAtEachOfItsInstantsHoweverTheyComeInTicks)
{
    std::mt19937 rng(5);
    for (int round = 0; round < 100; round++) {
        start();
        std::vector<Record> all[2];
        std::vector<Record> records;
        Ns until = -1;
        std::uint32_t counts[2] = {0, 0};
        while (until < 1000) {
            cosim::Tick granted;
            const Ns from = until + 1;
            until += 1 + static_cast<Ns>(rng() % 120);
            for (std::uint32_t channel = 1; channel <= 2; channel++) {
                Ns t = from;
                for (std::uint32_t k = rng() % 4; k > 0; k--) {
                    t += static_cast<Ns>(rng() % 40);
                    const Number n = {{t, QUALITY_GOOD, counts[channel - 1] + 1}, static_cast<double>(rng()), 0.5};
                    all[channel - 1].push_back({channel, ++counts[channel - 1], t, payload(n)});
                    granted.records.push_back(all[channel - 1].back());
                }
            }
            for (const Record &r : granted.records) {
                until = std::max(until, r.t);
            }
            granted.until = until;
            const Tock tock = node_.tick(granted);
            EXPECT_EQ(tock.reached, until);
            records.insert(records.end(), tock.records.begin(), tock.records.end());
        }
        std::vector<Ns> instants;
        for (Ns t = 0; t <= until; t++) {
            if (t % 50 == 0 || (t >= 10 && (t - 10) % 30 == 0)) {
                instants.push_back(t);
            }
        }
        ASSERT_EQ(seen.size(), instants.size());
        std::uint32_t n_seen = 0;
        for (std::size_t i = 0; i < instants.size(); i++) {
            EXPECT_EQ(seen[i].first, instants[i]);
            for (int k = 0; k < 2; k++) {
                Number last{};
                for (const Record &r : all[k]) {
                    last = r.t <= instants[i] ? number(r.payload) : last;
                }
                EXPECT_EQ(std::memcmp(k ? &seen[i].second.b : &seen[i].second.a, &last, sizeof last), 0);
            }
            if (i % 2 == 0) { // it wrote another value
                ASSERT_LT(n_seen, records.size());
                const Record &r = records[n_seen++];
                EXPECT_EQ(r.channel, 7u);
                EXPECT_EQ(r.count, n_seen);
                EXPECT_EQ(r.t, instants[i]);
                EXPECT_EQ(number(r.payload).x, seen[i].second.a.x);
                EXPECT_EQ(number(r.payload).y, seen[i].second.b.x);
            }
        }
        EXPECT_EQ(n_seen, records.size());
    }
    EXPECT_EQ(node_.counts().corrupt + node_.counts().refused + node_.counts().saturated, 0u);
}

/// A command that writes x, which is its sequence, too.
std::vector<std::uint8_t> write_x(double x)
{
    const auto sequence = static_cast<std::uint8_t>(x);
    std::vector<std::uint8_t> p{0x18, 0x80, 0xC0, sequence, 0, 17, COMMAND_WRITE, 0, 0x12, 0x34, 0, 0, 0, 0, 0, 0};
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    for (int shift = 56; shift >= 0; shift -= 8) {
        p.push_back(static_cast<std::uint8_t>(bits >> shift));
    }
    std::uint8_t sum = 0xFF;
    for (const std::uint8_t byte : p) {
        sum ^= byte;
    }
    p[7] = sum;
    return p;
}

TEST_F(BoardNodeTest, ACommandOfTheScriptCountsFromTheNextInstantOnAndOnce)
{
    std::vector<std::pair<Ns, std::vector<std::uint8_t>>> sent;
    node_.telemetry = [&](Ns t, std::span<const std::uint8_t> p) {
        sent.emplace_back(t, std::vector(p.begin(), p.end()));
    };
    node_.command(-1, write_x(1));
    node_.command(40, write_x(2));
    node_.command(50, write_x(3)); // at 50 it is too late for that instant
    node_.command(55, write_x(4)); // and comes after the one before
    for (int run = 0; run < 2; run++) {
        start();
        sent.clear();
        for (const Ns until : {45, 50, 200}) {
            node_.tick({until, {}});
        }
        const std::pair<Ns, double> expected[] = {{0, 1}, {10, 1}, {40, 1}, {50, 2}, {70, 4}, {100, 4}};
        for (std::size_t i = 0; i < 6; i++) {
            EXPECT_EQ(seen[i].first, expected[i].first);
            EXPECT_EQ(seen[i].second.inner.x, expected[i].second) << seen[i].first;
        }
        const Ns reported[] = {0, 0, 50, 50, 70, 70, 70, 70}; // acceptance and execution of each
        ASSERT_EQ(sent.size(), 8u);
        for (std::size_t i = 0; i < 8; i++) {
            EXPECT_EQ(sent[i].first, reported[i]);
            EXPECT_EQ(sent[i].second[1], 0x81);
        }
        EXPECT_EQ(state.counters.executed, 4u);
    }
}

/// A message with these bytes, whose count is n.
Payload link_message(const Schema &schema, std::span<const std::uint8_t> bytes, std::uint32_t n)
{
    Bytes held(schema.size);
    std::memcpy(held.data(), &n, sizeof n);
    std::memcpy(held.data() + sizeof n, bytes.data(), bytes.size());
    return make_payload(held);
}

TEST_F(BoardNodeTest, OtherProgramsCommandFlightAndReadItsTelemetryAsTopics)
{
    node_.initialize({});
    const Schema commands = node_.desired().back().schema;
    const auto publications = node_.match({{5, "/flight/telemetry", {}}});
    ASSERT_EQ(publications.size(), 1u);
    const auto fields = parse_schema(publications[0].schema.text);
    node_.start({{3, "/flight/commands", {}}});
    std::uint32_t count = 0;
    std::vector<std::pair<Ns, std::vector<std::uint16_t>>> reports; // sequence, reason of each
    const auto run = [&](Ns until, const std::vector<std::uint8_t> &bytes, std::uint32_t n) {
        cosim::Tick tick{until, {}};
        if (n) {
            tick.records.push_back({3, ++count, until - 10, link_message(commands, bytes, n)});
        }
        for (const Record &record : node_.tick(tick).records) {
            Bytes held(publications[0].schema.size);
            read_payload(record.payload, fields, held);
            const auto *p = reinterpret_cast<const std::uint8_t *>(held.data());
            std::uint32_t size;
            std::memcpy(&size, p, sizeof size);
            reports.emplace_back(record.t, std::vector<std::uint16_t>{});
            for (std::uint32_t at = 4; at < size + 4; at += p[at + 4] * 256u + p[at + 5] + 7u) {
                const auto number = [&](std::size_t place) {
                    const auto *two = p + at + TELEMETRY_HEADER + place;
                    return static_cast<std::uint16_t>(two[0] * 256u + two[1]);
                };
                reports.back().second.insert(reports.back().second.end(), {number(offsetof(CommandReport, sequence)),
                                                                           number(offsetof(CommandReport, reason))});
            }
        }
    };
    std::vector<std::uint8_t> two = write_x(1), more = write_x(2);
    two.insert(two.end(), more.begin(), more.end());
    run(10, two, static_cast<std::uint32_t>(two.size())); // written at 0, as packets of one message
    EXPECT_EQ(flight.inner.x, 2);
    run(40, write_x(3), 10); // cut: flight refuses it
    run(50, {}, 0);          // nothing happens, nothing is sent
    run(70, std::vector<std::uint8_t>(commands.size - 4, 0xFF),
        0xFFFFFFFFu); // longer than a packet, and than the message
    EXPECT_EQ(flight.inner.x, 2);
    EXPECT_EQ(reports,
              (std::vector<std::pair<Ns, std::vector<std::uint16_t>>>{
                  {0, {1, COMMAND_OK, 2, COMMAND_OK, 1, COMMAND_OK, 2, COMMAND_OK}}, {40, {3, COMMAND_LENGTH}}}));
    EXPECT_GE(node_.counts().refused, 1u);
}

TEST_F(BoardNodeTest, AProgramThatSendsMoreThanTheQueueTakesIsReadLater)
{
    node_.initialize({});
    const Schema commands = node_.desired().back().schema;
    node_.match({});
    node_.start({{3, "/flight/commands", {}}});
    std::vector<Record> records;
    for (std::uint32_t i = 1; i <= 20; i++) {
        const auto p = write_x(i);
        records.push_back({3, i, static_cast<Ns>(i), link_message(commands, p, static_cast<std::uint32_t>(p.size()))});
    }
    node_.tick({1000, records});
    EXPECT_EQ(flight.inner.x, 20);
    EXPECT_EQ(state.counters.executed, 20u);
}

TEST_F(BoardNodeTest, AScriptThatFillsTheQueueIsAnErrorThatSaysWhen)
{
    for (int i = 0; i < 5; i++) {
        node_.command(40, write_x(i));
    }
    start();
    node_.tick({40, {}});
    try {
        node_.tick({60, {}});
        FAIL();
    } catch (const registers::Error &error) {
        const std::string text = error.what();
        EXPECT_NE(text.find("no room for those of 0.00000004 s"), text.npos) << text;
    }
}

TEST_F(BoardNodeTest, WithoutALaneForThemThereAreNoCommands)
{
    MissionIo io = IO;
    io.commands.board = MISSION_NO_BOARD;
    MissionHost mission = host(MISSION_NO_RESET);
    mission.io = &io;
    BoardNode node(mission, backend_, 1ms);
    EXPECT_THROW(node.command(0, write_x(1)), registers::Error);
}

TEST_F(BoardNodeTest, AMessageThatIsNotTheNextOneIsAnError)
{
    start();
    EXPECT_THROW(node_.tick({100, {{1, 2, 0, payload({})}}}), ProtocolError);
    EXPECT_THROW(node_.tick({100, {{3, 1, 0, payload({})}}}), ProtocolError);
}

TEST_F(BoardNodeTest, FlightThatDoesNotAnswerIsAnErrorThatSaysWhen)
{
    start();
    fly_ = [] {};
    try {
        node_.tick({60, {}});
        FAIL();
    } catch (const registers::Error &error) {
        EXPECT_NE(std::string(error.what()).find("did not answer the tick at"), std::string::npos) << error.what();
    }
}

TEST_F(BoardNodeTest, ItCannotBeginInTheMiddle)
{
    Initialize request;
    request.start = 100;
    EXPECT_THROW(node_.initialize(request), registers::Error);
}

TEST_F(BoardNodeTest, TheEndReachesTheBoard)
{
    start();
    EXPECT_FALSE(register_clock_stopped(backend_.windows().data()));
    node_.finish("");
    EXPECT_TRUE(register_clock_stopped(backend_.windows().data()));
}

/// The message a resets the computer: its number stands at the place of a ComputerReset's count.
class BoardNodeResetTest : public BoardNodeTest {
protected:
    BoardNodeResetTest() : BoardNodeTest(0) {}

    Tock step(Ns until, std::uint32_t count)
    {
        Number n{{until, QUALITY_GOOD, 1}, 0.0, 0.0};
        std::memcpy(&n.x, &count, sizeof count);
        return node_.tick({until, {{1, ++sent_, until, payload(n)}}});
    }
    std::vector<Ns> instants() const
    {
        std::vector<Ns> all;
        std::transform(seen.begin(), seen.end(), std::back_inserter(all),
                       [](const auto &entry) { return entry.first; });
        return all;
    }
    std::uint32_t sent_ = 0;
};

TEST_F(BoardNodeResetTest, WhileTheComputerIsDownNoTickComesAndThenItBegins)
{
    start();
    const RegisterWindow *clock = backend_.windows().data();
    seen.clear();
    step(50, 0);
    EXPECT_EQ(instants(), (std::vector<Ns>{0, 10, 40, 50}));
    EXPECT_EQ(restarted, 0);
    seen.clear();
    node_.command(90, {1, 2}); // too short: flight refuses it when it lives again
    const Tock down = step(70, 3);
    EXPECT_EQ(down.reached, 70);
    EXPECT_TRUE(down.records.empty()) << "its outputs stay";
    step(160, 3);
    EXPECT_TRUE(seen.empty());
    EXPECT_EQ(register_clock_resets(clock), 0u);
    EXPECT_EQ(state.counters.refused, 0u);
    step(190, 3);
    EXPECT_EQ(instants(), (std::vector<Ns>{190})) << "the first instant 100 after that at 70, where it was seen";
    EXPECT_EQ(register_clock_resets(clock), 1u) << "one reset, however many were counted meanwhile";
    EXPECT_EQ(restarted, 190);
    EXPECT_EQ(state.counters.refused, 1u);
    step(250, 3);
    EXPECT_EQ(restarted, 190);
    node_.initialize({});
    EXPECT_EQ(register_clock_resets(clock), 1u);
}

TEST_F(BoardNodeResetTest, AnotherNodeGoesOnFromASnapshotOfAnyInstant)
{
    // Commands of others in bursts, more than their queue takes; two resets, also within a burst; a script.
    backend_.snapshots = true;
    std::mt19937 rng(11);
    std::vector<std::pair<Ns, std::vector<std::uint8_t>>> bursts;
    for (Ns t = 3; t < 1000; t += 120) {
        for (std::uint32_t k = 1 + rng() % 9; k > 0; k--) {
            bursts.emplace_back(t, write_x(static_cast<double>(1 + rng() % 200)));
        }
    }
    bursts.emplace_back(303, std::vector<std::uint8_t>(COMMAND_MAX + 10, 0xFF)); // longer than a packet: it is counted
    using Sent = std::vector<std::pair<Ns, std::vector<std::byte>>>;
    const auto fly = [&](BoardNode &node, Ns from, Ns to, std::map<Ns, Bytes> *snapshots) {
        Sent sent;
        const Schema commands = node.desired().back().schema;
        const auto publications = node.match({{7, "/flight/n/out", {}}, {5, "/flight/telemetry", {}}});
        for (const Publication &publication : publications) {
            sent.emplace_back(
                from, std::vector(publication.initial.data(), publication.initial.data() + publication.initial.size()));
        }
        node.start({{1, "/world/m/a", {}}, {3, "/flight/commands", {}}});
        std::uint32_t resets = 0, counts[2] = {};
        for (Ns t = from; t < to;) {
            const Ns until = t + 10;
            cosim::Tick tick{until, {}};
            for (const auto &[at, p] : bursts) {
                if (at > t && at <= until) {
                    tick.records.push_back(
                        {3, ++counts[0], at, link_message(commands, p, static_cast<std::uint32_t>(p.size()))});
                }
            }
            const std::uint32_t now = until > 240 ? until > 600 ? 2 : 1 : 0;
            if (now != resets || t == from) {
                resets = now;
                Number n{{until, QUALITY_GOOD, 1}, 0.0, 0.0};
                std::memcpy(&n.x, &now, sizeof now);
                tick.records.push_back({1, ++counts[1], until, payload(n)});
            }
            for (const Record &r : node.tick(tick).records) {
                sent.emplace_back(r.t, std::vector(r.payload.data(), r.payload.data() + r.payload.size()));
            }
            t = until;
            if (snapshots) {
                (*snapshots)[t] = node.save();
            }
        }
        return sent;
    };
    const auto script = [](BoardNode &node) {
        node.command(100, write_x(201));
        node.command(700, write_x(202));
    };
    script(node_);
    EXPECT_TRUE(node_.initialize({}).saves);
    std::map<Ns, Bytes> snapshots;
    const Sent whole = fly(node_, 0, 1000, &snapshots);
    EXPECT_GT(whole.size(), 30u);
    const MissionIoCounts counts = node_.counts();
    EXPECT_GT(counts.refused, 0u);
    for (const auto &[at, snapshot] : snapshots) {
        if (at == 1000) {
            break;
        }
        BoardNode node(mission_, backend_, 1ms);
        script(node);
        Initialize request;
        request.start = at;
        request.snapshot = snapshot;
        ASSERT_TRUE(node.initialize(request).saves);
        const Sent rest = fly(node, at, 1000, nullptr);
        ASSERT_GE(rest.size(), 2u);
        const auto after =
            std::find_if(whole.begin() + 2, whole.end(), [t = at](const auto &entry) { return entry.first > t; });
        EXPECT_TRUE(std::equal(rest.begin() + 2, rest.end(), after, whole.end())) << at;
        EXPECT_EQ(std::memcmp(&node.counts(), &counts, sizeof counts), 0) << at;
        if (const auto last =
                std::find_if(std::make_reverse_iterator(after), whole.rend(),
                             [&](const auto &entry) { return entry.second.size() == rest[1].second.size(); });
            last != whole.rend()) {
            EXPECT_TRUE(last->second == rest[1].second) << "the last telemetry is the initial value, at " << at;
        }
    }
    Initialize request;
    request.start = 500;
    request.snapshot = snapshots[520];
    EXPECT_THROW(node_.initialize(request), registers::Error) << "it is of a later time";
    for (std::size_t n = 1; n < snapshots[500].size(); n += 97) {
        request.snapshot.assign(snapshots[500].begin(), snapshots[500].begin() + static_cast<std::ptrdiff_t>(n));
        EXPECT_THROW(node_.initialize(request), registers::Error) << n;
    }
    request.snapshot = snapshots[500];
    request.snapshot.push_back({});
    EXPECT_THROW(node_.initialize(request), registers::Error);
    request.snapshot[0] = std::byte{'F'};
    EXPECT_THROW(node_.initialize(request), registers::Error);
}

/// What came by radio at t, as the world's node hands it over.
Record by_radio(Ns t, std::vector<std::vector<std::uint8_t>> units, std::uint32_t count)
{
    UnitsOut out;
    out.open(3, 1000, 50);
    std::vector<sim::Packet> packets;
    for (auto &unit : units) {
        packets.push_back({t, std::move(unit)});
    }
    std::vector<Record> records;
    out.write(t, packets, records);
    records[0].count = count;
    return records[0];
}

TEST_F(BoardNodeResetTest, WhatComesByRadioIsTakenUnitByUnitAndLostWhileTheComputerIsDown)
{
    node_.speak_by_radio();
    node_.initialize({});
    EXPECT_EQ(node_.desired().back().topic, "/flight/uplink");
    EXPECT_EQ(node_.match({{5, "/flight/downlink", {}}}).size(), 1u);
    node_.start({{1, "/world/m/a", {}}, {3, "/flight/uplink", units_schema(1000)}});
    const Number up{{0, QUALITY_GOOD, 1}, 0.0, 0.0};
    Number reset = up;
    const std::uint32_t count = 3;
    std::memcpy(&reset.x, &count, sizeof count);
    const std::vector<std::uint8_t> nonsense{1, 2, 3, 4, 5, 6, 7}, two(16, 0); // the header of that says 7 bytes

    Tock tock = node_.tick({60, {{1, 1, 0, payload(up)}, by_radio(50, {nonsense, two}, 1)}});
    EXPECT_EQ(state.counters.refused, 2u) << "a unit is refused as a whole, whatever lengths it has";
    std::size_t reports = 0;
    for (const Record &record : tock.records) {
        EXPECT_EQ(record.channel, 5u);
        for (const sim::Packet &unit : units_of(record.payload)) {
            EXPECT_EQ(unit.t, record.t);
            reports++;
        }
    }
    EXPECT_EQ(reports, 2u);

    // At 70 it goes down, and begins at 190: what has come until then is lost.
    node_.tick({200,
                {{1, 2, 70, payload(reset)},
                 by_radio(70, {nonsense}, 2),
                 by_radio(100, {nonsense, two}, 3),
                 by_radio(190, {two}, 4),
                 by_radio(200, {nonsense}, 5)}});
    EXPECT_EQ(restarted, 190);
    EXPECT_EQ(state.counters.refused, 1u);
}

} // namespace board_node_test
