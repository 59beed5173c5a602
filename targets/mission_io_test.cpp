// SPDX-License-Identifier: Apache-2.0
// Messages through lanes by a table: whole, and as numbers of every type in words.
#include "targets/mission_packets.h"

#include "registers/field.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace mission_io_test {

// A message with an array of each type of number. It stands in a mission behind something else.
struct Numbers {
    Head head;
    double f64[2];
    std::int64_t i64[2];
    std::uint64_t u64[2];
    float f32[2];
    std::int32_t i32[2];
    std::uint32_t u32[2];
    std::int16_t i16[2];
    std::uint16_t u16[2];
    std::int8_t i8[2];
    std::uint8_t u8[2];
    std::uint8_t spare[4];
};
static_assert(sizeof(Numbers) == 104);

struct Mission {
    std::int64_t before;
    Numbers in, out, whole;
};

constexpr RegisterRun RUNS[] = {{8, 1}, {4, 2}, {8, 6}, {4, 6}, {2, 4}, {1, 8}};
constexpr RegisterMessage TYPE = {"Numbers", sizeof(Numbers), 6, RUNS};

struct Row {
    FledgeType number;
    std::uint32_t offset;
    double low, high; // what the type holds
};
constexpr std::array<Row, 10> ROWS = {{
    {FLEDGE_F64, offsetof(Numbers, f64), -1e9, 1e9},
    {FLEDGE_F32, offsetof(Numbers, f32), -1e6, 1e6},
    {FLEDGE_I64, offsetof(Numbers, i64), -2147483648.0, 2147483647.0},
    {FLEDGE_U64, offsetof(Numbers, u64), 0, 2147483647.0},
    {FLEDGE_I32, offsetof(Numbers, i32), -2147483648.0, 2147483647.0},
    {FLEDGE_U32, offsetof(Numbers, u32), 0, 2147483647.0},
    {FLEDGE_I16, offsetof(Numbers, i16), -32768, 32767},
    {FLEDGE_U16, offsetof(Numbers, u16), 0, 65535},
    {FLEDGE_I8, offsetof(Numbers, i8), -128, 127},
    {FLEDGE_U8, offsetof(Numbers, u8), 0, 255},
}};

class MissionIoTest : public ::testing::TestWithParam<bool> {
protected:
    MissionIoTest()
    {
        for (std::size_t way = 0; way < 2; way++) {
            for (const Row &row : ROWS) {
                // Whole counts for all but f64, which has halves.
                fields_.push_back({"n", "-", row.number == FLEDGE_F64 ? 0.5 : 1.0, 0.0, 0, 32, 1, 0, 0, 0, 0, 0});
                rows_.push_back({nullptr, static_cast<std::uint16_t>(way), 0, static_cast<std::uint16_t>(rows_.size()),
                                 0, row.offset, row.number});
            }
        }
        for (std::size_t i = 0; i < rows_.size(); i++) {
            RegisterLane lane{};
            lane.name = "words";
            lane.form = REGISTER_WORD;
            lane.flags = i < ROWS.size() ? 0u : std::uint32_t{REGISTER_FROM_FLIGHT};
            lane.address = static_cast<std::uint32_t>(8 * i);
            lane.descriptors = REGISTER_NOWHERE;
            lane.capacity = lane.stride = 4;
            lane.count = 2;
            lane.interrupt = -1;
            lane.n_fields = 1;
            lane.fields = &fields_[i];
            lanes_.push_back(lane);
        }
        RegisterLane message{};
        message.name = "whole";
        message.form = REGISTER_MESSAGE;
        message.flags = REGISTER_FROM_FLIGHT;
        message.address = 256;
        message.descriptors = REGISTER_NOWHERE;
        message.capacity = sizeof(Numbers) + 4;
        message.stride = (8 + message.capacity + 7) / 8 * 8;
        message.depth = 4;
        message.count = 1;
        message.interrupt = -1;
        lanes_.push_back(message);
        rows_.push_back({&TYPE, 2, 0, static_cast<std::uint16_t>(lanes_.size() - 1), 0, 0, FLEDGE_F64});
        board_ = {"bench",
                  1,
                  0,
                  1024,
                  GetParam(),
                  1000,
                  -1,
                  REGISTER_NOWHERE,
                  0,
                  0,
                  static_cast<std::uint32_t>(lanes_.size()),
                  lanes_.data(),
                  nullptr};
        window_ = register_window(&board_, reinterpret_cast<volatile std::uint32_t *>(memory_.data()));
        io_ = {messages_,
               boards_,
               rows_.data(),
               4,
               1,
               static_cast<std::uint32_t>(rows_.size()),
               nullptr,
               {MISSION_NO_BOARD, 0},
               {MISSION_NO_BOARD, 0},
               nullptr,
               0};
    }

    // Random numbers that their types, and 32 bits, hold.
    Numbers random()
    {
        Numbers n{};
        const auto in = [&](double low, double high) {
            return std::floor(std::uniform_real_distribution<>(low, high)(rng_));
        };
        for (int i = 0; i < 2; i++) {
            n.f64[i] = in(-1e9, 1e9) / 2;
            n.f32[i] = static_cast<float>(in(-1e6, 1e6));
            n.i64[i] = static_cast<std::int64_t>(in(-2e9, 2e9));
            n.u64[i] = static_cast<std::uint64_t>(in(0, 2e9));
            n.i32[i] = static_cast<std::int32_t>(in(-2e9, 2e9));
            n.u32[i] = static_cast<std::uint32_t>(in(0, 2e9));
            n.i16[i] = static_cast<std::int16_t>(in(-32768, 32767));
            n.u16[i] = static_cast<std::uint16_t>(in(0, 65535));
            n.i8[i] = static_cast<std::int8_t>(in(-128, 127));
            n.u8[i] = static_cast<std::uint8_t>(in(0, 255));
        }
        return n;
    }

    std::mt19937_64 rng_{11};
    std::vector<RegisterField> fields_;
    std::vector<RegisterLane> lanes_;
    std::vector<MissionLane> rows_;
    RegisterBoard board_{};
    const RegisterBoard *boards_[1] = {&board_};
    std::array<std::uint64_t, 128> memory_{};
    RegisterWindow window_{};
    const MissionMessage messages_[4] = {
        {"world.a.in", "Numbers", offsetof(Mission, in), sizeof(Numbers), MISSION_IN},
        {"flight.b.out", "Numbers", offsetof(Mission, out), sizeof(Numbers), MISSION_OUT},
        {"flight.c.whole", "Numbers", offsetof(Mission, whole), sizeof(Numbers), MISSION_INSIDE},
        {"flight.d.not", "Numbers", offsetof(Mission, whole), sizeof(Numbers), MISSION_INSIDE},
    };
    MissionIo io_{};
    MissionIoCounts counts_{};
};

TEST_P(MissionIoTest, NumbersOfEveryTypePassInWordsBothWays)
{
    Mission mission{};
    for (std::uint32_t k = 1; k <= 200; k++) {
        const Numbers input = random();
        mission_io_put(&io_, &window_, 0, &input, &counts_);
        mission_io_read(&io_, &window_, &mission, 10 * k, &counts_);
        EXPECT_EQ(mission.in.head.t, 10 * k);
        EXPECT_EQ(mission.in.head.quality, QUALITY_GOOD);
        EXPECT_EQ(mission.in.head.sequence, k);
        EXPECT_EQ(std::memcmp(mission.in.f64, input.f64, sizeof input - sizeof input.head), 0);

        mission.out = random();
        mission.whole = random();
        mission.whole.head = {-7, QUALITY_STALE, k};
        mission_io_write(&io_, &window_, &mission, &counts_);
        Numbers output{}, whole{};
        mission_io_take(&io_, &window_, 1, &output, 10 * k, &counts_);
        mission_io_take(&io_, &window_, 2, &whole, 10 * k, &counts_);
        EXPECT_EQ(output.head.t, 10 * k);
        EXPECT_EQ(std::memcmp(output.f64, mission.out.f64, sizeof output - sizeof output.head), 0);
        EXPECT_EQ(std::memcmp(&whole, &mission.whole, sizeof whole), 0);
    }
    EXPECT_EQ(mission.before, 0);
    EXPECT_EQ(counts_.refused + counts_.corrupt + counts_.saturated, 0u);
}

TEST_P(MissionIoTest, WhatAWordHoldsAndATypeDoesNotIsHeldAtItsEnd)
{
    for (std::size_t i = 0; i < ROWS.size(); i++) {
        for (const double value : {-2147483648.0, 2147483647.0}) {
            const std::int64_t count = register_field_quantise(&fields_[i], value, nullptr);
            for (std::uint32_t k = 0; k < 2; k++) {
                register_put_word(&window_, &lanes_[i], k, static_cast<std::uint32_t>(count));
            }
        }
        Mission mission{};
        mission_io_read(&io_, &window_, &mission, 0, &counts_);
        double value = 0;
        switch (ROWS[i].number) {
        case FLEDGE_I16: value = mission.in.i16[1]; break;
        case FLEDGE_U16: value = mission.in.u16[1]; break;
        case FLEDGE_I8: value = mission.in.i8[1]; break;
        case FLEDGE_U8: value = mission.in.u8[1]; break;
        default: continue; // as wide as the words, or wider
        }
        EXPECT_EQ(value, ROWS[i].high);
    }
}

TEST_P(MissionIoTest, BeforeTheBeginningWordsAreAsIfNeverWritten)
{
    Numbers output{};
    mission_io_take(&io_, &window_, 1, &output, -1, &counts_);
    EXPECT_EQ(output.head.quality, QUALITY_NONE);
    EXPECT_EQ(output.head.sequence, 0u);
}

TEST_P(MissionIoTest, BeyondAFieldANumberIsHeldAndCounted)
{
    Numbers input{};
    input.f64[0] = std::numeric_limits<double>::infinity();
    input.f64[1] = std::numeric_limits<double>::quiet_NaN();
    input.u32[1] = 4294967295u;
    mission_io_put(&io_, &window_, 0, &input, &counts_);
    EXPECT_EQ(counts_.saturated, 3u);
    Mission mission{};
    mission_io_read(&io_, &window_, &mission, 0, &counts_);
    EXPECT_EQ(mission.in.f64[0], 2147483647 * 0.5);
    EXPECT_EQ(mission.in.f64[1], -2147483648 * 0.5);
    EXPECT_EQ(mission.in.u32[1], 2147483647u);
}

TEST_P(MissionIoTest, NumbersPassAsTheTableStates)
{
    EXPECT_EQ(mission_io_clock(&io_), 0u);
    board_.clock = REGISTER_NOWHERE;
    EXPECT_EQ(mission_io_clock(&io_), 1u);
    EXPECT_TRUE(mission_io_carries(&io_, 0) && mission_io_carries(&io_, 2));
    EXPECT_FALSE(mission_io_carries(&io_, 3));
}

INSTANTIATE_TEST_SUITE_P(Orders, MissionIoTest, ::testing::Bool(),
                         [](const auto &order) { return order.param ? "big" : "little"; });

// Two kinds of packets in one queue to flight, behind a header; queued words from flight.
struct Pair {
    Head head;
    double x[2];
};

struct PacketMission {
    Pair a, b, burn;
};

class PacketTest : public ::testing::Test {
protected:
    void lay_out(std::uint32_t flags, bool newest)
    {
        fields_[0] = {"a", "-", 0.5, 0.0, 0, 16, 1, 0, 2, 2, 0, 0};    // i16 at 2
        fields_[1] = {"b", "-", 1.0, 0.0, 0, 32, 1, 1, 5, 2, 1, 3};    // f32, little-endian, at 5, of the tag 3
        fields_[2] = {"ms", "-", 0.001, 0.0, 0, 16, 0, 0, 0, 0, 0, 0}; // of a word
        fields_[3] = {"which", "-", 1.0, 0.0, 16, 16, 0, 0, 0, 0, 0, 0};
        RegisterLane &in = lanes_[0], &out = lanes_[1];
        in = {};
        in.name = "in";
        in.form = REGISTER_PACKET;
        in.flags = REGISTER_QUEUED | REGISTER_VARIABLE | flags;
        in.address = 128;
        in.descriptors = 64;
        in.capacity = 16;
        in.stride = 24;
        in.depth = 4;
        in.count = 1;
        in.interrupt = 0;
        in.descriptor = {0, 12, 16, 8, 31, 1};
        in.outside = {0, 2, HEADER, 1, 0};
        in.n_fields = 2;
        in.fields = fields_;
        out = in;
        out.name = "out";
        out.form = REGISTER_WORD;
        out.flags = REGISTER_FROM_FLIGHT | REGISTER_QUEUED;
        out.address = 512;
        out.interrupt = 1;
        out.descriptors = REGISTER_NOWHERE;
        out.capacity = out.stride = 4;
        out.outside = {0, 0, nullptr, 1, 0};
        out.fields = fields_ + 2;
        board_ = {"bus", 1, 0, 1024, 1, 960, 2, 992, 3, 0, 2, lanes_, nullptr};
        window_ = register_window(&board_, reinterpret_cast<volatile std::uint32_t *>(memory_.data()));
        std::memset(room_, 0, sizeof room_);
        packets_[0] = {0, 0, 6, 0, newest, room_[0]};
        packets_[1] = {0, 0, 13, 3, newest, room_[1]};
        packets_[2] = {0, 1, 4, 0, 0, room_[2]};
        io_ = {};
        io_.messages = messages_;
        io_.boards = boards_;
        io_.lanes = rows_;
        io_.n_messages = 3;
        io_.n_boards = 1;
        io_.n_lanes = 4;
        io_.packets = &all_;
    }

    void put(std::uint32_t id, double x, double y)
    {
        const Pair pair{{}, {x, y}};
        mission_io_put(&io_, &window_, id, &pair, &counts_);
    }

    const Pair &read(std::int64_t t, std::uint32_t id = 0)
    {
        mission_io_read(&io_, &window_, &mission_, t, &counts_);
        return id ? mission_.b : mission_.a;
    }

    static constexpr std::uint8_t HEADER[] = {0xC0, 0xDE};
    RegisterField fields_[4];
    RegisterLane lanes_[2];
    RegisterBoard board_{};
    const RegisterBoard *boards_[1] = {&board_};
    std::array<std::uint64_t, 128> memory_{};
    RegisterWindow window_{};
    std::uint8_t room_[3][17] = {}, scratch_[16] = {};
    const MissionPackets all_ = {&mission_packet_functions, packets_, 3, scratch_};
    MissionPacket packets_[3];
    const MissionLane rows_[4] = {
        {nullptr, 0, 0, 0, 0, offsetof(Pair, x), FLEDGE_F64},
        {nullptr, 1, 0, 0, 1, offsetof(Pair, x), FLEDGE_F64},
        {nullptr, 2, 0, 1, 0, offsetof(Pair, x), FLEDGE_F64},
        {nullptr, 2, 0, 1, 1, offsetof(Pair, x) + sizeof(double), FLEDGE_F64},
    };
    const MissionMessage messages_[3] = {
        {"world.a", "Pair", offsetof(PacketMission, a), sizeof(Pair), MISSION_IN},
        {"world.b", "Pair", offsetof(PacketMission, b), sizeof(Pair), MISSION_IN},
        {"flight.burn", "Pair", offsetof(PacketMission, burn), sizeof(Pair), MISSION_OUT},
    };
    MissionIo io_{};
    MissionIoCounts counts_{};
    PacketMission mission_{};
};

TEST_F(PacketTest, OfAQueueFlightSeesTheOldestOfEachKindAtEachTick)
{
    lay_out(0, false);
    put(0, 1.0, -1.5);
    put(0, 2.0, -2.5);
    put(1, 0.25, 7.0);
    const auto *slot = reinterpret_cast<const std::uint8_t *>(memory_.data()) + 128 + 32 + 8;
    EXPECT_EQ(std::vector(slot, slot + 6), (std::vector<std::uint8_t>{0xC0, 0xDE, 0, 2, 0xFF, 0xFD}));
    EXPECT_EQ(register_load(&window_, 64 + 8), 1u << 31 | 3u << 16 | 13u); // the third's descriptor
    EXPECT_EQ(read(10).x[1], -1.5);
    EXPECT_EQ(mission_.a.head.t, 10);
    EXPECT_EQ(mission_.b.x[1], 7.0);
    EXPECT_EQ(read(20).x[1], -2.5);
    EXPECT_EQ(mission_.a.head.t, 20);
    EXPECT_EQ(mission_.b.head.t, 10); // nothing new: it ages
    EXPECT_EQ(read(30).head.t, 20);
    EXPECT_EQ(counts_.refused + counts_.corrupt + counts_.saturated + counts_.skipped, 0u);
    // Those of one kind that come before another's are all seen.
    put(0, 3.0, 0.0);
    put(0, 4.0, 0.0);
    put(0, 5.0, 0.0);
    put(1, 1.0, 1.0);
    EXPECT_EQ(read(40).x[0], 3.0);
    EXPECT_EQ(mission_.b.head.t, 10);
    EXPECT_EQ(read(50).x[0], 4.0);
    EXPECT_EQ(mission_.b.head.t, 50);
    EXPECT_EQ(read(60).x[0], 5.0);
    EXPECT_EQ(read(70).head.t, 60);
    EXPECT_EQ(counts_.corrupt + counts_.skipped, 0u);
}

TEST_F(PacketTest, OrTheNewestAndCountsThoseThatItSkips)
{
    lay_out(0, true);
    put(0, 1.0, 0.0);
    put(0, 2.0, 0.0);
    put(0, 3.0, 0.0);
    EXPECT_EQ(read(10).x[0], 3.0);
    EXPECT_EQ(counts_.skipped, 2u);
    EXPECT_EQ(read(20).head.t, 10);
    EXPECT_EQ(mission_io_lost(&io_, &window_), 0u);
}

TEST_F(PacketTest, AFullQueueLosesTheNewestOrTheOldestAndCountsThem)
{
    for (const bool overwrite : {false, true}) {
        memory_ = {};
        lay_out(overwrite ? std::uint32_t{REGISTER_OVERWRITE} : 0u, false);
        counts_ = {};
        for (int i = 1; i <= 7; i++) {
            put(0, i, 0.0);
        }
        EXPECT_EQ(counts_.refused, overwrite ? 0u : 3u);
        for (int i = 1; i <= 4; i++) {
            EXPECT_EQ(read(10 * i).x[0], overwrite ? i + 3 : i);
        }
        EXPECT_EQ(mission_io_lost(&io_, &window_), 3u);
        EXPECT_EQ(read(90).head.t, 40);
    }
}

TEST_F(PacketTest, WhatIsNoPacketOfAKnownKindIsCountedAndPassedOver)
{
    lay_out(0, false);
    const std::uint8_t good[] = {0xC0, 0xDE, 0, 8, 0, 9}, other[] = {0xC0, 0xDF, 0, 8, 0, 9};
    register_put(&window_, &lanes_[0], other, 6, 0); // another header
    register_put(&window_, &lanes_[0], good, 6, 7);  // another tag
    register_put(&window_, &lanes_[0], good, 5, 0);  // too short
    register_put(&window_, &lanes_[0], good, 6, 0);
    EXPECT_EQ(read(10).x[1], 4.5);
    EXPECT_EQ(counts_.corrupt, 3u);
    EXPECT_EQ(mission_.b.head.quality, QUALITY_NONE);
    register_store(&window_, 64, 1u << 31 | 4000u); // its length lies
    register_put(&window_, &lanes_[0], good, 6, 0);
    register_store(&window_, 64, 1u << 31 | 4000u);
    EXPECT_EQ(read(20).head.t, 10);
    EXPECT_EQ(counts_.corrupt, 4u);
}

TEST_F(PacketTest, QueuedWordsPassInTheirOrder)
{
    lay_out(0, false);
    Pair burn{};
    for (int i = 1; i <= 2; i++) {
        mission_.burn.x[0] = 0.25 * i;
        mission_.burn.x[1] = i;
        mission_io_write(&io_, &window_, &mission_, &counts_);
    }
    EXPECT_EQ(register_load(&window_, 512 + 32), 1u << 16 | 250u);
    for (int i = 1; i <= 2; i++) {
        mission_io_take(&io_, &window_, 2, &burn, 10 * i, &counts_);
        EXPECT_EQ(burn.x[0], 0.25 * i);
        EXPECT_EQ(burn.x[1], i);
        EXPECT_EQ(burn.head.t, 10 * i);
    }
    mission_io_take(&io_, &window_, 2, &burn, 30, &counts_);
    EXPECT_EQ(burn.head.t, 20);
}

TEST_F(PacketTest, InterruptsAreHandledByTheSideThatReads)
{
    lay_out(0, false);
    put(0, 1.0, 0.0);
    put(0, 2.0, 0.0);
    register_clock_start(&window_, {10, 10});
    mission_io_write(&io_, &window_, &mission_, &counts_);
    EXPECT_EQ(register_interrupts(&window_, 0), 2u);
    EXPECT_EQ(register_interrupts(&window_, 2), 1u);
    read(10);
    EXPECT_EQ(register_interrupts(&window_, 0), 0u);
    EXPECT_EQ(register_interrupts(&window_, 2), 0u);
    EXPECT_EQ(register_interrupts(&window_, 1), 1u) << "the outside's";
    EXPECT_EQ(register_load(&window_, 992), 2u) << "raised";
}

TEST_F(PacketTest, AResetForgetsWhatWaits)
{
    lay_out(0, false);
    put(0, 1.0, 0.0);
    put(0, 2.0, 0.0);
    put(1, 3.0, 0.0);
    read(10);
    put(0, 5.0, 0.0);
    mission_io_forget(&io_, &window_);
    mission_ = {};
    EXPECT_EQ(read(0).head.quality, QUALITY_NONE);
    put(0, 4.0, 0.0);
    EXPECT_EQ(read(10).x[0], 4.0);
}

} // namespace mission_io_test
