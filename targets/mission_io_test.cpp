// SPDX-License-Identifier: Apache-2.0
// Messages through lanes by a table: whole, and as numbers of every type in words.
#include "targets/mission_io.h"

#include "registers/field.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace {

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
                  static_cast<std::uint32_t>(lanes_.size()),
                  lanes_.data()};
        window_ = register_window(&board_, reinterpret_cast<volatile std::uint32_t *>(memory_.data()));
        io_ = {messages_,
               boards_,
               rows_.data(),
               4,
               1,
               static_cast<std::uint32_t>(rows_.size()),
               0,
               nullptr,
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
        double found = 0;
        switch (ROWS[i].number) {
        case FLEDGE_I16: found = mission.in.i16[1]; break;
        case FLEDGE_U16: found = mission.in.u16[1]; break;
        case FLEDGE_I8: found = mission.in.i8[1]; break;
        case FLEDGE_U8: found = mission.in.u8[1]; break;
        default: continue; // as wide as the words, or wider
        }
        EXPECT_EQ(found, ROWS[i].high);
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

} // namespace
