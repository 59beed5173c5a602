// SPDX-License-Identifier: Apache-2.0
// The links against a published budget and plain geometry; the bytes against a queue that is kept by hand.
#include "world/avionics/radio_model.h"

#include "flight/math/attitude.h"
#include "world/avionics/link_budget.h"
#include "world/eigen.h"
#include "world/testing/flyer.h"

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <numbers>
#include <numeric>
#include <random>
#include <tuple>

namespace fledge::world {
namespace radio_model_test {

using Eigen::Vector3d;
using sim::Ns;

constexpr double pi = std::numbers::pi, deg = pi / 180.0;
using testing::ms, testing::second;
using Bytes = std::vector<std::uint8_t>;

GravityBody body(const char *name, int naif, double radius, const Vector3d &r = Vector3d::Zero())
{
    GravityBody made{.name = name, .mu = 1e10, .radius = radius, .r_PN_N = r, .naif = naif};
    return made;
}

/// A station on the equator of an Earth that stands still, a craft over it, and their radio.
struct Link : ::testing::Test {
    GroundStation at{};
    GroundStationModel station{at};
    Radio i{};
    RadioModel radio{i};

    Link()
    {
        station.set_body(body("EARTH", 399, 6378137.0));
        i.par.down_frequency = i.par.up_frequency = 2e9;
        i.par.down_rate = i.par.up_rate = 8000.0; // a byte in 1 ms
        i.par.down_eirp_dBW = i.par.up_eirp_dBW = 50.0;
        i.in.truth.head.quality = QUALITY_GOOD;
        place(Vector3d(1e6, 0, 0));
        radio.set_source(station);
    }
    void prepare(std::uint64_t seed = 1)
    {
        station.prepare({"world.station", seed, nullptr});
        radio.prepare({"world.radio", seed, nullptr});
        station.reset(0);
        radio.reset(0);
        radio.take(0); // from now on
        radio.update({0, 0});
    }
    void place(const Vector3d &from_station) { i.in.truth.r_BN_N = vec(Vector3d(6378137.0, 0, 0) + from_station); }
    const RadioLink &down(Ns t = 0)
    {
        radio.update({t, second});
        return i.out.down;
    }
    std::vector<Bytes> received(Ns t)
    {
        std::vector<Bytes> found;
        radio.receive(t, [&](sim::Unit unit) { found.emplace_back(unit.begin(), unit.end()); });
        return found;
    }
};

TEST_F(Link, HasTheBudgetOfVoyagerAtNeptune)
{
    // As P. Karn computed it in August 1989: 12.7 W and 48.13 dB on board, 73.8 dB and 10 K on the ground, 21.6 kb/s.
    place(Vector3d(4.416e12, 0, 0));
    i.par.down_frequency = 8415e6;
    i.par.down_eirp_dBW = 11.04 + 48.13;
    i.par.down_g_t_dBK = 73.8 - 10.0;
    i.par.down_rate = 21600.0;
    prepare();
    const RadioLink &link = i.out.down;
    EXPECT_NEAR(link.loss_dB, 303.85, 0.01);
    EXPECT_NEAR(link.eb_n0_dB, 4.38, 0.02);
    EXPECT_NEAR(link.c_n0_dBHz, 59.17 - 303.85 + 63.8 + 228.60, 0.02);
    EXPECT_NEAR(link.range, 4.416e12, 1.0);
    EXPECT_NEAR(link.light_time, 4.416e12 / 299792458.0, 1e-6);
    EXPECT_EQ(link.bit_error_rate, bit_error_rate(RADIO_UNCODED, ratio(link.eb_n0_dB)));
    EXPECT_EQ(link.state, RADIO_LOCKED);
    i.par.down_required_dB = 4.5;
    EXPECT_EQ(down(second).state, RADIO_WEAK);
    EXPECT_EQ(link.lock, 0u);
    EXPECT_EQ(i.out.up.state, RADIO_WEAK); // 50 dBW are too few
    i.par.down_required_dB = 0.0;
    i.par.load = 4;
    i.in.power.head.quality = QUALITY_GOOD;
    EXPECT_EQ(down(second).state, RADIO_OFF);
    EXPECT_EQ(i.out.up.state, RADIO_OFF);
    EXPECT_EQ(link.lock, 0u);
    i.in.power.on = 1u << 4;
    EXPECT_EQ(down(second).state, RADIO_LOCKED);
}

TEST_F(Link, IsSeenOverTheMaskAndNotBehindABody)
{
    at.par.mask = 10 * deg;
    radio.add_body(body("EARTH", 399, 6378137.0)); // its own hides nothing of what is over its horizon
    radio.add_body(body("MOON", 301, 1737e3, Vector3d(3.8e8, 0, 0)));
    prepare();
    for (int k = 0; k < 900; k++) {
        const double elevation = 0.1 * (k + 0.5) * deg;
        place(1e7 * Vector3d(std::sin(elevation), std::cos(elevation), 0));
        const RadioLink &link = down(k * second);
        EXPECT_NEAR(link.elevation, elevation, 1e-9);
        EXPECT_EQ(link.state, k < 100 ? RADIO_LOW : RADIO_LOCKED) << k;
    }
    // Behind the Moon: its limb, as the station sees it.
    const double half = std::asin(1737e3 / (3.8e8 - 6378137.0));
    for (const double off : {0.0, 0.99 * half, 1.01 * half, 2 * half}) {
        const Vector3d way(std::cos(off), std::sin(off), 0);
        place(5e8 * way);
        EXPECT_EQ(down(1000 * second).state, off < half ? RADIO_HIDDEN : RADIO_LOCKED);
        place(3.0e8 * way); // before it
        EXPECT_EQ(down(1001 * second).state, RADIO_LOCKED);
    }
}

TEST_F(Link, FadesAsTheAntennaTurnsAway)
{
    i.par.axis_B = vec3(0, 0, 2);
    EXPECT_NE(error_of([&] { prepare(); }).find("world.radio.beam is missing"), std::string::npos);
    i.par.beam = 20 * deg;
    prepare();
    for (int k = 0; k <= 36; k++) {
        const double off = 5.0 * k * deg; // the station is along -x: turn about y until b3 points there
        i.in.truth.sigma_BN = vec3(0, std::tan((off - 90 * deg) / 4.0), 0);
        const RadioLink &link = down(k * second);
        EXPECT_NEAR(link.off_axis, off, 1e-9);
        EXPECT_NEAR(link.gain_dB, -std::min(12.0 * std::pow(off / (20 * deg), 2), 30.0), 1e-9);
        EXPECT_NEAR(link.eb_n0_dB, 50 + link.gain_dB - link.loss_dB + 228.5992 - 39.0309, 1e-3);
    }
}

TEST_F(Link, TheSunRaisesTheNoiseOfTheStation)
{
    radio.set_body(body("SUN", 10, 6.957e8, Vector3d(1.496e11, 0, 0)));
    EXPECT_NE(error_of([&] { prepare(); }).find("world.radio.sun: give station_beam"), std::string::npos);
    i.par.station_beam = 0.065 * deg;
    i.par.station_noise = 25.0;
    i.par.sun_brightness = 23000.0;
    prepare();
    double before = 1e9;
    for (const double angle : {0.0, 0.2, 0.25, 0.3, 0.35, 5.0}) {
        place(4e11 * Vector3d(std::cos(angle * deg), std::sin(angle * deg), 0));
        const RadioLink &link = down();
        EXPECT_NEAR(link.sun_angle, angle * deg, 1e-6);
        const double share = beam_share(angle * deg, std::asin(6.957e8 / (1.496e11 - 6378137.0)), 0.065 * deg);
        EXPECT_NEAR(link.noise_dB, 10 * std::log10(1.0 + 23000.0 * share / 25.0), 1e-3);
        EXPECT_LE(link.noise_dB, before);
        EXPECT_EQ(i.out.up.noise_dB, 0.0);
        before = link.noise_dB;
    }
    place(4e11 * Vector3d(1, 0, 0));
    EXPECT_NEAR(down().noise_dB, 10 * std::log10(1.0 + 23000.0 / 25.0), 0.01);
    EXPECT_EQ(before, 0.0);
}

TEST_F(Link, AUnitWaitsForTheTransmitterAndArrivesOneLightTimeLater)
{
    place(Vector3d(299792458.0, 0, 0)); // one second away
    i.par.down_rate = 80000.0;
    i.par.up_rate = 16000.0;
    prepare();
    // 1000 bytes take 0.1 s: two at once, and one later.
    radio.send_down(0, Bytes(1000, 1));
    radio.send_down(0, Bytes(1000, 2));
    radio.send_down(500 * ms, Bytes(1000, 3));
    EXPECT_TRUE(radio.take(1099 * ms).empty());
    auto came = radio.take(1100 * ms);
    ASSERT_EQ(came.size(), 1u);
    EXPECT_EQ(came[0].t, 1100 * ms);
    EXPECT_EQ(came[0].bytes, Bytes(1000, 1));
    came = radio.take(5 * second);
    ASSERT_EQ(came.size(), 2u);
    EXPECT_EQ(came[0].t, 1200 * ms);
    EXPECT_EQ(came[1].t, 1600 * ms);
    EXPECT_EQ(came[1].bytes, Bytes(1000, 3));

    radio.send_up(10 * second, Bytes{1, 2, 3});
    EXPECT_EQ(radio.next_up(), 11 * second + 1500 * 1000);
    EXPECT_TRUE(received(11 * second + 1499 * 1000).empty());
    EXPECT_EQ(received(11 * second + 1500 * 1000), std::vector<Bytes>(1, {1, 2, 3}));
    radio.update({12 * second, second});
    const RadioTraffic &down = i.out.down_traffic, &up = i.out.up_traffic;
    EXPECT_EQ(down.sent, 3u);
    EXPECT_EQ(down.received, 3u);
    EXPECT_EQ(down.bytes, 3000u);
    EXPECT_EQ(down.lost + down.damaged + down.dropped + down.waiting, 0u);
    EXPECT_EQ(up.received, 1u);
}

TEST_F(Link, WithoutLockAUnitIsLostAndWithoutRoomItIsDropped)
{
    i.par.down_room = 4000;
    prepare();
    for (int k = 0; k < 10; k++) {
        radio.send_down(0, Bytes(1000, static_cast<std::uint8_t>(k))); // 1 s each
    }
    radio.update({0, 0});
    EXPECT_EQ(i.out.down_traffic.sent, 3u);
    EXPECT_EQ(i.out.down_traffic.dropped, 7u);
    EXPECT_EQ(i.out.down_traffic.waiting, 3000u);
    // The station sinks at 1.5 s: the third one begins without it.
    radio.update({1500 * ms, second});
    place(Vector3d(-1e6, 0, 0));
    radio.update({1500 * ms, second});
    EXPECT_EQ(radio.take(10 * second).size(), 2u);
    radio.send_up(10 * second, Bytes(10, 0));
    EXPECT_TRUE(received(20 * second).empty());
    radio.update({20 * second, second});
    EXPECT_EQ(i.out.down_traffic.lost, 1u);
    EXPECT_EQ(i.out.up_traffic.lost, 1u);
    EXPECT_EQ(i.out.down_traffic.waiting, 0u);
}

TEST_F(Link, BitsAreWrongAtTheBitErrorRate)
{
    i.par.down_rate = i.par.up_rate = 1e9;
    for (const double rate : {0.5, 0.02, 1e-3, 1e-5}) {
        i.par.down_eirp_dBW = 0.0;
        prepare();
        double low = -50.0, high = 50.0; // find the level that has this rate
        while (high - low > 1e-9) {
            const double middle = 0.5 * (low + high);
            (bit_error_rate(RADIO_UNCODED, ratio(middle)) > rate ? low : high) = middle;
        }
        i.par.down_eirp_dBW = low - i.out.down.eb_n0_dB;
        i.par.down_required_dB = -100.0;
        prepare();
        EXPECT_NEAR(i.out.down.bit_error_rate / rate, 1.0, 1e-2);
        const int units = 400, n = 5000;
        std::uint64_t wrong = 0, damaged = 0;
        std::array<std::uint64_t, 8> places{};
        for (int k = 0; k < units; k++) {
            radio.send_down(k * second, Bytes(n, 0));
            for (const sim::Packet &packet : radio.take((k + 1) * second)) {
                std::uint64_t here = 0;
                for (const std::uint8_t byte : packet.bytes) {
                    here += static_cast<std::uint64_t>(std::popcount(byte));
                    for (unsigned bit = 0; bit < 8; bit++) {
                        places[bit] += byte >> bit & 1u;
                    }
                }
                wrong += here;
                damaged += here > 0;
            }
        }
        const double bits = 8.0 * n * units, expected = bits * i.out.down.bit_error_rate;
        EXPECT_NEAR(static_cast<double>(wrong), expected, 5 * std::sqrt(expected));
        for (const std::uint64_t place : places) {
            EXPECT_NEAR(static_cast<double>(place), expected / 8, 5 * std::sqrt(expected / 8) + 1);
        }
        radio.update({units * second, second});
        EXPECT_EQ(i.out.down_traffic.damaged, damaged);
        EXPECT_EQ(i.out.down_traffic.received, static_cast<std::uint32_t>(units));
    }
}

/// Random units over a link that changes: what arrives, and when, does not depend on when it is taken, and the
/// memory is the whole state.
TEST_F(Link, WhatArrivesDoesNotDependOnWhenItIsTaken)
{
    const auto fly = [this](bool looks, bool copied) {
        i.par.down_room = i.par.up_room = 700;
        i.par.down_eirp_dBW = i.par.up_eirp_dBW = -25.0;
        i.par.down_required_dB = i.par.up_required_dB = -10.0;
        place(Vector3d(1e6, 0, 0));
        prepare(7);
        std::mt19937 random(3), looker(looks);
        std::vector<sim::Packet> came;
        std::vector<Bytes> up;
        const auto look = [&](Ns t) {
            for (sim::Packet &packet : radio.take(t)) {
                came.push_back(std::move(packet));
            }
        };
        for (int k = 1; k < 2000; k++) {
            const Ns t = k * 100 * ms;
            place(1e6 * Vector3d(3 * std::sin(0.02 * k), 1, 0));
            radio.update({t, 100 * ms});
            if (random() % 2) {
                radio.send_down(t, Bytes(random() % 300, 0x55));
            }
            if (random() % 3 == 0) {
                radio.send_up(t + static_cast<Ns>(random() % 100'000'000), Bytes(random() % 200, 0xaa));
            }
            if (looks && looker() % 2) {
                look(t);
            }
            for (Bytes &bytes : received(t)) { // by flight, at its instants
                up.push_back(std::move(bytes));
            }
            if (copied && k == 1000) { // as a snapshot does
                const auto memory = radio.memory();
                const std::vector<std::byte> kept(memory.begin(), memory.end());
                const Radio interface = i;
                look(t);
                radio.reset(0);
                std::copy(kept.begin(), kept.end(), radio.memory().begin());
                i = interface;
                came.clear();
                up.clear();
            } else if (k == 1000) {
                look(t);
                came.clear();
                up.clear();
            }
        }
        look(1000 * second);
        return std::tuple(came.size(),
                          std::accumulate(came.begin(), came.end(), std::uint64_t{0},
                                          [](auto sum, auto &packet) {
                                              for (const std::uint8_t byte : packet.bytes) {
                                                  sum = 31 * sum + byte;
                                              }
                                              return 31 * sum + static_cast<std::uint64_t>(packet.t);
                                          }),
                          up, i.out.down_traffic.lost, i.out.down_traffic.damaged, i.out.down_traffic.dropped,
                          i.out.up_traffic.dropped);
    };
    const auto once = fly(false, false);
    EXPECT_GT(std::get<0>(once), 100u);
    EXPECT_GT(std::get<3>(once), 50u);
    EXPECT_GT(std::get<4>(once), 10u);
    EXPECT_GT(std::get<5>(once), 10u);
    EXPECT_EQ(fly(true, false), once);
    EXPECT_EQ(std::get<1>(fly(false, true)), std::get<1>(once));
}

TEST_F(Link, SaysWhatIsMissing)
{
    RadioModel alone(i);
    alone.prepare({"world.alone", 1, nullptr});
    EXPECT_NE(error_of([&] { alone.reset(0); }).find("world.alone.station is missing"), std::string::npos);
    i.in.truth.head.quality = QUALITY_NONE;
    prepare();
    radio.send_down(0, Bytes(10, 1));
    EXPECT_EQ(down(second).state, RADIO_SILENT);
    EXPECT_TRUE(radio.take(2 * second).empty()); // there is no link yet
    down(3 * second);
    EXPECT_EQ(i.out.down_traffic.lost, 1u);
}

} // namespace radio_model_test
} // namespace fledge::world
