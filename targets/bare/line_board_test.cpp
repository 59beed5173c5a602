// SPDX-License-Identifier: Apache-2.0
// A board behind a simulated line: the five functions of port.h are the line, its clock, and the outside at its other
// end, which lives while the board waits. The line damages and loses bytes and is cut, the board is reset anywhere, and
// another outside takes the place of the first one. A run ends with all answers and the whole record, or with a fault
// that is named. FLEDGE_CASES sets how many runs there are, FLEDGE_SEED which.
#include "registers/line.h"
#include "targets/mission_host.h"
extern "C" {
#include "targets/bare/bare.h"
#include "targets/bare/fault.h"
#include "targets/bare/port.h"
}

#include <gtest/gtest.h>

#include <array>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

extern "C" void fresh_line_board();

namespace line_board_test {

using Bytes = std::vector<std::uint8_t>;
constexpr std::int64_t us = 1000, ms = 1'000'000;
constexpr std::uint32_t words = 300, in_at = 64, out_at = 640; ///< [bytes] of the boards

std::uint32_t number_of(const char *variable, std::uint32_t otherwise)
{
    const char *given = std::getenv(variable);
    return given != nullptr ? static_cast<std::uint32_t>(std::strtoul(given, nullptr, 10)) : otherwise;
}

// ---- a mission, of which the line needs little: two boards, the first with the clock

RegisterBoard board_of(std::uint32_t clock, std::uint32_t big_endian)
{
    RegisterBoard b{};
    b.name = "board";
    b.hash = 5;
    b.size = words * 4;
    b.big_endian = big_endian;
    b.clock = clock;
    b.clock_interrupt = -1;
    b.interrupts = REGISTER_NOWHERE;
    return b;
}

const RegisterBoard first = board_of(0, 1), second = board_of(REGISTER_NOWHERE, 0);
const RegisterBoard *const boards[] = {&first, &second};
MissionIo io;
MissionHost mission;

/// The answer of flight to a tick: each word follows from the one that it reads, and from all ticks since its start.
std::uint32_t answer(std::uint32_t read, std::uint32_t state, std::uint32_t i)
{
    return (read ^ state) * 2654435761u + i;
}

/// The bytes that flight records at a tick.
Bytes recorded(std::uint32_t tick, std::uint32_t state)
{
    Bytes bytes(40 + state % 1400);
    for (std::size_t i = 0; i < bytes.size(); i++) {
        bytes[i] = static_cast<std::uint8_t>(tick * 31 + state + i * (state | 1u));
    }
    return bytes;
}

// ---- the outside

struct Outside {
    std::uint32_t seed = 0, ticks_wanted = 0, tick = 0; ///< ticks that were answered
    bool waits = false, stopped = false;
    std::vector<std::uint64_t> memory[2]{std::vector<std::uint64_t>((words + 1) / 2),
                                         std::vector<std::uint64_t>((words + 1) / 2)};
    std::vector<RegisterWindow> windows;
    std::vector<std::uint32_t> shadow = std::vector<std::uint32_t>(2 * words);
    LineMirror mirror{};
    LineEnd end{};
    bool sending = false;
    std::uint32_t boot = 0, session = 0;
    std::uint32_t state = 0; ///< of flight, as it must be
    Bytes record, expected;
    std::string text;
    std::vector<std::string> shouts;
    std::optional<int> status;
    std::set<std::string> faults; ///< that it can name

    explicit Outside(std::uint32_t its_seed, std::uint32_t ticks) : seed(its_seed), ticks_wanted(ticks)
    {
        for (int i = 0; i < 2; i++) {
            windows.push_back(register_window(boards[i], reinterpret_cast<volatile std::uint32_t *>(memory[i].data())));
        }
    }
    void greet(std::int64_t now, bool goes_on)
    {
        session = session * 1664525u + seed * 2u + 1013904223u;
        const LineHello hello{
            0, session | 1u, static_cast<std::uint32_t>(goes_on ? LINE_RECORDS | LINE_GO_ON : LINE_RECORDS), 921600, 0};
        line_greet(&end, &hello, take, this, now);
        line_mirror_begin(&mirror, windows.data(), 2, shadow.data());
        sending = tick != 0 || waits; // all of the memory, once more
    }
    void go_on(std::int64_t now)
    {
        if (lost) {
            lost = false;
            faults.insert("reset");
            if (waits) {
                state = 0; // flight begins at this tick
            }
            began_anew = true;
            text.clear(); // a board that is reset while it ends sends all of it again
            status.reset();
            greet(now, true);
        }
        if (line_is_open(&end) == 0) {
            return;
        }
        if (!waits && !stopped) {
            tick < ticks_wanted ? begin() : stop();
        }
        while (sending && line_room(&end) > 0) {
            std::uint8_t payload[LINE_PAYLOAD];
            int last = 0;
            const std::uint32_t n = line_mirror_take(&mirror, payload, &last);
            line_put(&end, LINE_WORDS, static_cast<std::uint32_t>(last), tick, payload, n);
            sending = last == 0;
        }
    }

private:
    bool lost = false, began_anew = true;

    std::uint32_t input(std::uint32_t i) const { return (seed + tick * 7919u + i) * 2246822519u; }
    void begin()
    {
        for (std::uint32_t i = 0; i < 1 + tick % 90; i++) {
            register_store(&windows[i % 2], in_at + 4 * i, input(i));
        }
        register_clock_start(&windows[0], {static_cast<std::int64_t>(tick) * 1000, 1000});
        waits = sending = true;
    }
    void stop()
    {
        register_clock_stop(&windows[0]);
        stopped = sending = true;
    }
    void answered()
    {
        if (!waits || register_clock_is_done(&windows[0]) == 0) {
            return;
        }
        if (began_anew) {
            state = 0;
            began_anew = false;
        }
        state = state * 33u + tick + 1;
        for (std::uint32_t i = 0; i < 1 + tick % 90; i++) {
            ASSERT_EQ(register_load(&windows[(i + 1) % 2], out_at + 4 * i), answer(input(i), state, i)) << tick;
        }
        const Bytes more = recorded(tick, state);
        expected.insert(expected.end(), more.begin(), more.end());
        waits = false;
        tick++;
    }
    void take_record(const LineMessage &m)
    {
        ASSERT_GT(m.n, 4u);
        const std::uint32_t at = m.bytes[0] | static_cast<std::uint32_t>(m.bytes[1]) << 8 |
                                 static_cast<std::uint32_t>(m.bytes[2]) << 16 |
                                 static_cast<std::uint32_t>(m.bytes[3]) << 24;
        if (at == 0) { // it begins anew
            record.clear();
        }
        if (at > record.size()) {
            faults.insert("record");
            return;
        }
        const std::uint32_t known = std::min<std::uint32_t>(static_cast<std::uint32_t>(record.size()) - at, m.n - 4);
        ASSERT_TRUE(std::equal(m.bytes + 4, m.bytes + 4 + known, record.begin() + at)); // sent again after a reset
        record.insert(record.end(), m.bytes + 4 + known, m.bytes + m.n);
    }
    static void take(void *user, const LineMessage *m)
    {
        auto *o = static_cast<Outside *>(user);
        switch (m->kind) {
        case LINE_WELCOME:
            o->lost |= m->welcome.session == 0 || m->welcome.boot != o->end.welcome.boot ||
                       (o->boot != 0 && m->welcome.boot != o->boot && m->welcome.session == o->boot);
            o->boot = m->welcome.boot;
            break;
        case LINE_WORDS:
            ASSERT_EQ(line_mirror_put(&o->mirror, m->bytes, m->n), 1);
            if ((m->flags & LINE_LAST) != 0) {
                line_mirror_finish(&o->mirror);
                o->answered();
            }
            break;
        case LINE_RECORD: o->take_record(*m); break;
        case LINE_TEXT: o->text.append(reinterpret_cast<const char *>(m->bytes), m->n); break;
        case LINE_END: o->status = m->bytes[0]; break;
        case LINE_SHOUT: o->shouts.emplace_back(reinterpret_cast<const char *>(m->bytes), m->n); break;
        default: FAIL() << m->kind;
        }
    }
};

// ---- the line and the board

/// As recorder.c has it.
struct Kept {
    std::uint32_t mark, busy, failed, recorded, answered; ///< answered: 1 + the tick that is not recorded yet; 0: none
};

struct World {
    std::mt19937 random;
    std::int64_t now = 0; ///< [ns]
    double flipped = 0, lost = 0;
    std::uint32_t cuts = 0, resets = 0; ///< once in so many milliseconds; 0: never
    bool cut = false, stays_whole = false;
    std::uint32_t changes = 0; ///< another outside comes once in so many milliseconds
    std::deque<std::uint8_t> down, up;
    alignas(8) std::array<std::uint8_t, 5000> kept;
    std::unique_ptr<Outside> outside;
    std::jmp_buf reset;
    int did_reset = 0, did_change = 0;
    std::int64_t next = 0; ///< [ns] when the outside lives next
    bool started = true;   ///< the outside is there

    explicit World(std::uint32_t seed) : random(seed)
    {
        for (auto &byte : kept) { // after power-on it is anything
            byte = static_cast<std::uint8_t>(random());
        }
    }
    bool happens(double p) { return p > 0 && std::uniform_real_distribution<>(0, 1)(random) < p; }
    bool once_in(std::uint32_t n) { return n != 0 && random() % n == 0; }
    void pass(std::deque<std::uint8_t> &wire, const std::uint8_t *p, std::size_t n)
    {
        for (std::size_t i = 0; i < n; i++) {
            std::uint8_t byte = p[i];
            if (cut || happens(lost)) {
                continue;
            }
            if (happens(8 * flipped)) {
                byte = static_cast<std::uint8_t>(byte ^ 1u << random() % 8);
            }
            wire.push_back(byte);
        }
    }
    /// A millisecond of the outside.
    void live()
    {
        if (outside->end.take == nullptr) {
            outside->greet(now, false);
        }
        const std::vector<std::uint8_t> come(up.begin(), up.end());
        up.clear();
        line_input(&outside->end, come.data(), come.size(), now);
        outside->go_on(now);
        std::size_t n = 0;
        for (const std::uint8_t *frame; (frame = line_output(&outside->end, now, &n)) != nullptr;) {
            pass(down, frame, n);
        }
        if (once_in(cuts)) {
            cut = !cut;
        }
        if (now > 3000 * ms) { // in the end the line is whole
            cut = false;
            flipped = lost = 0;
            cuts = resets = changes = 0;
        }
        if (once_in(changes)) {
            did_change++;
            outside = std::make_unique<Outside>(static_cast<std::uint32_t>(random()), outside->ticks_wanted);
        }
    }
    /// Time passes, of the board, too: it may be reset at any moment.
    void spend(std::int64_t time)
    {
        now += time;
        while (next < now && started) {
            next += ms;
            live();
            if (once_in(resets)) {
                did_reset++;
                if (random() % 2 == 0) {
                    down.clear(); // bytes in its UART
                }
                std::longjmp(reset, 1);
            }
        }
    }
};

World *here;

/// The program of the board, until the run has ended.
int fly()
{
    static RegisterWindow windows[2];
    auto *kept = static_cast<Kept *>(bare_keep(sizeof(Kept)));
    if (kept->mark != 77) {
        *kept = {77, 0, 0, 0, 0};
    }
    if (kept->busy != 0) {
        kept->failed = 1;
    }
    bare_begin(&mission, windows);
    bare_watch();
    std::uint32_t state = 0;
    bool begun = false;
    Tick tick;
    while (register_clock_stopped(&windows[0]) == 0) {
        if (register_clock_due(&windows[0], &tick) == 0) {
            bare_idle();
            continue;
        }
        const auto number = static_cast<std::uint32_t>(tick.t / 1000);
        if (number == 0) { // of a run
            *kept = {77, 0, 0, 0, 0};
            bare_recording(BARE_RECORD_BEGINS);
            begun = false;
        }
        state = (begun ? state : 0u) * 33u + number + 1;
        begun = true;
        for (std::uint32_t i = 0; i < 1 + number % 90; i++) {
            here->spend(us);
            register_store(&windows[(i + 1) % 2], out_at + 4 * i,
                           answer(register_load(&windows[i % 2], in_at + 4 * i), state, i));
        }
        if (kept->answered != 0 && kept->answered != number + 1) {
            kept->failed = 1;
        }
        kept->answered = number + 1;
        register_clock_finish(&windows[0]);
        kept->busy = 1;
        static Bytes bytes; // a reset does not destroy it
        bytes = recorded(number, state);
        for (std::size_t at = 0; at < bytes.size(); at += 100) {
            here->spend(us);
            bare_record(bytes.data() + at, std::min<std::size_t>(100, bytes.size() - at));
        }
        bare_record_flush();
        kept->busy = 0;
        kept->answered = 0;
        kept->recorded++;
    }
    kept->failed |= kept->answered;
    bare_say_figure("recorded", kept->recorded);
    bare_end(kept->failed != 0 ? 1 : 0);
    return kept->failed != 0 ? 1 : 0;
}

/// Run the board's program until a run has ended; where it is reset, it starts again.
void run(World &world)
{
    here = &world;
    mission.name = "none";
    mission.io = &io;
    io.boards = boards;
    io.n_boards = 2;
    // The jump leaves functions of C, and functions here that hold nothing to be destroyed.
    setjmp(world.reset); // NOLINT
    fresh_line_board();
    do {
        fly();
        for (int i = 0; i < 500; i++) { // the outside hears the last of it, or another one comes
            world.spend(ms);
        }
    } while (!world.outside->status.has_value());
}

} // namespace line_board_test

using line_board_test::here;

extern "C" void board_send(const void *bytes, std::size_t n)
{
    const auto *p = static_cast<const std::uint8_t *>(bytes);
    here->pass(here->up, p, n);
    here->spend(static_cast<std::int64_t>(n) * 10 * 1'000'000'000 / 921600);
}

extern "C" std::size_t board_receive(void *bytes, std::size_t room)
{
    auto *p = static_cast<std::uint8_t *>(bytes);
    if (here->down.empty()) {
        here->spend(line_board_test::ms);
    }
    std::size_t n = 0;
    for (; n < room && !here->down.empty(); here->down.pop_front()) {
        p[n++] = here->down.front();
    }
    return n;
}

extern "C" std::int64_t board_time()
{
    here->spend(100);
    return here->now;
}

extern "C" void board_watch() {}

extern "C" void *board_keep(std::size_t size)
{
    return size <= here->kept.size() ? here->kept.data() : nullptr;
}

namespace line_board_test {

TEST(LineBoard, AWholeLineCarriesTheWholeRun)
{
    World world(1);
    world.outside = std::make_unique<Outside>(1, 200);
    run(world);
    const Outside &o = *world.outside;
    EXPECT_EQ(o.tick, 200u);
    EXPECT_EQ(o.record, o.expected);
    EXPECT_EQ(o.status, 0);
    EXPECT_EQ(o.text, "recorded 200\n");
    EXPECT_TRUE(o.faults.empty());
    EXPECT_EQ(o.end.counts.resent, 0u);
}

TEST(LineBoard, AFaultIsShoutedThroughTheLine)
{
    World world(2);
    world.outside = std::make_unique<Outside>(1, 3);
    run(world);
    bare_shout("fault: none", 11);
    world.spend(2 * ms);
    EXPECT_EQ(world.outside->shouts, std::vector<std::string>{"fault: none"});
}

/// All answers are checked as they come. The record is the expected one, or its fault is named.
TEST(LineBoard, NothingIsSilentlyWrong)
{
    const std::uint32_t cases = number_of("FLEDGE_CASES", 200), seed = number_of("FLEDGE_SEED", 1);
    std::uint32_t whole = 0, named = 0, went_on = 0, changed = 0;
    for (std::uint32_t i = 0; i < cases; i++) {
        SCOPED_TRACE("FLEDGE_SEED=" + std::to_string(seed + i));
        World world(seed + i);
        const auto any = [&](std::uint32_t n) { return static_cast<std::uint32_t>(world.random() % n); };
        world.outside = std::make_unique<Outside>(seed + i, 1 + any(60));
        world.flipped = std::array{0.0, 1e-5, 1e-4}[any(3)];
        world.lost = std::array{0.0, 1e-4}[any(2)];
        world.cuts = std::array{0u, 200u}[any(2)];
        world.resets = std::array{0u, 150u}[any(2)];
        world.changes = std::array{0u, 0u, 400u}[any(3)];
        run(world);
        const Outside &o = *world.outside;
        ASSERT_EQ(o.tick, o.ticks_wanted);
        ASSERT_TRUE(o.status.has_value());
        const bool is_whole = o.status == 0 && o.faults.count("record") == 0;
        if (is_whole) {
            ASSERT_EQ(o.record, o.expected);
            ASSERT_EQ(o.text, "recorded " + std::to_string(o.ticks_wanted) + "\n");
        } else {
            ASSERT_EQ(o.faults.count("reset"), 1u);
        }
        if (HasFailure()) {
            return;
        }
        whole += is_whole;
        named += !is_whole;
        went_on += is_whole && o.faults.count("reset") != 0;
        changed += world.did_change != 0;
    }
    EXPECT_GT(whole, cases / 2);
    EXPECT_GT(named, 0u);
    EXPECT_GT(went_on, 0u); // a reset while flight computes or waits costs nothing of the record
    EXPECT_GT(changed, cases / 10);
}

/// Tables in which both ends must agree; a test may change them.
struct Tables {
    std::vector<MissionMessage> messages{{"world.a", "A", 0, 24, MISSION_IN}, {"flight.b", "B", 24, 16, MISSION_OUT}};
    std::vector<MissionTopic> topics{{"/world/a", 0, MISSION_SAME_INSTANT, 0}, {"/flight/b", 1, 0, 0}};
    std::vector<MissionDefinition> definitions{{"A", "fledge/msg/A", "float64 x"}, {"B", "fledge/msg/B", "float64 y"}};
    std::vector<ExecRate> rates{{1000, 0}};
    std::vector<MissionLane> lanes{{nullptr, 0, 0, 0, 0, 0, FLEDGE_F64}, {nullptr, 1, 1, 0, 0, 0, FLEDGE_F64}};
    RegisterBoard a = first, b = second;
    std::string name = "mission";

    std::uint64_t hash() const
    {
        const RegisterBoard *const both[] = {&a, &b};
        MissionIo table{};
        table.messages = messages.data();
        table.n_messages = static_cast<std::uint32_t>(messages.size());
        table.boards = both;
        table.n_boards = 2;
        table.lanes = lanes.data();
        table.n_lanes = static_cast<std::uint32_t>(lanes.size());
        MissionHost host{};
        host.name = name.c_str();
        host.io = &table;
        host.topics = topics.data();
        host.definitions = definitions.data();
        host.rates = rates.data();
        host.n_rates = static_cast<std::uint16_t>(rates.size());
        return mission_host_hash(&host);
    }
};

TEST(MissionHash, EachThingThatBothEndsMustAgreeOnChangesIt)
{
    std::set<std::uint64_t> hashes{Tables().hash()};
    const auto changed = [&](auto change) {
        Tables tables;
        change(tables);
        return hashes.insert(tables.hash()).second;
    };
    EXPECT_TRUE(changed([](Tables &t) { t.name = "missions"; }));
    EXPECT_TRUE(changed([](Tables &t) { t.messages[0].path = "world.c"; }));
    EXPECT_TRUE(changed([](Tables &t) { t.messages[0].type = "C"; }));
    EXPECT_TRUE(changed([](Tables &t) { t.messages[1].size = 20; }));
    EXPECT_TRUE(changed([](Tables &t) { t.messages[1].direction = MISSION_INSIDE; }));
    EXPECT_TRUE(changed([](Tables &t) { t.topics[0].latency = MISSION_NEXT_INSTANT; }));
    EXPECT_TRUE(changed([](Tables &t) { t.definitions[1].text = "float32 y"; }));
    EXPECT_TRUE(changed([](Tables &t) { t.rates[0].period = 2000; }));
    EXPECT_TRUE(changed([](Tables &t) { t.rates[0].offset = 5; }));
    EXPECT_TRUE(changed([](Tables &t) { t.a.hash++; }));
    EXPECT_TRUE(changed([](Tables &t) { t.b.hash++; }));
    EXPECT_TRUE(changed([](Tables &t) { t.lanes[0].field = 1; }));
    EXPECT_TRUE(changed([](Tables &t) { t.lanes[1].board = 0; }));
    EXPECT_TRUE(changed([](Tables &t) { t.lanes.pop_back(); }));
    // Where a struct has a message is each program's own.
    EXPECT_FALSE(changed([](Tables &t) { t.messages[1].offset = 32; }));
}

} // namespace line_board_test
