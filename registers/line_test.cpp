// SPDX-License-Identifier: Apache-2.0
// Two ends of a link over a simulated line, which damages, loses, repeats and adds bytes, is cut, and whose ends start
// anew. FLEDGE_CASES sets how many runs there are, FLEDGE_SEED which.
#include "registers/line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace line_test {

using Bytes = std::vector<std::uint8_t>;
constexpr std::int64_t ms = 1'000'000;

std::uint32_t number_of(const char *variable, std::uint32_t otherwise)
{
    const char *given = std::getenv(variable);
    return given != nullptr ? static_cast<std::uint32_t>(std::strtoul(given, nullptr, 10)) : otherwise;
}

/// Another CRC-32, bit by bit.
std::uint32_t crc_of(const std::uint8_t *p, std::size_t n)
{
    std::uint32_t r = 0xFFFFFFFFu;
    for (std::size_t i = 0; i < n; i++) {
        r ^= p[i];
        for (int bit = 0; bit < 8; bit++) {
            r = (r & 1u) != 0 ? r >> 1 ^ 0xEDB88320u : r >> 1;
        }
    }
    return ~r;
}

struct Passed {
    LineKind kind;
    std::uint32_t flags, tick;
    Bytes bytes;
    bool operator==(const Passed &) const = default;
};

/// What both ends of a session have put and taken.
struct Session {
    std::array<std::vector<Passed>, 2> put, taken; ///< of the outside, of the board
};

/// One direction of a line.
class Wire {
public:
    double flipped = 0, lost = 0, twice = 0, added = 0; ///< probabilities, of a bit and of bytes
    bool cut = false;
    int latency = 0;      ///< [ms]
    std::size_t held = 0; ///< the last bytes wait until others push them

    explicit Wire(std::mt19937 &random) : random_(random) {}
    void send(const std::uint8_t *p, std::size_t n)
    {
        for (std::size_t i = 0; i < n; i++) {
            add(p[i]);
        }
    }
    /// What has come at `t` [ms], not more than `most` bytes.
    Bytes come(std::int64_t t, std::size_t most)
    {
        Bytes bytes;
        for (; waiting_.size() > held && bytes.size() < most && waiting_.front().first <= t; waiting_.pop_front()) {
            bytes.push_back(waiting_.front().second);
        }
        return bytes;
    }
    void at(std::int64_t t) { now_ = t; }
    bool is_empty() const { return waiting_.empty(); }

private:
    bool happens(double probability)
    {
        return probability > 0 && std::uniform_real_distribution<>(0, 1)(random_) < probability;
    }
    void add(std::uint8_t byte)
    {
        if (cut || happens(lost)) {
            return;
        }
        for (int bit = 0; flipped > 0 && bit < 8; bit++) {
            byte = static_cast<std::uint8_t>(byte ^ (happens(flipped) ? 1u << bit : 0u));
        }
        waiting_.emplace_back(now_ + latency, byte);
        if (happens(twice)) {
            waiting_.emplace_back(now_ + latency, byte);
        }
        if (happens(added)) {
            waiting_.emplace_back(now_ + latency, static_cast<std::uint8_t>(random_()));
        }
    }
    std::mt19937 &random_;
    std::int64_t now_ = 0;
    std::deque<std::pair<std::int64_t, std::uint8_t>> waiting_;
};

/// Two ends, a line, and a clock.
class Link {
public:
    std::mt19937 random;
    Wire down{random}, up{random}; ///< to the board, to the outside
    LineEnd outside{}, board{};
    std::map<std::uint32_t, Session> sessions;
    std::vector<LineWelcome> welcomes;
    std::vector<std::string> shouts;
    std::uint32_t session = 0, greetings = 0;
    std::int64_t now = 0; ///< [ms]
    std::uint32_t baud = 115200;
    bool goes_on = true; ///< the outside greets a board that has started anew

    explicit Link(std::uint32_t seed) : random(seed) {}

    void greet()
    {
        session = static_cast<std::uint32_t>(random()) | 1u;
        const LineHello hello{0, session, LINE_RECORDS, baud, 77};
        line_greet(&outside, &hello, take_outside, this, now * ms);
    }
    void start_board()
    {
        LineWelcome welcome{};
        welcome.starts = static_cast<std::uint32_t>(random());
        welcome.hash = 88;
        std::strcpy(welcome.target, "test");
        line_await(&board, &welcome, take_board, this, now * ms);
    }
    /// Of the session that an end is in.
    static std::uint32_t name_of(const LineEnd &e) { return e.session ^ e.welcome.boot; }
    /// A millisecond.
    void step()
    {
        now++;
        const std::size_t most = baud >= 10000 ? baud / 10000 : now % (10000 / baud) == 0 ? 1 : 0; // [bytes]
        const Bytes to_board = down.come(now, most), to_outside = up.come(now, most);
        line_input(&board, to_board.data(), to_board.size(), now * ms);
        line_input(&outside, to_outside.data(), to_outside.size(), now * ms);
        if (must_greet) {
            must_greet = false;
            greet();
        }
        down.at(now);
        up.at(now);
        drain(outside, down);
        drain(board, up);
    }
    bool put(bool by_board, const Passed &m)
    {
        LineEnd &e = by_board ? board : outside;
        if (line_put(&e, m.kind, m.flags, m.tick, m.bytes.data(), m.bytes.size()) == 0) {
            return false;
        }
        sessions[name_of(e)].put[by_board].push_back(m);
        return true;
    }
    Passed any(bool by_board)
    {
        static constexpr std::array kinds{LINE_WORDS, LINE_RECORD, LINE_TEXT, LINE_END};
        Passed m{by_board ? kinds[random() % 4] : LINE_WORDS, static_cast<std::uint32_t>(random() % 2),
                 static_cast<std::uint32_t>(random()), Bytes(random() % 3 == 0 ? random() % 513 : random() % 40)};
        for (auto &byte : m.bytes) { // many bytes that look like the beginning of a frame
            byte = static_cast<std::uint8_t>(random() % 4 == 0 ? (random() % 2 != 0 ? 0xF1 : 0xED) : random());
        }
        return m;
    }
    bool is_flushed() const
    {
        return line_is_open(&outside) != 0 && line_is_open(&board) != 0 && name_of(outside) == name_of(board) &&
               line_is_flushed(&outside) != 0 && line_is_flushed(&board) != 0;
    }
    void heal()
    {
        for (Wire *wire : {&down, &up}) {
            wire->flipped = wire->lost = wire->twice = wire->added = 0;
            wire->cut = false;
        }
    }
    /// What was taken is a prefix of what was put, in all sessions.
    void check() const
    {
        for (const auto &[name, s] : sessions) {
            for (int by_board = 0; by_board < 2; by_board++) {
                const auto &sent = s.put[by_board], &taken = s.taken[1 - by_board];
                ASSERT_LE(taken.size(), sent.size());
                ASSERT_TRUE(std::equal(taken.begin(), taken.end(), sent.begin()));
            }
        }
    }
    void check_whole()
    {
        const Session &s = sessions[name_of(outside)];
        EXPECT_EQ(s.put[0].size(), s.taken[1].size());
        EXPECT_EQ(s.put[1].size(), s.taken[0].size());
    }
    bool must_greet = false;

private:
    /// All that an end sends now. Before line_wake tells so, it has nothing more.
    void drain(LineEnd &e, Wire &wire)
    {
        std::size_t n = 0;
        for (const std::uint8_t *frame; (frame = line_output(&e, now * ms, &n)) != nullptr;) {
            ASSERT_LE(n, std::size_t{LINE_FRAME});
            wire.send(frame, n);
        }
        if (now % 8 != 0) { // a copy takes time
            return;
        }
        LineEnd later = e;
        later.take = [](void *, const LineMessage *) {};
        const std::int64_t wake = line_wake(&e, now * ms);
        ASSERT_GT(wake, 0);
        ASSERT_EQ(line_output(&later, now * ms + wake - 1, &n), nullptr);
    }
    static void take(Link *link, bool is_board, const LineMessage *m)
    {
        link->sessions[name_of(is_board ? link->board : link->outside)].taken[is_board].push_back(
            {m->kind, m->flags & LINE_LAST, m->tick, Bytes(m->bytes, m->bytes + m->n)});
    }
    static void take_outside(void *user, const LineMessage *m)
    {
        auto *link = static_cast<Link *>(user);
        if (m->kind == LINE_WELCOME) {
            link->welcomes.push_back(m->welcome);
            link->must_greet |=
                link->goes_on && (m->welcome.session == 0 || m->welcome.boot != link->outside.welcome.boot);
        } else if (m->kind == LINE_SHOUT) {
            link->shouts.emplace_back(reinterpret_cast<const char *>(m->bytes), m->n);
        } else {
            take(link, false, m);
        }
    }
    static void take_board(void *user, const LineMessage *m)
    {
        auto *link = static_cast<Link *>(user);
        if (m->kind == LINE_HELLO) {
            link->greetings++;
            if (link->board.welcome.boot == 0) {
                link->board.welcome.boot = static_cast<std::uint32_t>(link->random()) | 1u;
            }
        } else {
            take(link, true, m);
        }
    }
};

void run_until(Link &link, const std::function<bool()> &what, int most = 20000)
{
    for (int i = 0; i < most && !what(); i++) {
        link.step();
        if (testing::Test::HasFatalFailure()) {
            return;
        }
    }
    ASSERT_TRUE(what());
}

TEST(Line, AFrameIsAsTheHeaderDrawsIt)
{
    LineEnd e{};
    const LineHello hello{0, 0x11223344, LINE_GO_ON, 115200, 0x0102030405060708};
    line_greet(
        &e, &hello, [](void *, const LineMessage *) {}, nullptr, 0);
    std::size_t n = 0;
    const std::uint8_t *p = line_output(&e, 0, &n);
    ASSERT_NE(p, nullptr);
    const Bytes expected{0xF1,
                         0xED,
                         24,
                         0,
                         LINE_HELLO,
                         0,
                         0,
                         0,
                         0,
                         0,
                         0x44,
                         0x33,
                         0x22,
                         0x11,
                         0,
                         0,
                         0,
                         0,
                         LINE_VERSION,
                         0,
                         0,
                         0,
                         0x44,
                         0x33,
                         0x22,
                         0x11,
                         LINE_GO_ON,
                         0,
                         0,
                         0,
                         0x00,
                         0xC2,
                         1,
                         0,
                         8,
                         7,
                         6,
                         5,
                         4,
                         3,
                         2,
                         1};
    ASSERT_EQ(n, expected.size() + 4);
    EXPECT_EQ(Bytes(p, p + n - 4), expected);
    const std::uint32_t crc = crc_of(p, n - 4);
    for (std::size_t i = 0; i < 4; i++) {
        EXPECT_EQ(p[n - 4 + i], static_cast<std::uint8_t>(crc >> 8 * i));
    }
}

TEST(Line, EitherEndStartsFirst)
{
    for (const int first : {0, 1, 500}) {
        Link link(1);
        first == 0 ? link.start_board() : link.greet();
        if (first == 0) { // what the board says before it is greeted is no answer to a greeting
            const LineHello none{0, 5, 0, 0, 0};
            line_greet(
                &link.outside, &none, [](void *, const LineMessage *) {}, nullptr, 0);
            link.greet();
        } else {
            std::size_t n = 0;
            for (int i = 0; i < first; i++) { // no program hears it
                link.now++;
                while (line_output(&link.outside, link.now * ms, &n) != nullptr) {
                }
            }
            link.start_board();
        }
        run_until(
            link, [&] { return link.is_flushed(); }, 250);
        EXPECT_EQ(link.greetings, 1u);
        EXPECT_EQ(link.outside.welcome.hash, 88u);
        EXPECT_STREQ(link.outside.welcome.target, "test");
        EXPECT_EQ(link.board.hello.hash, 77u);
        EXPECT_EQ(link.outside.welcome.boot, link.board.welcome.boot);
    }
}

TEST(Line, WhatAnEarlierRunLeftIsNoPartOfThisOne)
{
    Link link(2);
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    const Passed stale = link.any(true);
    ASSERT_TRUE(link.put(true, stale));
    ASSERT_TRUE(link.put(false, link.any(false)));
    link.step(); // frames are on their way, whole or in part, when both start anew
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    EXPECT_TRUE(link.sessions[Link::name_of(link.outside)].taken[0].empty());
    EXPECT_TRUE(link.sessions[Link::name_of(link.outside)].taken[1].empty());
    const std::uint32_t past = link.session;
    link.greet(); // the outside was started again
    run_until(link, [&] { return link.is_flushed(); });
    const std::uint32_t greetings = link.greetings;
    LineEnd old{}; // a greeting of the past session that comes late
    const LineHello hello{0, past, 0, 0, 0};
    line_greet(
        &old, &hello, [](void *, const LineMessage *) {}, nullptr, 0);
    std::size_t n = 0;
    const std::uint8_t *frame = line_output(&old, 0, &n);
    line_input(&link.board, frame, n, link.now * ms);
    EXPECT_EQ(link.greetings, greetings);
}

TEST(Line, AResetOfTheBoardIsReportedWithinAThirdOfASecond)
{
    for (const bool lost : {false, true}) {
        Link link(3);
        link.goes_on = false;
        link.start_board();
        link.greet();
        run_until(link, [&] { return link.is_flushed(); });
        ASSERT_EQ(link.welcomes.size(), 1u);
        link.start_board();
        link.up.cut = lost; // what it says at its start is lost: the outside asks
        link.step();
        link.up.cut = false;
        run_until(
            link, [&] { return link.welcomes.size() == 2; }, 400);
        EXPECT_EQ(link.welcomes.back().session, 0u);
    }
}

TEST(Line, ADamagedLengthDoesNotStall)
{
    Link link(4);
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    for (int i = 0; i < 3; i++) {
        ASSERT_TRUE(link.put(false, {LINE_WORDS, 0, 0, Bytes(20, 7)}));
    }
    std::size_t n = 0;
    const std::uint8_t *frame = line_output(&link.outside, link.now * ms, &n);
    Bytes bytes(frame, frame + n);
    bytes[3] ^= 1; // 276 bytes
    line_input(&link.board, bytes.data(), bytes.size(), link.now * ms);
    run_until(
        link, [&] { return link.is_flushed(); }, 200);
    link.check();
    link.check_whole();
    EXPECT_GT(link.board.counts.damaged, 0u);
}

TEST(Line, AFrameCutInTwoBySilenceIsSentAgain)
{
    Link link(5);
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    ASSERT_TRUE(link.put(true, {LINE_WORDS, LINE_LAST, 9, Bytes(300, 0xF1)}));
    std::size_t n = 0;
    const std::uint8_t *frame = line_output(&link.board, link.now * ms, &n);
    line_input(&link.outside, frame, n / 2, link.now * ms);
    run_until(
        link, [&] { return link.is_flushed(); }, 400);
    link.check_whole();
}

TEST(Line, BytesThatWaitForOthersAreNoneLost)
{
    for (const std::size_t held : {1u, 3u, 25u, 200u}) {
        Link link(6);
        link.down.held = link.up.held = held;
        link.start_board();
        link.greet();
        for (int i = 0; i < 50; i++) {
            run_until(link, [&] { return line_is_open(&link.outside) != 0 && line_is_flushed(&link.outside) != 0; });
            link.put(i % 2 != 0, {LINE_WORDS, LINE_LAST, 9, Bytes(100, 7)});
        }
        run_until(link, [&] { return link.is_flushed(); });
        link.check();
        link.check_whole();
    }
}

TEST(Line, ShoutsComeOnceEachInOrOutOfASession)
{
    Link link(6);
    link.start_board();
    link.greet();
    std::array<std::uint8_t, LINE_FRAME> frame;
    for (std::uint32_t number = 1; number <= 2; number++) {
        const std::size_t n = line_shout(&link.board, "fault", 5, number, frame.data());
        for (int i = 0; i < 3; i++) {
            link.up.send(frame.data(), n);
        }
    }
    run_until(link, [&] { return link.is_flushed(); });
    EXPECT_EQ(link.shouts, (std::vector<std::string>{"fault", "fault"}));
    const Bytes longer(LINE_PAYLOAD + 100, 'x');
    EXPECT_EQ(line_shout(&link.board, reinterpret_cast<const char *>(longer.data()), longer.size(), 3, frame.data()),
              std::size_t{LINE_FRAME});
}

TEST(Line, ARecordUsesTheLineWell)
{
    Link link(7);
    link.up.latency = link.down.latency = 8; // of an adapter
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    const std::int64_t begin = link.now;
    for (int sent = 0; sent < 100;) {
        sent += link.put(true, {LINE_RECORD, 0, 0, Bytes(LINE_PAYLOAD, 1)}) ? 1 : 0;
        if (line_room(&link.board) == 0) {
            link.step();
        }
    }
    run_until(link, [&] { return link.is_flushed(); });
    const double best = 100.0 * int{LINE_PAYLOAD} * 10 / 115200 * 1000; // [ms]
    EXPECT_LT(static_cast<double>(link.now - begin), 1.15 * best);
    EXPECT_EQ(link.board.counts.resent, 0u);
}

TEST(Line, ASlowLineIsGivenItsTime)
{
    Link link(11);
    link.baud = 1200; // a frame takes 4 s
    link.start_board();
    link.greet();
    run_until(link, [&] { return link.is_flushed(); });
    for (int i = 0; i < LINE_WINDOW; i++) {
        ASSERT_TRUE(link.put(true, {LINE_RECORD, 0, 0, Bytes(LINE_PAYLOAD, 1)}));
    }
    run_until(
        link, [&] { return link.is_flushed(); }, 60000);
    EXPECT_EQ(link.board.counts.resent, 0u);
    link.check_whole();
}

/// Runs with any faults: what is taken is a prefix of what was put, and all of it once the line is whole.
TEST(Line, NothingIsLostAddedOrChanged)
{
    const std::uint32_t cases = number_of("FLEDGE_CASES", 1000), seed = number_of("FLEDGE_SEED", 1);
    std::uint64_t resent = 0, damaged = 0, resets = 0, taken = 0;
    for (std::uint32_t i = 0; i < cases; i++) {
        SCOPED_TRACE("FLEDGE_SEED=" + std::to_string(seed + i));
        Link link(seed + i);
        const auto any = [&](std::uint32_t n) { return static_cast<std::uint32_t>(link.random() % n); };
        link.baud = std::array{9600u, 115200u, 921600u}[any(3)];
        for (Wire *wire : {&link.down, &link.up}) {
            wire->latency = static_cast<int>(any(4) == 0 ? any(20) : 0);
            wire->held = any(4) == 0 ? any(30) : 0;
            wire->flipped = std::array{0.0, 1e-5, 1e-4}[any(3)];
            wire->lost = std::array{0.0, 1e-4, 1e-3}[any(3)];
            wire->twice = std::array{0.0, 1e-4}[any(2)];
            wire->added = std::array{0.0, 1e-4, 1e-3}[any(3)];
        }
        any(2) == 0 ? link.start_board() : link.greet();
        for (std::uint32_t k = any(200); k > 0; k--) {
            link.outside.take != nullptr ? link.step() : void(link.now++);
            if (link.board.take == nullptr && any(20) == 0) {
                link.start_board();
            }
        }
        if (link.board.take == nullptr) {
            link.start_board();
        }
        if (link.outside.take == nullptr) {
            link.greet();
        }
        const std::uint32_t rate = 1 + any(40);
        for (int k = 0; k < 400; k++) {
            link.step();
            for (const bool by_board : {false, true}) {
                if (any(rate) == 0) {
                    link.put(by_board, link.any(by_board));
                }
            }
            if (any(200) == 0) {
                link.down.cut = any(2) == 0;
                link.up.cut = any(2) == 0;
            }
            if (any(700) == 0) {
                resets++;
                link.start_board();
            }
            if (any(2000) == 0) {
                link.greet();
            }
        }
        link.heal();
        run_until(link, [&] { return link.is_flushed(); });
        link.check();
        link.check_whole();
        if (HasFailure()) {
            return;
        }
        resent += link.outside.counts.resent + link.board.counts.resent;
        damaged += link.outside.counts.damaged + link.board.counts.damaged;
        for (const auto &[name, s] : link.sessions) {
            taken += s.taken[0].size() + s.taken[1].size();
        }
    }
    EXPECT_GT(resent, cases / 10);
    EXPECT_GT(damaged, cases / 10);
    EXPECT_GT(resets, cases / 10);
    EXPECT_GT(taken, cases);
}

/// Bytes that no end sends so, to ends in any state. The sanitizers see what goes wrong.
TEST(Line, FuzzAnyBytes)
{
    const std::uint32_t cases = number_of("FLEDGE_CASES", 2000);
    Link link(number_of("FLEDGE_SEED", 1));
    const auto any = [&](std::size_t n) { return static_cast<std::uint32_t>(link.random() % n); };
    std::deque<Bytes> earlier;
    link.start_board();
    link.greet();
    for (std::uint32_t i = 0; i < cases; i++) {
        LineEnd &e = any(2) == 0 ? link.outside : link.board;
        Bytes bytes(any(700));
        std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<std::uint8_t>(link.random()); });
        if (!earlier.empty() && any(4) != 0) {
            bytes = earlier[any(earlier.size())];
            for (std::uint32_t k = any(3); k > 0; k--) {
                bytes[any(any(2) == 0 ? std::min<std::size_t>(bytes.size(), 18) : bytes.size())] =
                    static_cast<std::uint8_t>(link.random());
            }
            const std::size_t n = bytes.size() - 4;
            const std::uint32_t crc = crc_of(bytes.data(), n);
            for (std::size_t k = 0; k < 4 && any(4) != 0; k++) { // a check that holds again
                bytes[n + k] = static_cast<std::uint8_t>(crc >> 8 * k);
            }
        }
        link.now += any(120);
        line_input(&e, bytes.data(), bytes.size(), link.now * ms);
        if (any(3) == 0) {
            link.put(&e == &link.board, link.any(&e == &link.board));
        }
        std::size_t n = 0;
        for (const std::uint8_t *frame; (frame = line_output(&e, link.now * ms, &n)) != nullptr;) {
            earlier.emplace_back(frame, frame + n);
        }
        while (earlier.size() > 50) {
            earlier.pop_front();
        }
        if (any(100) == 0) {
            any(2) == 0 ? link.start_board() : link.greet();
        }
    }
    EXPECT_GT(link.board.counts.frames_taken, cases / 20);
}

// ---- the mirror

/// The memory of some boards, and its mirror.
struct Memory {
    std::vector<RegisterBoard> boards;
    std::vector<std::vector<std::uint64_t>> memory;
    std::vector<RegisterWindow> windows;
    Bytes shadow;
    LineMirror mirror{};

    explicit Memory(const std::vector<std::uint32_t> &sizes)
    {
        std::vector<const RegisterBoard *> pointers;
        boards.resize(sizes.size());
        for (std::size_t i = 0; i < sizes.size(); i++) {
            boards[i].size = sizes[i];
            memory.emplace_back((sizes[i] + 7) / 8);
            pointers.push_back(&boards[i]);
        }
        for (std::size_t i = 0; i < sizes.size(); i++) {
            windows.push_back(
                register_window(&boards[i], reinterpret_cast<volatile std::uint32_t *>(memory[i].data())));
        }
        shadow.resize(line_mirror_size(pointers.data(), static_cast<std::uint32_t>(pointers.size())));
        line_mirror_begin(&mirror, windows.data(), static_cast<std::uint32_t>(windows.size()), shadow.data());
    }
};

TEST(LineMirror, BothEndsHaveTheSameMemoryAfterEachExchange)
{
    std::mt19937 random(number_of("FLEDGE_SEED", 1));
    for (int run = 0; run < 100; run++) {
        std::vector<std::uint32_t> sizes;
        for (std::size_t i = 1 + random() % 4; i > 0; i--) {
            sizes.push_back(4 * (1 + random() % (random() % 10 == 0 ? 100000 : 700)));
        }
        Memory a(sizes), b(sizes);
        for (int exchange = 0; exchange < 20; exchange++) {
            Memory &from = exchange % 2 == 0 ? a : b, &to = exchange % 2 == 0 ? b : a;
            std::uint32_t changes = random() % 3 == 0 ? 0 : random() % 400;
            for (std::uint32_t k = changes; k > 0; k--) {
                auto &board = from.windows[random() % from.windows.size()];
                board.words[random() % (board.board->size / 4)] = static_cast<std::uint32_t>(random());
            }
            int last = 0;
            std::size_t bytes = 0;
            while (last == 0) {
                std::array<std::uint8_t, LINE_PAYLOAD> payload;
                const std::uint32_t n = line_mirror_take(&from.mirror, payload.data(), &last);
                ASSERT_LE(n, payload.size());
                ASSERT_EQ(line_mirror_put(&to.mirror, payload.data(), n), 1);
                bytes += n;
            }
            EXPECT_LE(bytes, 8 * changes);
            line_mirror_finish(&to.mirror);
            ASSERT_EQ(a.memory, b.memory);
            ASSERT_EQ(a.shadow, b.shadow);
        }
    }
}

TEST(LineMirror, RefusesWhatIsOfNoBoard)
{
    Memory m({16, 8});
    const Bytes good{2, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8};
    EXPECT_EQ(line_mirror_put(&m.mirror, good.data(), 12), 1);
    const Bytes before = m.shadow;
    for (const Bytes &bad : std::vector<Bytes>{{2, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7},    // short
                                               {0, 0, 0, 0},                         // no word
                                               {1, 2, 0, 0, 1, 2, 3, 4},             // no such board
                                               {1, 1, 2, 0, 1, 2, 3, 4},             // behind it
                                               {2, 1, 1, 0, 1, 2, 3, 4, 5, 6, 7, 8}, // in part
                                               {1, 1, 0xFF, 0xFF, 1, 2, 3, 4},       //
                                               {1, 0, 0, 0, 9, 9, 9, 9, 1, 0, 0}}) { // a half run behind a good one
        EXPECT_EQ(line_mirror_put(&m.mirror, bad.data(), static_cast<std::uint32_t>(bad.size())), 0);
        EXPECT_EQ(m.shadow, before);
    }
}

/// Any bytes as runs: they are refused as a whole, or they are in the shadow.
TEST(LineMirror, FuzzAnyRuns)
{
    std::mt19937 random(number_of("FLEDGE_SEED", 1));
    std::uint32_t taken = 0;
    for (std::uint32_t i = number_of("FLEDGE_CASES", 2000); i > 0; i--) {
        Memory m({40, 12, 4});
        Bytes payload(random() % 60);
        for (auto &byte : payload) {
            byte = static_cast<std::uint8_t>(random() % 8 == 0 ? random() : random() % 3);
        }
        const Bytes exact = payload; // of its own size, for the sanitizers
        const Bytes before = m.shadow;
        if (line_mirror_put(&m.mirror, exact.data(), static_cast<std::uint32_t>(exact.size())) == 0) {
            ASSERT_EQ(m.shadow, before);
            continue;
        }
        taken++;
        line_mirror_finish(&m.mirror);
        int last = 0;
        std::array<std::uint8_t, LINE_PAYLOAD> rest;
        ASSERT_EQ(line_mirror_take(&m.mirror, rest.data(), &last), 0u);
        ASSERT_EQ(last, 1);
    }
    EXPECT_GT(taken, 0u);
}

TEST(LineMirror, RefusesBoardsThatItsRunsCannotName)
{
    RegisterBoard board{};
    board.size = 4 * LINE_BOARD;
    const RegisterBoard *pointer = &board;
    EXPECT_EQ(line_mirror_size(&pointer, 1), std::size_t{4} * LINE_BOARD);
    board.size += 4;
    EXPECT_EQ(line_mirror_size(&pointer, 1), 0u);
    board.size = 4;
    const std::vector<const RegisterBoard *> many(LINE_BOARDS + 1, &board);
    EXPECT_EQ(line_mirror_size(many.data(), LINE_BOARDS + 1), 0u);
    EXPECT_EQ(line_mirror_size(many.data(), LINE_BOARDS), 4u * LINE_BOARDS);
}

} // namespace line_test
