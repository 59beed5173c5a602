// SPDX-License-Identifier: Apache-2.0
// Every message of flight/msg through a message lane, between machines of equal and unequal order.
#include "registers/message.h"

#include <cstring>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "registers/testing/board.h"

extern "C" const RegisterMessages fledge_messages_flight; // generated from the headers

namespace registers_message_test {

using namespace fledge::registers::testing;
using Bytes = std::vector<unsigned char>;

Shape lane_for(std::uint32_t size, std::uint32_t flags = 0)
{
    return {REGISTER_MESSAGE, flags, 4 + size, 4};
}

TEST(Message, EveryMessageArrivesBitForBit)
{
    ASSERT_GE(fledge_messages_flight.n, 10u);
    std::mt19937 random(3);
    for (std::uint32_t i = 0; i < fledge_messages_flight.n; i++) {
        const RegisterMessage *type = fledge_messages_flight.messages[i];
        for (std::uint32_t flags : {PLAIN, QUEUED}) {
            Bench bench({lane_for(type->size, flags)}, random() % 2);
            Bytes sent(type->size), got(type->size);
            for (unsigned char &byte : sent) {
                byte = static_cast<unsigned char>(random()); // NaNs and all
            }
            RegisterInfo info;
            ASSERT_EQ(register_put_message(bench.window(), bench.lane(), type, sent.data()), REGISTER_OK);
            ASSERT_EQ(register_take_message(bench.window(), bench.lane(), type, got.data(), &info), REGISTER_OK)
                << type->name;
            EXPECT_EQ(got, sent) << type->name;
        }
    }
}

TEST(Message, RunsFillTheStructAndReversingTwiceIsNotAtAll)
{
    std::mt19937 random(4);
    for (std::uint32_t i = 0; i < fledge_messages_flight.n; i++) {
        const RegisterMessage *type = fledge_messages_flight.messages[i];
        std::uint32_t size = 0;
        for (std::uint32_t k = 0; k < type->n_runs; k++) {
            size += type->runs[k].width * type->runs[k].n;
        }
        EXPECT_EQ(size, type->size) << type->name;
        // Every message begins with its head: 8 bytes of time, 4 of quality, 4 of sequence.
        ASSERT_GE(type->n_runs, 2u);
        EXPECT_EQ(type->runs[0].width, 8u);
        EXPECT_EQ(type->runs[1].width, 4u);
        Bytes bytes(type->size), before;
        for (unsigned char &byte : bytes) {
            byte = static_cast<unsigned char>(random());
        }
        before = bytes;
        register_message_reverse(type, bytes.data());
        for (int k = 0; k < 8; k++) {
            EXPECT_EQ(bytes[k], before[7 - k]);
        }
        for (int k = 0; k < 4; k++) {
            EXPECT_EQ(bytes[8 + k], before[11 - k]);
            EXPECT_EQ(bytes[12 + k], before[15 - k]);
        }
        register_message_reverse(type, bytes.data());
        EXPECT_EQ(bytes, before);
    }
}

TEST(Message, OfAMachineOfTheOtherOrderItIsReversed)
{
    for (std::uint32_t i = 0; i < fledge_messages_flight.n; i++) {
        const RegisterMessage *type = fledge_messages_flight.messages[i];
        Bench bench({lane_for(type->size)}, true);
        Bytes ours(type->size), packet(4 + type->size), got(type->size);
        for (std::size_t k = 0; k < ours.size(); k++) {
            ours[k] = static_cast<unsigned char>(7 * k + 1);
        }
        Bytes theirs = ours;
        register_message_reverse(type, theirs.data());
        packet[1] = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__; // says: the other one
        std::copy(theirs.begin(), theirs.end(), packet.begin() + 4);
        register_put(bench.window(), bench.lane(), packet.data(), 4 + type->size, 0);
        RegisterInfo info;
        ASSERT_EQ(register_take_message(bench.window(), bench.lane(), type, got.data(), &info), REGISTER_OK);
        EXPECT_EQ(got, ours) << type->name;
    }
}

TEST(Message, OnlyMessagesOfItsSizePass)
{
    const RegisterMessage *type = fledge_messages_flight.messages[0];
    Bytes bytes(type->size + 8);
    RegisterInfo info;
    Bench small({lane_for(type->size - 8), lane_for(type->size + 8)}, false);
    for (std::size_t i : {0, 1}) {
        EXPECT_EQ(register_put_message(small.window(), small.lane(i), type, bytes.data()), REGISTER_SIZE);
        EXPECT_EQ(register_take_message(small.window(), small.lane(i), type, bytes.data(), &info), REGISTER_SIZE);
    }
    // A lane of variable size takes any that fits, and a reader sees that it is another one.
    Bench any({lane_for(type->size + 8, VARIABLE | QUEUED)}, false);
    EXPECT_EQ(register_put_message(any.window(), any.lane(), type, bytes.data()), REGISTER_OK);
    EXPECT_EQ(register_take_message(any.window(), any.lane(), type, bytes.data(), &info), REGISTER_OK);
    const unsigned char odd[8] = {};
    register_put(any.window(), any.lane(), odd, 8, 0);
    EXPECT_EQ(register_take_message(any.window(), any.lane(), type, bytes.data(), &info), REGISTER_CORRUPT);
    Bytes head(4 + type->size);
    head[1] = 2; // no byte order
    register_put(any.window(), any.lane(), head.data(), 4 + type->size, 0);
    EXPECT_EQ(register_take_message(any.window(), any.lane(), type, bytes.data(), &info), REGISTER_CORRUPT);
}

} // namespace registers_message_test
