// SPDX-License-Identifier: Apache-2.0
// The arena against a model: blocks that do not overlap, keep their bytes, and leave nothing behind.
#include "targets/micropython/arena.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

namespace arena_test {

struct Held {
    unsigned char *at;
    size_t n;
    unsigned char mark;
};

class ArenaTest : public testing::Test {
protected:
    static constexpr size_t head = 8;
    alignas(8) unsigned char memory[4096];
    Arena arena;

    void SetUp() override
    {
        std::memset(memory, 0xEE, sizeof memory); // memory that was used before
        arena_begin(&arena, memory, sizeof memory);
        arena_in_use = &arena;
    }

    void TearDown() override { arena_in_use = nullptr; }

    static size_t whole(size_t n) { return (n + head + 7) / 8 * 8; }

    static void check(const Held &held)
    {
        ASSERT_TRUE(std::all_of(held.at, held.at + held.n, [&](unsigned char c) { return c == held.mark; }));
    }

    unsigned char *take(size_t n) { return static_cast<unsigned char *>(arena_take(n)); }
};

TEST_F(ArenaTest, ABlockIsAlignedAndZeroedAlsoWhereAnotherWas)
{
    for (int round = 0; round < 2; round++) {
        auto *block = take(100);
        ASSERT_NE(block, nullptr);
        EXPECT_EQ(reinterpret_cast<uintptr_t>(block) % 8, 0u);
        EXPECT_TRUE(std::all_of(block, block + 100, [](unsigned char c) { return c == 0; }));
        std::memset(block, 0xFF, 100);
        arena_give(block);
    }
}

TEST_F(ArenaTest, RandomRequestsAgreeWithAModel)
{
    std::mt19937 random(1);
    std::vector<Held> blocks;
    size_t used = 0, peak = 0, refused = 0;
    for (int i = 0; i < 20000; i++) {
        const unsigned action = random() % 3;
        const size_t n = random() % 5 == 0 ? random() % 1500 : random() % 100;
        const auto mark = static_cast<unsigned char>(1 + random() % 255);
        if (action == 0 || blocks.empty()) {
            if (auto *at = take(n)) {
                ASSERT_TRUE(std::all_of(at, at + n, [](unsigned char c) { return c == 0; }));
                std::memset(at, mark, n);
                blocks.push_back({at, n, mark});
                used += whole(n);
            } else {
                ASSERT_EQ(arena.wanted, n);
                refused++;
            }
        } else {
            auto &held = blocks[random() % blocks.size()];
            check(held);
            if (action == 1) {
                arena_give(held.at);
                used -= whole(held.n);
                std::swap(held, blocks.back());
                blocks.pop_back();
            } else if (auto *at = static_cast<unsigned char *>(arena_resize(held.at, n))) {
                held.at = at;
                check({at, std::min(n, held.n), held.mark});
                used = used - whole(held.n) + whole(n);
                std::memset(at, mark, n);
                held = {at, n, mark};
            } else {
                check(held);
                refused++;
            }
        }
        peak = std::max(peak, used);
        ASSERT_EQ(arena.used, used);
        ASSERT_GE(arena.peak, peak);
        ASSERT_LE(arena.peak, sizeof memory);
    }
    EXPECT_GT(refused, 100u); // the arena was full now and then
    for (auto &held : blocks) {
        arena_give(held.at);
    }
    EXPECT_EQ(arena.used, 0u);
    EXPECT_NE(take(sizeof memory - head), nullptr); // all neighbours were joined
}

TEST_F(ArenaTest, TheBytesThatABlockGainsAreZero)
{
    auto *other = take(400);
    std::memset(other, 0xFF, 400);
    auto *block = take(16);
    std::memset(block, 0xFF, 16);
    arena_give(other);
    for (const size_t n : {40u, 300u, 2000u}) {
        block = static_cast<unsigned char *>(arena_resize(block, n));
        ASSERT_NE(block, nullptr);
        EXPECT_TRUE(std::all_of(block, block + 16, [](unsigned char c) { return c == 0xFF; }));
        EXPECT_TRUE(std::all_of(block + 16, block + n, [](unsigned char c) { return c == 0; })) << n;
    }
}

TEST_F(ArenaTest, UnderTheLockEveryRequestFailsAndNothingMoves)
{
    void *block = take(100);
    arena.locked = 1;
    const Arena before = arena;
    EXPECT_EQ(arena_take(1), nullptr);
    EXPECT_EQ(arena.wanted, 1u);
    EXPECT_EQ(arena_resize(block, 200), nullptr);
    EXPECT_EQ(arena.wanted, 200u);
    EXPECT_EQ(arena_resize(block, 100), block);
    EXPECT_EQ(arena.used, before.used);
    EXPECT_EQ(arena.peak, before.peak);
    arena.locked = 0;
    EXPECT_NE(arena_take(1), nullptr);
}

TEST_F(ArenaTest, RequestsBeyondItAreRefused)
{
    for (const size_t n : {sizeof memory - head + 1, sizeof memory, size_t{1} << 33, SIZE_MAX - 8, SIZE_MAX}) {
        EXPECT_EQ(arena_take(n), nullptr);
        EXPECT_EQ(arena.wanted, n);
    }
    EXPECT_EQ(arena.used, 0u);
}

TEST_F(ArenaTest, TheMostSoFarStays)
{
    void *block = take(1000);
    arena_give(block);
    take(10);
    EXPECT_EQ(arena.peak, whole(1000));
    EXPECT_EQ(arena.used, whole(10));
}

} // namespace arena_test
