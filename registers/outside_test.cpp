// SPDX-License-Identifier: Apache-2.0
// The shipped boards, made from their files, flown from both sides: flight through the generated
// accessors, the models through the ends of lanes, in one process and in two.
#include "registers/outside.h"

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include <gtest/gtest.h>

#include <io_board_a.h> // generated, as the next three
#include <io_board_b.h>
#include <single_board_computer.h>
#include <solid_state_recorder.h>

#include "registers/snapshot_link.h"
#include "registers/testing/allocations.h"

namespace outside_test {

using namespace fledge::registers;
using fledge::registers::testing::allocations;
using namespace std::chrono_literals;

constexpr std::array<const RegisterBoard *, 4> BOARDS = {&single_board_computer, &io_board_a, &io_board_b,
                                                         &solid_state_recorder};
enum { SBC, IOA, IOB, SSR };

template <std::size_t N> std::span<const std::byte> bytes(const std::uint8_t (&v)[N])
{
    return std::as_bytes(std::span(v));
}

std::vector<std::uint8_t> copied(std::span<const std::byte> packet)
{
    std::vector<std::uint8_t> v(packet.size());
    std::memcpy(v.data(), packet.data(), v.size());
    return v;
}

class OutsideTest : public ::testing::Test {
protected:
    OutsideTest() : backend_(BOARDS, [this] { flight_(); }), outside_(backend_) {}
    const RegisterWindow *window(std::size_t i) const { return &backend_.windows()[i]; }

    std::function<void()> flight_ = [] {};
    InProcess backend_;
    Outside outside_;
};

TEST_F(OutsideTest, CountsOfAConverterAgreeWithinTheirQuantisation)
{
    LaneWriter sun = outside_.writer("io_board_a", "sun_sensor");
    LaneReader volts = outside_.reader("io_board_a", "wheel_volts");
    const std::size_t current = sun.field("current"), saturated = sun.field("saturated");
    const double step = sun.lane().fields[current].scale;
    for (std::uint32_t i = 0; i < IO_BOARD_A_SUN_SENSOR_COUNT; i++) {
        const double value = 0.0011 * i;
        ASSERT_EQ(sun.set(current, value, i), REGISTER_OK);
        ASSERT_EQ(sun.set(saturated, i % 2, i), REGISTER_OK);
        EXPECT_LE(std::abs(io_board_a_sun_sensor_current(window(IOA), i) - value), step / 2);
        EXPECT_EQ(io_board_a_sun_sensor_saturated(window(IOA), i), i % 2);
    }
    EXPECT_EQ(sun.counts().saturated, 0u);
    sun.set(current, 1.0);
    EXPECT_EQ(sun.counts().saturated, 1u);
    EXPECT_EQ(io_board_a_sun_sensor_current(window(IOA), 0), 4095 * step);
    EXPECT_EQ(sun.set(current, 0, 8), REGISTER_SIZE);
    EXPECT_EQ(sun.set(7, 0), REGISTER_SIZE);

    for (std::uint32_t i = 0; i < 4; i++) {
        EXPECT_EQ(io_board_a_wheel_volts_set_command(window(IOA), i, 1.25 * i - 2.5), 0);
        EXPECT_EQ(volts.get(volts.field("command"), i), 1.25 * i - 2.5); // whole counts
    }
}

TEST_F(OutsideTest, HeadersAreRemovedAndAddedAndUnitsSwapped)
{
    LaneWriter wheels = outside_.writer("io_board_a", "wheel_telemetry");
    const std::uint8_t from_bus[] = {0xEB, 0x90, 7, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
    ASSERT_EQ(wheels.put(bytes(from_bus)), REGISTER_OK);
    std::uint8_t got[64];
    RegisterInfo info;
    ASSERT_EQ(io_board_a_wheel_telemetry_take(window(IOA), got, sizeof got, &info), REGISTER_OK);
    const std::uint8_t swapped[] = {4, 3, 2, 1, 8, 7, 6, 5, 12, 11, 10, 9, 16, 15, 14, 13};
    EXPECT_EQ(info.n, sizeof swapped);
    EXPECT_EQ(std::memcmp(got, swapped, sizeof swapped), 0);
    EXPECT_EQ(register_handle(window(IOA), IO_BOARD_A_INTERRUPT_WHEEL_PACKET), 1u);
    EXPECT_EQ(wheels.put(bytes(from_bus).first(2)), REGISTER_SIZE);
    EXPECT_EQ(wheels.put(bytes(from_bus).first(18)), REGISTER_SIZE);
    EXPECT_EQ(wheels.counts().refused, 2u);

    LaneWriter replies = outside_.writer("io_board_b", "power_unit_read");
    LaneReader commands = outside_.reader("io_board_b", "power_unit_write");
    const std::uint8_t reply[] = {9, 8, 7};
    ASSERT_EQ(replies.put(bytes(reply)), REGISTER_OK);
    ASSERT_EQ(io_board_b_power_unit_take(window(IOB), got, sizeof got, &info), REGISTER_OK);
    EXPECT_EQ(std::vector<std::uint8_t>(got, got + info.n), (std::vector<std::uint8_t>{0x50, 0x43, 9, 8, 7}));
    const std::uint8_t command[] = {0x50, 0x43, 1, 2};
    ASSERT_EQ(io_board_b_power_unit_put(window(IOB), command, 4, 3), REGISTER_OK);
    std::span<const std::byte> packet;
    ASSERT_EQ(commands.take(packet, info), REGISTER_OK);
    EXPECT_EQ(copied(packet), (std::vector<std::uint8_t>{0xEB, 0x90, 1, 2}));
    EXPECT_EQ(info.tag, 3u);
    // Shorter than the header that is to be removed: no such packet.
    io_board_b_power_unit_put(window(IOB), command, 1, 0);
    EXPECT_EQ(commands.take(packet, info), REGISTER_CORRUPT);
    EXPECT_EQ(commands.counts().passed, 1u);
    EXPECT_EQ(commands.counts().corrupt, 1u);
}

TEST_F(OutsideTest, ARingWrapsAndAFullQueueIsCountedOnBothSides)
{
    LaneReader telemetry = outside_.reader("solid_state_recorder", "telemetry");
    std::span<const std::byte> packet;
    RegisterInfo info;
    std::uint32_t sent = 0, got = 0;
    for (int round = 0; round < 10; round++) {
        for (int i = 0; i < 40; i++) {
            sent += solid_state_recorder_telemetry_put(window(SSR), &sent, 4, 1) == REGISTER_OK;
        }
        EXPECT_EQ(telemetry.lost(), 8u * (round + 1));
        while (telemetry.take(packet, info) == REGISTER_OK) {
            ASSERT_EQ(packet.size(), 8u);
            EXPECT_EQ(static_cast<std::uint8_t>(packet[0]), 0x1A);
            std::uint32_t number;
            std::memcpy(&number, packet.data() + 4, 4);
            ASSERT_EQ(number, got++);
        }
    }
    EXPECT_EQ(got, 320u);
    EXPECT_EQ(telemetry.counts().passed, 320u);
}

TEST_F(OutsideTest, AnExchangeIsOneTickAndTakesNothingFromTheHeap)
{
    LaneWriter attitude = outside_.writer("single_board_computer", "nav_attitude");
    LaneReader command = outside_.reader("single_board_computer", "wheel_command");
    LaneReader volts = outside_.reader("io_board_a", "wheel_volts");
    LaneWriter replies = outside_.writer("io_board_b", "power_unit_read");
    const std::uint8_t reply[] = {1, 2, 3};
    // Flight: torques are the rates', negative; a quarter of them in volts.
    flight_ = [this] {
        Tick tick;
        NavAttitude nav{};
        RegisterInfo info;
        std::uint8_t packet[64];
        const RegisterWindow *w = window(SBC);
        ASSERT_TRUE(register_clock_due(w, &tick));
        EXPECT_EQ(register_handle(w, SINGLE_BOARD_COMPUTER_INTERRUPT_TICK), 1u);
        ASSERT_EQ(single_board_computer_nav_attitude_take(w, &nav, &info), REGISTER_OK);
        ASSERT_EQ(io_board_b_power_unit_take(window(IOB), packet, 64, &info), REGISTER_OK);
        EXPECT_EQ(nav.head.t, tick.t);
        WheelCommand out{};
        out.head = {tick.t, QUALITY_GOOD, info.sequence};
        for (std::uint32_t i = 0; i < 3; i++) {
            out.u[i] = -nav.omega_BN_B.v[i];
            io_board_a_wheel_volts_set_command(window(IOA), i, out.u[i] / 4);
        }
        ASSERT_EQ(single_board_computer_wheel_command_put(w, &out), REGISTER_OK);
        register_clock_finish(w);
    };
    const long before = allocations();
    for (int k = 1; k <= 100; k++) {
        NavAttitude nav{};
        nav.head = {k * 100, QUALITY_GOOD, static_cast<std::uint32_t>(k)};
        nav.omega_BN_B.v[1] = 0.1 * k;
        ASSERT_EQ(attitude.put_message(fledge_message_NavAttitude, &nav), REGISTER_OK);
        ASSERT_EQ(replies.put(bytes(reply)), REGISTER_OK);
        ASSERT_EQ(outside_.tick({k * 100, 100}, 1s), Wait::done);
        WheelCommand u{};
        RegisterInfo info;
        ASSERT_EQ(command.take_message(fledge_message_WheelCommand, &u, info), REGISTER_OK);
        ASSERT_EQ(u.head.t, k * 100);
        ASSERT_EQ(u.u[1], -0.1 * k); // lossless
        ASSERT_LE(std::abs(volts.get(0, 1) - u.u[1] / 4), volts.lane().fields[0].scale / 2);
    }
    EXPECT_EQ(allocations(), before);
    flight_ = [] {};
    EXPECT_EQ(outside_.tick({10100, 100}, 1s), Wait::late);
    outside_.stop();
    EXPECT_TRUE(register_clock_stopped(window(SBC)));
}

TEST_F(OutsideTest, WithItsRegistersItGoesOnFromASnapshot)
{
    // Flight slews and aligns the slave clock now and then; the computer is reset twice.
    std::int64_t now = 0;
    const auto obeys = [&](const RegisterWindow *w) {
        return [&now, w] {
            if (now % 700 == 0) {
                register_slave_command(w, now % 1400 ? REGISTER_SLEW : REGISTER_ALIGN, now * 1'000'000);
            }
            register_clock_finish(w);
        };
    };
    const auto fly = [&](Outside &outside, std::int64_t from, std::int64_t to) {
        std::vector<std::int64_t> down;
        for (now = from; now < to; now += 100) { // [ms]
            const std::uint32_t resets = now > 2000 ? now > 6000 ? 2 : 1 : 0;
            if (outside.is_down(now * 1'000'000, resets, 1'000'000'000)) {
                down.push_back(now);
            } else {
                outside.tick({now * 1'000'000, 100'000'000}, 1s);
            }
        }
        return down;
    };
    const auto memory = [](const InProcess &backend) {
        std::vector<std::uint32_t> words;
        for (const RegisterWindow &w : backend.windows()) {
            words.insert(words.end(), w.words, w.words + w.board->size / 4);
        }
        return words;
    };
    flight_ = obeys(window(SBC));
    outside_.tick({-1, 0}, 1s);
    for (const std::int64_t at : {0, 1500, 2500, 2900, 3300, 6600}) { // the third and the last are within a reset
        fly(outside_, 0, at);
        std::function<void()> flight;
        InProcess other(BOARDS, [&] { flight(); });
        flight = obeys(&other.windows()[SBC]);
        Outside goes_on(other);
        goes_on.restore(outside_.save());
        for (std::size_t i = 0; i < BOARDS.size(); i++) {
            std::copy_n(window(i)->words, BOARDS[i]->size / 4, other.windows()[i].words);
        }
        const auto expected = fly(outside_, at, 9000);
        EXPECT_EQ(fly(goes_on, at, 9000), expected);
        EXPECT_EQ(memory(other), memory(backend_)) << at;
        outside_.tick({-1, 0}, 1s);
    }
    EXPECT_THROW(outside_.restore({}), Error);
}

TEST_F(OutsideTest, AnErrorForAWrongNameListsTheRightOnes)
{
    const auto message = [](auto run) {
        try {
            run();
        } catch (const Error &error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message([&] { outside_.writer("io_board_c", "x"); }),
              "there is no board `io_board_c`; choose of: single_board_computer, io_board_a, "
              "io_board_b, solid_state_recorder");
    EXPECT_EQ(message([&] { outside_.writer("io_board_a", "wheel_volts"); }),
              "board io_board_a has no lane `wheel_volts` that flight reads; choose of: "
              "sun_sensor, wheel_telemetry");
    EXPECT_EQ(message([&] { outside_.writer("io_board_a", "sun_sensor").field("volts"); }),
              "lane sun_sensor has no field `volts`; choose of: current, saturated");
    const RegisterBoard *clockless[] = {&io_board_a};
    InProcess backend(clockless, [] {});
    EXPECT_EQ(message([&] { Outside outside(backend); }), "no board has a clock; give one of them a [clock]");
    EXPECT_NE(message([&] { fledge::registers::SharedFile(clockless, "/nowhere/at/all"); }).find("No such file"),
              std::string::npos);
}

TEST(SnapshotLink, AsksAndAnswersOrSaysWhyNot)
{
    using fledge::registers::SnapshotLink;
    const auto [ours, theirs] = SnapshotLink::make();
    std::optional<SnapshotLink> outside(std::in_place, ours);
    std::atomic<int> rings = 0, answered = 0;
    const auto ring = [&] { rings++; };
    std::vector<std::byte> kept(3'000'000); // does not fit into a socket
    for (std::size_t i = 0; i < kept.size(); i++) {
        kept[i] = static_cast<std::byte>(i * 7);
    }
    std::vector<std::byte> restored;
    std::thread computer([&, end = theirs] {
        SnapshotLink link(end);
        while (answered < 4) {
            link.answer(
                [&] {
                    if (++answered == 2) {
                        throw std::runtime_error("the disk is full");
                    }
                    return kept;
                },
                [&](std::span<const std::byte> bytes) {
                    restored.assign(bytes.begin(), bytes.end());
                    answered++;
                });
        }
    });
    EXPECT_TRUE(outside->ask({}, ring, 20s) == kept);
    try {
        outside->ask({}, ring, 20s);
        ADD_FAILURE();
    } catch (const Error &error) {
        EXPECT_STREQ(error.what(), "the disk is full");
    }
    EXPECT_TRUE(outside->ask(kept, ring, 20s).empty());
    EXPECT_TRUE(restored == kept);
    EXPECT_TRUE(outside->ask({}, ring, 20s) == kept);
    EXPECT_EQ(rings, 4);
    computer.join();
    EXPECT_THROW(outside->ask({}, ring, 20s), Error); // it has ended
    const auto [mine, silent] = SnapshotLink::make();
    outside.emplace(mine);
    EXPECT_THROW(outside->ask({}, ring, 10ms), Error); // it does not answer
    close(silent);
}

TEST(OutsideSharedFile, FlightInAnotherProcessAnswersAndItsEndIsSeen)
{
    fledge::registers::SharedFile backend(BOARDS, "");
    Outside outside(backend);
    const std::string path = "/dev/fd/" + std::to_string(backend.fd());
    const pid_t child = fork();
    if (child == 0) {
        RegisterFile file;
        RegisterWindow w[4];
        if (register_file_attach(&file, path.c_str(), BOARDS.data(), 4, w) != REGISTER_FILE_OK) {
            _exit(1);
        }
        for (int ticks = 0; ticks < 50;) {
            Tick tick;
            if (register_clock_due(&w[SBC], &tick)) {
                single_board_computer_mode_set_word(&w[SBC], single_board_computer_mode_word(&w[SBC]) + 1);
                register_clock_finish(&w[SBC]);
                ticks++;
            } else if (register_file_wait(&file, 20'000'000'000) != REGISTER_FILE_RANG) {
                _exit(2);
            }
        }
        _exit(0);
    }
    LaneWriter mode_read = outside.writer("single_board_computer", "mode_read");
    LaneReader flown = outside.reader("single_board_computer", "mode_write");
    for (std::uint32_t k = 1; k <= 50; k++) {
        mode_read.put_word(1000 * k);
        ASSERT_EQ(outside.tick({k, 1}, 20s), Wait::done);
        std::uint32_t mode = 0;
        flown.take_word(mode);
        ASSERT_EQ(mode, 1000 * k + 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
    EXPECT_EQ(outside.tick({51, 1}, 20s), Wait::gone);
}

} // namespace outside_test
