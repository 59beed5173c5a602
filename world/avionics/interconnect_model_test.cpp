// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/interconnect_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>

namespace interconnect_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Bus {
    Interconnect i{};
    InterconnectModel model{i};
    Ns t = 0;

    Bus()
    {
        i.par.slots = 5;
        model.reset(0);
    }
    const NvmPacket &ask(NvmCode code, std::uint32_t slot, std::array<std::uint32_t, NVM_WORDS> data = {})
    {
        i.in.request.code = code;
        i.in.request.number = i.out.reply.number + 1;
        i.in.request.slot = slot;
        std::copy(data.begin(), data.end(), i.in.request.data);
        return step();
    }
    const NvmPacket &step()
    {
        t += 100 * ms;
        model.update({t, 100 * ms});
        return i.out.reply;
    }
};

TEST(Interconnect, WhatIsStoredComesBackAlsoAfterResets)
{
    std::mt19937 random(2);
    Bus bus;
    std::map<std::uint32_t, std::array<std::uint32_t, NVM_WORDS>> memory;
    std::uint32_t stored = 0, retrieved = 0, refused = 0;
    for (int k = 0; k < 2000; k++) {
        const std::uint32_t slot = random() % 6;
        bus.i.in.computer.count += random() % 10 == 0;
        if (random() % 2) {
            std::array<std::uint32_t, NVM_WORDS> data;
            std::generate(data.begin(), data.end(), random);
            EXPECT_EQ(bus.ask(NVM_STORE, slot, data).refused, slot >= 5);
            stored += slot < 5;
            if (slot < 5) {
                memory[slot] = data;
            }
        } else {
            const NvmPacket &reply = bus.ask(NVM_RETRIEVE, slot);
            EXPECT_EQ(reply.refused, slot >= 5);
            EXPECT_EQ(reply.number, bus.i.in.request.number);
            retrieved += slot < 5;
            if (slot < 5) {
                EXPECT_EQ(std::to_array(reply.data), memory[slot]);
            }
        }
        refused += slot >= 5;
    }
    EXPECT_EQ(bus.i.out.state.stored, stored);
    EXPECT_EQ(bus.i.out.state.retrieved, retrieved);
    EXPECT_EQ(bus.i.out.state.refused, refused);
    EXPECT_EQ(bus.i.out.state.resets, bus.i.in.computer.count);
}

TEST(Interconnect, ARequestIsServedOnceAndNothingIsNone)
{
    Bus bus;
    bus.ask(NVM_STORE, 0, {7});
    for (int k = 0; k < 5; k++) {
        bus.step();
    }
    EXPECT_EQ(bus.i.out.state.stored, 1u);
    bus.i.in.request = {}; // as flight's output is after a reset of the computer
    const NvmPacket before = bus.i.out.reply;
    EXPECT_EQ(bus.step().number, before.number);
    EXPECT_EQ(bus.i.out.state.stored + bus.i.out.state.retrieved + bus.i.out.state.refused, 1u);
}

} // namespace interconnect_model_test
