// SPDX-License-Identifier: Apache-2.0
// Every kind of lane against a plain model, by random writings and readings; what lies in memory,
// byte for byte; a reader stopped at any step; and what a damaged memory does.
#include "registers/lane.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "registers/testing/board.h"

namespace lane_test {

using namespace fledge::registers::testing;
using Bytes = std::vector<unsigned char>;

struct Kind {
    std::uint32_t flags;
    std::uint32_t capacity;
    std::uint32_t depth;
    bool described;
    bool big_endian;
};

std::vector<Kind> packet_kinds()
{
    std::vector<Kind> kinds;
    for (std::uint32_t flags = 0; flags < 16; flags += 2) {
        if ((flags & OVERWRITE) && !(flags & QUEUED)) {
            continue;
        }
        for (std::uint32_t capacity : {1u, 7u, 8u, 61u}) {
            for (std::uint32_t depth : {1u, 2u, 8u}) {
                for (int i = 0; i < 4; i++) {
                    kinds.push_back({flags, capacity, depth, (i & 1) != 0, (i & 2) != 0});
                }
            }
        }
    }
    return kinds;
}

struct Sent {
    Bytes bytes;
    std::uint32_t tag;
    std::uint32_t sequence;
};

// What a lane promises, in the plainest words.
class Model {
public:
    explicit Model(const Kind &kind) : kind_(kind) {}

    RegisterStatus put(const Bytes &bytes, std::uint32_t tag)
    {
        const bool variable = kind_.flags & VARIABLE;
        if (bytes.size() > kind_.capacity || (!variable && bytes.size() != kind_.capacity)) {
            return REGISTER_SIZE;
        }
        if (!(kind_.flags & QUEUED)) {
            sent_.assign(1, {bytes, tag, ++written_});
            fresh_ = true;
            return REGISTER_OK;
        }
        if (sent_.size() == kind_.depth) {
            lost_++;
            if (!(kind_.flags & OVERWRITE)) {
                return REGISTER_FULL;
            }
            sent_.pop_front();
        }
        sent_.push_back({bytes, tag, ++written_});
        return REGISTER_OK;
    }

    RegisterStatus take(std::size_t room, Sent *got)
    {
        if (sent_.empty()) {
            return REGISTER_EMPTY;
        }
        *got = sent_.front();
        if (got->bytes.size() > room) {
            return REGISTER_SIZE;
        }
        if (kind_.flags & QUEUED) {
            sent_.pop_front();
            return REGISTER_OK;
        }
        return std::exchange(fresh_, false) ? REGISTER_OK : REGISTER_SAME;
    }

    std::uint32_t waiting() const { return kind_.flags & QUEUED ? static_cast<std::uint32_t>(sent_.size()) : fresh_; }
    std::uint32_t lost() const { return lost_; }

private:
    Kind kind_;
    std::deque<Sent> sent_;
    std::uint32_t written_ = 0;
    std::uint32_t lost_ = 0;
    bool fresh_ = false;
};

TEST(Lane, AnyPacketKindDoesWhatThePlainModelDoes)
{
    std::mt19937 random(5);
    for (const Kind &kind : packet_kinds()) {
        Shape shape{REGISTER_PACKET, kind.flags, kind.capacity, kind.depth, kind.described};
        Bench bench({shape, shape}, kind.big_endian); // the second one must stay untouched
        const RegisterWindow *w = bench.window();
        Model model(kind);
        const bool variable = kind.flags & VARIABLE;
        for (int step = 0; step < 200; step++) {
            if (random() % 2) {
                const std::size_t n = variable ? random() % (kind.capacity + 1) : kind.capacity + (random() % 8 == 0);
                Bytes bytes(n);
                std::generate(bytes.begin(), bytes.end(), [&] { return random() & 0xff; });
                const std::uint32_t tag = random() % 128;
                const RegisterStatus status = model.put(bytes, tag);
                ASSERT_EQ(register_put(w, bench.lane(), bytes.data(), n, tag), status);
            } else {
                const std::uint32_t room = random() % 8 ? kind.capacity : random() % kind.capacity;
                Bytes bytes(room + 1, 0xA5);
                RegisterInfo info;
                Sent expected;
                const RegisterStatus status = model.take(room, &expected);
                ASSERT_EQ(register_take(w, bench.lane(), bytes.data(), room, &info), status);
                ASSERT_EQ(bytes[room], 0xA5);
                if (status == REGISTER_OK || status == REGISTER_SAME) {
                    ASSERT_EQ(info.n, expected.bytes.size());
                    ASSERT_EQ(info.tag, expected.tag);
                    ASSERT_EQ(info.sequence, expected.sequence);
                    ASSERT_TRUE(std::equal(expected.bytes.begin(), expected.bytes.end(), bytes.begin()));
                } else if (status == REGISTER_SIZE) {
                    ASSERT_EQ(info.n, expected.bytes.size());
                }
            }
            ASSERT_EQ(register_waiting(w, bench.lane()), model.waiting());
        }
        // An overwriting queue finds its losses when it is read.
        Bytes bytes(kind.capacity);
        RegisterInfo info;
        Sent expected;
        register_take(w, bench.lane(), bytes.data(), kind.capacity, &info);
        model.take(kind.capacity, &expected);
        EXPECT_EQ(register_lost(w, bench.lane()), model.lost());
        const unsigned char *other = bench.bytes() + bench.lane(1)->address;
        EXPECT_TRUE(
            std::all_of(other, bench.bytes() + bench.board().size, [](unsigned char byte) { return byte == 0; }));
    }
}

TEST(Lane, WordsAndQueuesOfWordsDoWhatThePlainModelDoes)
{
    std::mt19937 random(6);
    for (bool big_endian : {false, true}) {
        for (std::uint32_t flags : {PLAIN, QUEUED, QUEUED | OVERWRITE}) {
            for (std::uint32_t depth : {1u, 4u}) {
                Bench bench({{REGISTER_WORD, flags, 4, depth, false, flags ? 1u : 3u}}, big_endian);
                const RegisterWindow *w = bench.window();
                std::deque<std::uint32_t> queue;
                std::uint32_t plain[3] = {};
                for (int step = 0; step < 300; step++) {
                    const std::uint32_t index = flags ? 0 : random() % 3;
                    std::uint32_t value = random();
                    if (random() % 2) {
                        const RegisterStatus status = register_put_word(w, bench.lane(), index, value);
                        const bool full = flags && queue.size() == depth;
                        const bool refused = full && !(flags & OVERWRITE);
                        ASSERT_EQ(status, refused ? REGISTER_FULL : REGISTER_OK);
                        if (full && !refused) {
                            queue.pop_front();
                        }
                        if (!refused) {
                            queue.push_back(value);
                            plain[index] = value;
                        }
                    } else {
                        const RegisterStatus status = register_take_word(w, bench.lane(), index, &value);
                        if (!flags) {
                            ASSERT_EQ(status, REGISTER_OK);
                            ASSERT_EQ(value, plain[index]);
                        } else if (queue.empty()) {
                            ASSERT_EQ(status, REGISTER_EMPTY);
                        } else {
                            ASSERT_EQ(status, REGISTER_OK);
                            ASSERT_EQ(value, queue.front());
                            queue.pop_front();
                        }
                    }
                }
                EXPECT_EQ(register_put_word(w, bench.lane(), flags ? 1 : 3, 0), REGISTER_SIZE);
            }
        }
    }
}

TEST(Lane, CountersMayWrapAround)
{
    for (std::uint32_t overwrite : {PLAIN, OVERWRITE}) {
        Bench bench({{REGISTER_PACKET, QUEUED | overwrite, 4, 4, true}}, false);
        const RegisterWindow *w = bench.window();
        const std::uint32_t at = bench.lane()->address;
        for (std::uint32_t counter : {REGISTER_WRITTEN, REGISTER_TAKEN, REGISTER_BEGUN}) {
            register_store(w, at + counter, UINT32_MAX - 5);
        }
        for (std::uint32_t i = 0; i < 20; i++) {
            const std::uint32_t pair[2] = {2 * i, 2 * i + 1};
            for (const std::uint32_t &v : pair) {
                ASSERT_EQ(register_put(w, bench.lane(), &v, 4, 0), REGISTER_OK);
            }
            for (const std::uint32_t &v : pair) {
                std::uint32_t got = 0;
                RegisterInfo info;
                ASSERT_EQ(register_take(w, bench.lane(), &got, 4, &info), REGISTER_OK);
                ASSERT_EQ(got, v);
            }
        }
        EXPECT_EQ(register_lost(w, bench.lane()), 0u);
    }
}

TEST(Lane, TheSequenceOfTheLastPacketWrapsPastZero)
{
    Bench bench({{REGISTER_PACKET, PLAIN, 4, 1}}, false);
    register_store(bench.window(), bench.lane()->address + REGISTER_WRITTEN, UINT32_MAX - 2);
    for (std::uint32_t sequence : {UINT32_MAX - 1, UINT32_MAX, 1u, 2u}) {
        std::uint32_t got = 0;
        RegisterInfo info;
        register_put(bench.window(), bench.lane(), &sequence, 4, 0);
        EXPECT_EQ(register_take(bench.window(), bench.lane(), &got, 4, &info), REGISTER_OK);
        EXPECT_EQ(got, sequence);
        EXPECT_EQ(info.sequence, sequence);
    }
}

TEST(Lane, TheWriterTakesTheSlotsOfAPairInTurn)
{
    for (const std::uint32_t reading : {0u, 1u}) {
        Bench bench({{REGISTER_PACKET, PLAIN, 4, 1}}, false);
        const RegisterWindow *w = bench.window();
        const RegisterLane *lane = bench.lane();
        register_store(w, lane->address + REGISTER_READING, reading);
        for (std::uint32_t number = 1; number < 8; number++) {
            register_put(w, lane, &number, 4, 0);
            EXPECT_EQ(register_load(w, lane->address + REGISTER_LATEST), 1 - reading);
            const std::uint32_t last = register_load(w, lane->address + REGISTER_SLOTS + 4 * (1 - reading));
            for (const std::uint32_t back : {0u, 1u}) { // the message before is still there
                const std::uint32_t slot = 2 * (1 - reading) + (last ^ back);
                std::uint32_t there = 0;
                std::memcpy(&there,
                            bench.bytes() + lane->address + REGISTER_CONTROL_SIZE + slot * lane->stride +
                                REGISTER_SLOT_HEAD,
                            4);
                EXPECT_EQ(there, number - back);
            }
        }
    }
}

TEST(Lane, AWriterSaysThatItBeginsBeforeItWrites)
{
    Bench bench({{REGISTER_PACKET, QUEUED | OVERWRITE, 4, 2, true}}, false);
    const std::uint32_t at = bench.lane()->address;
    for (std::uint32_t number = 1; number < 6; number++) {
        register_put(bench.window(), bench.lane(), &number, 4, 0);
        EXPECT_EQ(register_load(bench.window(), at + REGISTER_BEGUN), number);
        EXPECT_EQ(register_load(bench.window(), at + REGISTER_WRITTEN), number);
    }
}

TEST(Lane, OfPlainWordsNoneWaitsAndNoneIsLost)
{
    Bench bench({{REGISTER_WORD, PLAIN, 4, 1, false, 16}}, false);
    for (std::uint32_t i = 0; i < 16; i++) {
        EXPECT_EQ(register_put_word(bench.window(), bench.lane(), i, 5 + i), REGISTER_OK);
    }
    for (std::uint32_t i = 0; i < 16; i++) { // each at its own place
        std::uint32_t there = 0;
        std::memcpy(&there, bench.bytes() + bench.lane()->address + 4 * i, 4);
        EXPECT_EQ(there, 5 + i);
    }
    EXPECT_EQ(register_waiting(bench.window(), bench.lane()), 0u);
    EXPECT_EQ(register_lost(bench.window(), bench.lane()), 0u);
}

// The reader is stopped between any two of its steps, and the writer goes on: what the reader then
// copies is one whole packet, and no older than those that were there when it began.
TEST(Lane, TheWriterNeverTouchesTheSlotOfAReaderThatIsStopped)
{
    for (int before = 1; before <= 4; before++) {
        for (int taken = 0; taken <= 1; taken++) {
            for (int first = 0; first <= 5; first++) {
                for (int second = 0; second <= 5; second++) {
                    for (int third = 0; third <= 5; third++) {
                        Bench bench({{REGISTER_PACKET, PLAIN, 8, 1}}, true);
                        const RegisterWindow *w = bench.window();
                        const RegisterLane *lane = bench.lane();
                        std::uint64_t number = 0;
                        const auto write = [&](int n) {
                            for (int i = 0; i < n; i++) {
                                number++;
                                register_put(w, lane, &number, 8, 0);
                            }
                        };
                        write(before);
                        std::uint64_t got = 0;
                        RegisterInfo info;
                        if (taken) {
                            register_take(w, lane, &got, 8, &info);
                            ASSERT_EQ(register_load(w, lane->address + REGISTER_READING),
                                      register_load(w, lane->address + REGISTER_LATEST));
                            write(1);
                        }
                        const std::uint64_t oldest = number;
                        // The reader's steps, by hand, as take_latest in lane.c has them.
                        const std::uint32_t pair = register_load(w, lane->address + REGISTER_LATEST);
                        write(first);
                        register_store(w, lane->address + REGISTER_READING, pair);
                        write(second);
                        const std::uint32_t slot =
                            2 * pair + register_load(w, lane->address + REGISTER_SLOTS + 4 * pair);
                        const unsigned char *payload = bench.bytes() + lane->address + REGISTER_CONTROL_SIZE +
                                                       slot * lane->stride + REGISTER_SLOT_HEAD;
                        std::uint64_t early = 0, late = 0;
                        std::memcpy(&early, payload, 8);
                        write(third);
                        std::memcpy(&late, payload, 8);
                        ASSERT_EQ(early, late);
                        ASSERT_GE(early, oldest);
                    }
                }
            }
        }
    }
}

TEST(Lane, MemoryHoldsWordsInTheBoardsOrderAndPayloadAsItIs)
{
    const unsigned char payload[5] = {1, 2, 3, 4, 5};
    for (bool big : {false, true}) {
        Bench bench({{REGISTER_WORD}, {REGISTER_PACKET, VARIABLE | QUEUED, 8, 2, true}}, big);
        register_put_word(bench.window(), bench.lane(0), 0, 0x11223344);
        register_put(bench.window(), bench.lane(1), payload, 5, 0x55);
        const unsigned char *word = bench.bytes() + bench.lane(0)->address;
        const Bytes ordered = big ? Bytes{0x11, 0x22, 0x33, 0x44} : Bytes{0x44, 0x33, 0x22, 0x11};
        EXPECT_EQ(Bytes(word, word + 4), ordered);
        const unsigned char *described = bench.bytes() + bench.lane(1)->descriptors;
        const Bytes describing = big ? Bytes{0xD5, 0, 0, 5} : Bytes{5, 0, 0, 0xD5};
        EXPECT_EQ(Bytes(described, described + 4), describing);
        const unsigned char *slot = bench.bytes() + bench.lane(1)->address + REGISTER_CONTROL_SIZE;
        EXPECT_EQ(Bytes(slot + 8, slot + 16), (Bytes{1, 2, 3, 4, 5, 0, 0, 0}));
        // Taken, the describing word is no longer valid.
        unsigned char got[8];
        RegisterInfo info;
        EXPECT_EQ(register_take(bench.window(), bench.lane(1), got, 8, &info), REGISTER_OK);
        EXPECT_EQ(described[big ? 0 : 3], 0x55);
    }
}

TEST(Lane, ADamagedLengthIsSkippedAndCounted)
{
    Bench bench({{REGISTER_PACKET, VARIABLE | QUEUED, 8, 4, true}}, true);
    const RegisterWindow *w = bench.window();
    const std::uint64_t sent[2] = {1, 2};
    register_put(w, bench.lane(), &sent[0], 8, 0);
    register_put(w, bench.lane(), &sent[1], 8, 0);
    register_store(w, bench.lane()->descriptors, 0x80FFFFFF);
    std::uint64_t got = 0;
    RegisterInfo info;
    EXPECT_EQ(register_take(w, bench.lane(), &got, 8, &info), REGISTER_CORRUPT);
    EXPECT_EQ(got, 0u);
    EXPECT_EQ(register_lost(w, bench.lane()), 1u);
    EXPECT_EQ(register_take(w, bench.lane(), &got, 8, &info), REGISTER_OK);
    EXPECT_EQ(got, 2u);
}

TEST(Lane, NoDamagedLengthReachesBeyondTheSlotHoweverLargeTheBuffer)
{
    for (const std::uint32_t flags : {VARIABLE, VARIABLE | QUEUED, VARIABLE | QUEUED | OVERWRITE}) {
        for (const std::uint32_t capacity : {7u, 8u}) {
            Bench bench({{REGISTER_PACKET, flags, capacity, 4, true}}, true);
            const RegisterWindow *w = bench.window();
            const std::uint64_t sent = 1;
            for (std::uint32_t length = 1; length < 24; length++) {
                register_put(w, bench.lane(), &sent, capacity, 0);
                const std::uint32_t waiting = register_waiting(w, bench.lane());
                for (std::uint32_t slot = 0; slot < 4; slot++) { // any may be the next one
                    register_store(w, bench.lane()->descriptors + 4 * slot, 0x80000000u | length);
                }
                unsigned char got[32];
                std::fill(std::begin(got), std::end(got), 0xA5);
                RegisterInfo info;
                const bool good = length <= capacity;
                EXPECT_EQ(register_take(w, bench.lane(), got, sizeof got, &info),
                          good ? REGISTER_OK : REGISTER_CORRUPT);
                EXPECT_TRUE(std::all_of(got + (good ? length : 0), std::end(got), [](auto b) { return b == 0xA5; }));
                EXPECT_EQ(register_waiting(w, bench.lane()), flags & QUEUED || good ? waiting - 1 : waiting);
            }
        }
    }
}

TEST(Lane, AWriterThatAlwaysOvertakesEndsTheReadingAndIsCounted)
{
    Bench bench({{REGISTER_PACKET, QUEUED | OVERWRITE, 4, 16, false}}, false);
    const RegisterWindow *w = bench.window();
    for (std::uint32_t sent = 1; sent <= 16; sent++) {
        register_put(w, bench.lane(), &sent, 4, 0);
    }
    register_store(w, bench.lane()->address + REGISTER_BEGUN, 1000); // as if it had begun others at each reading
    std::uint32_t got = 0;
    RegisterInfo info;
    EXPECT_EQ(register_take(w, bench.lane(), &got, 4, &info), REGISTER_BUSY);
    EXPECT_EQ(register_lost(w, bench.lane()), 8u); // attempts
    EXPECT_EQ(register_waiting(w, bench.lane()), 8u);
    register_store(w, bench.lane()->address + REGISTER_BEGUN, 16);
    EXPECT_EQ(register_take(w, bench.lane(), &got, 4, &info), REGISTER_OK);
    EXPECT_EQ(got, 9u);
}

TEST(Lane, TwoPiecesFitTogetherOrNotAtAll)
{
    const unsigned char head[12] = {1, 2, 3, 4, 5, 6, 7, 8}, bytes[8] = {11, 12, 13, 14, 15, 16, 17, 18};
    for (const std::uint32_t flags : {VARIABLE | QUEUED, QUEUED}) {
        Bench bench({{REGISTER_PACKET, flags, 8, 2, true}}, true);
        for (std::uint32_t n_head = 0; n_head <= 12; n_head++) {
            for (std::uint32_t n = 0; n <= 8; n++) {
                const bool fits = n_head % 4 == 0 && (flags & VARIABLE ? n_head + n <= 8 : n_head + n == 8);
                ASSERT_EQ(register_put_two(bench.window(), bench.lane(), head, n_head, bytes, n, 0),
                          fits ? REGISTER_OK : REGISTER_SIZE)
                    << n_head << " and " << n;
                Bytes got(12, 0xA5), expected(head, head + n_head);
                expected.insert(expected.end(), bytes, bytes + n);
                RegisterInfo info;
                const RegisterStatus status = register_take(bench.window(), bench.lane(), got.data(), 12, &info);
                ASSERT_EQ(status, fits ? REGISTER_OK : REGISTER_EMPTY);
                if (fits) {
                    ASSERT_EQ(Bytes(got.begin(), got.begin() + info.n), expected);
                }
            }
        }
    }
}

TEST(Lane, NothingIsReadFromAPacketThatIsNotThere)
{
    for (const std::uint32_t flags : {PLAIN, QUEUED}) {
        Bench bench({{REGISTER_PACKET, flags, 4, 4, true}, {REGISTER_WORD}}, false);
        for (std::size_t lane : {0, 1}) { // empty, and no lane of packets
            RegisterInfo info{7, 7, 7};
            std::uint32_t got = 0;
            EXPECT_EQ(register_take(bench.window(), bench.lane(lane), &got, 4, &info),
                      lane ? REGISTER_SIZE : REGISTER_EMPTY);
            EXPECT_EQ(info.n + info.tag + info.sequence, 0u);
        }
    }
}

TEST(Lane, TheNextTagIsThatOfThePacketTakenNext)
{
    for (const std::uint32_t overwrite : {PLAIN, OVERWRITE}) {
        Bench bench({{REGISTER_PACKET, QUEUED | overwrite, 4, 4, true}}, false);
        const RegisterWindow *w = bench.window();
        std::uint32_t tag = 99;
        EXPECT_EQ(register_next_tag(w, bench.lane(), &tag), REGISTER_EMPTY);
        for (std::uint32_t sent = 1; sent <= 36; sent++) {
            register_put(w, bench.lane(), &sent, 4, sent);
            if (sent % 9 != 0) {
                continue; // nine writings: more than the queue holds
            }
            for (std::uint32_t left = 4; left > 0; left--) {
                const std::uint32_t expected = overwrite ? sent + 1 - left : sent - 4 - left;
                EXPECT_EQ(register_next_tag(w, bench.lane(), &tag), REGISTER_OK);
                EXPECT_EQ(tag, expected);
                std::uint32_t got = 0;
                RegisterInfo info;
                EXPECT_EQ(register_take(w, bench.lane(), &got, 4, &info), REGISTER_OK);
                EXPECT_EQ(got, expected);
                EXPECT_EQ(info.tag, expected);
            }
            EXPECT_EQ(register_next_tag(w, bench.lane(), &tag), REGISTER_EMPTY);
        }
        EXPECT_EQ(register_lost(w, bench.lane()), 4u * 5u);
    }
}

TEST(Lane, InterruptsAreCountedAndRing)
{
    Shape shape{REGISTER_PACKET, QUEUED, 4, 2};
    shape.interrupt = 3;
    Bench bench({shape}, true);
    std::vector<std::uint32_t> rung;
    bench.window()->user = &rung;
    bench.window()->ring = [](void *user, std::uint32_t line) {
        static_cast<std::vector<std::uint32_t> *>(user)->push_back(line);
    };
    const RegisterWindow *w = bench.window();
    const std::uint32_t v = 0;
    for (int i = 0; i < 3; i++) {
        register_put(w, bench.lane(), &v, 4, 0);
    }
    EXPECT_EQ(rung, (std::vector<std::uint32_t>{3, 3})); // the third writing was refused
    EXPECT_EQ(register_interrupts(w, 3), 2u);
    EXPECT_EQ(register_handle(w, 3), 2u);
    EXPECT_EQ(register_handle(w, 3), 0u);
    register_raise(w, 3);
    EXPECT_EQ(register_handle(w, 3), 1u);
    EXPECT_EQ(register_interrupts(w, 3), 0u);
    rung.pop_back();
    for (std::uint32_t line = 0; line < 8; line++) { // each counts for itself
        register_raise(w, line);
        rung.pop_back();
        EXPECT_EQ(register_interrupts(w, line), 1u);
        EXPECT_EQ(register_interrupts(w, (line + 1) % 8), line == 7 ? 1u : 0u);
    }
    register_raise(w, 8); // there are 8 lines
    EXPECT_EQ(register_interrupts(w, 8), 0u);
    EXPECT_EQ(rung.size(), 2u);
}

} // namespace lane_test
