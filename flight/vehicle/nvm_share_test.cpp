// SPDX-License-Identifier: Apache-2.0
// Modules that share a memory see what each would see of a memory of its own.
extern "C" {
#include "flight/vehicle/nvm_share.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>

namespace nvm_share_test {

using Words = std::array<std::uint32_t, NVM_WORDS>;

/// A memory of four slots, which answers some updates later.
struct Memory {
    std::map<std::uint32_t, Words> slots;
    NvmPacket reply{};
    int late = 0, most = 0;

    void update(const NvmPacket &request, int delay)
    {
        reply.head = {0, QUALITY_GOOD, reply.head.sequence + 1};
        if (request.code == NVM_NOTHING || request.number == reply.number || late++ < delay) {
            return;
        }
        late = 0;
        reply.number = request.number;
        reply.slot = request.slot;
        reply.code = request.code;
        reply.refused = request.slot > 3;
        if (request.code == NVM_STORE && reply.refused == 0) {
            std::copy_n(request.data, NVM_WORDS, slots[request.slot].begin());
        }
        std::copy_n(slots[request.slot].begin(), NVM_WORDS, reply.data);
    }
};

TEST(NvmShare, EachModuleIsAnsweredAsByAMemoryOfItsOwn)
{
    std::mt19937 chance(3);
    const auto pick = [&](unsigned n) { return chance() % n; };
    std::array<unsigned, 4> answered{};
    for (int run = 0; run < 100; run++) {
        NvmShare m{};
        Memory memory;
        memory.reply.number = static_cast<std::uint32_t>(chance()); // of before this start
        nvm_share_reset(&m);
        const std::array<NvmPacket *, 4> asks = {&m.in.ask_a, &m.in.ask_b, &m.in.ask_c, &m.in.ask_d};
        const std::array<NvmPacket *, 4> replies = {&m.out.reply_a, &m.out.reply_b, &m.out.reply_c, &m.out.reply_d};
        std::map<std::uint32_t, Words> expected;
        std::array<bool, 4> waits{};
        std::array<int, 4> since{};
        for (std::int64_t t = 1; t < 300; t++) {
            for (unsigned i = 0; i < 4; i++) {
                NvmPacket &ask = *asks[i];
                const NvmPacket &reply = *replies[i];
                if (waits[i] && reply.number == ask.number) {
                    EXPECT_EQ(reply.refused, ask.slot == 9);
                    Words &slot = expected[ask.slot];
                    if (ask.code == NVM_STORE && ask.slot != 9) {
                        std::copy_n(ask.data, NVM_WORDS, slot.begin());
                    }
                    EXPECT_TRUE(ask.slot == 9 || std::equal(slot.begin(), slot.end(), reply.data));
                    waits[i] = false;
                    answered[i]++;
                } else if (waits[i]) {
                    EXPECT_LT(since[i]++, 20) << "module " << i << " waits for ever";
                } else if (head_written(reply.head) && pick(3) == 0) {
                    ask.code = pick(2) == 0 ? NVM_STORE : NVM_RETRIEVE;
                    ask.number = reply.number + 1;
                    ask.slot = pick(9) == 0 ? 9 : i; // each has a slot of its own
                    std::generate_n(ask.data, NVM_WORDS, [&] { return static_cast<std::uint32_t>(chance()); });
                    waits[i] = true;
                    since[i] = 0;
                }
            }
            m.in.reply = memory.reply;
            nvm_share_update(&m, {t, 1});
            memory.update(m.out.request, static_cast<int>(pick(3)));
        }
    }
    for (const unsigned n : answered) {
        EXPECT_GT(n, 1000u);
    }
}

} // namespace nvm_share_test
