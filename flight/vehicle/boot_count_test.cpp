// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include "flight/vehicle/boot_count.h"
}

#include <gtest/gtest.h>

#include <cstring>

namespace boot_count_test {

/// A memory of one slot that answers the request of the update before.
struct Memory {
    NvmPacket reply{};
    std::uint32_t slot[NVM_WORDS] = {0, 11, 12};
    int stores = 0;

    void answer(const NvmPacket &request)
    {
        reply.head.quality = QUALITY_GOOD;
        if (request.code != NVM_NOTHING && request.number != reply.number) {
            EXPECT_EQ(request.slot, 3u);
            reply.number = request.number;
            if (request.code == NVM_STORE) {
                std::memcpy(slot, request.data, sizeof slot);
                stores++;
            }
            std::memcpy(reply.data, slot, sizeof slot);
        }
    }
};

TEST(BootCount, each_start_counts_once)
{
    Memory memory;
    for (std::uint32_t start = 1; start <= 20; start++) {
        BootCount m{}; // a start: nothing is left of before
        m.par.slot = 3;
        boot_count_reset(&m);
        for (int k = 0; k < 10; k++) {
            memory.answer(m.out.request);
            m.in.reply = memory.reply;
            boot_count_update(&m, {k, 1});
        }
        EXPECT_EQ(m.out.boot.boots, start);
        EXPECT_EQ(m.out.boot.kept, 1u);
        EXPECT_EQ(m.out.boot.head.quality, QUALITY_GOOD);
        EXPECT_EQ(memory.slot[0], start);
        EXPECT_EQ(memory.slot[1], 11u) << "the rest of the slot stays";
        EXPECT_EQ(memory.stores, static_cast<int>(start));
    }
}

TEST(BootCount, starts_that_no_reset_explains_are_the_computers_own)
{
    for (const std::uint32_t resets : {0u, 3u, 6u, 7u}) {
        Memory memory;
        memory.slot[0] = 6; // this is the seventh start
        BootCount m{};
        m.par.slot = 3;
        boot_count_reset(&m);
        m.in.interconnect.head.quality = QUALITY_GOOD;
        m.in.interconnect.resets = resets;
        for (int k = 0; k < 5; k++) {
            memory.answer(m.out.request);
            m.in.reply = memory.reply;
            boot_count_update(&m, {k, 1});
        }
        EXPECT_EQ(m.out.boot.boots, 7u);
        EXPECT_EQ(m.out.boot.own, resets < 7 ? 6 - resets : 0u);
    }
}

TEST(BootCount, without_an_answer_nothing_is_stored)
{
    BootCount m{};
    boot_count_reset(&m);
    boot_count_update(&m, {0, 0});
    EXPECT_EQ(m.out.request.head.quality, QUALITY_NONE);
    m.in.reply.head.quality = QUALITY_GOOD;
    m.in.reply.number = 5; // to a request before this start
    boot_count_update(&m, {1, 1});
    EXPECT_EQ(m.out.request.number, 6u);
    for (int k = 2; k < 9; k++) {
        boot_count_update(&m, {k, 1});
        EXPECT_EQ(m.out.request.code, NVM_RETRIEVE);
        EXPECT_EQ(m.out.boot.boots, 0u);
    }
    m.in.reply.number = 6;
    m.in.reply.refused = 1;
    boot_count_update(&m, {9, 1});
    EXPECT_EQ(m.out.request.code, NVM_RETRIEVE);
    EXPECT_EQ(m.out.boot.head.quality, QUALITY_DEGRADED);
}

TEST(BootCount, a_count_is_kept_when_the_memory_has_answered)
{
    Memory memory;
    BootCount m{};
    m.par.slot = 3;
    boot_count_reset(&m);
    for (int k = 0; k < 10; k++) {
        m.in.reply = memory.reply; // it answers each third update
        boot_count_update(&m, {k, 1});
        EXPECT_EQ(m.out.boot.kept, memory.stores > 0 ? 1u : 0u);
        if (k % 3 == 2) {
            memory.answer(m.out.request);
        }
    }
    EXPECT_EQ(m.out.boot.kept, 1u);
}

} // namespace boot_count_test
