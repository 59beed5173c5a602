// SPDX-License-Identifier: Apache-2.0
#include "world/environment/ground_station_model.h"

#include "world/eigen.h"
#include "world/environment/testing/files.h"

#include <Eigen/Dense>

#include <numbers>
#include <random>

namespace fledge::world {
namespace ground_station_model_test {

using Eigen::Vector3d;

constexpr double pi = std::numbers::pi, deg = pi / 180.0;
constexpr sim::Ns second = 1'000'000'000;

struct Station : ::testing::Test {
    GroundStation i{};
    GroundStationModel model{i};

    Station()
    {
        model.set_body({.name = "EARTH", .mu = 3.986e14, .radius = 6378137.0, .naif = 399});
        i.par.latitude = 48.0 * deg;
        i.par.longitude = 11.0 * deg;
        i.par.altitude = 600.0;
        i.par.mask = 10.0 * deg;
        i.par.spin = 2.0 * pi / 86164.0;
        i.in.truth.head.quality = QUALITY_GOOD;
    }
    void prepare()
    {
        model.prepare({"world.station", 1, nullptr});
        model.reset(0);
    }
    const GroundContact &sees(const Vector3d &r, const Vector3d &v, sim::Ns t)
    {
        i.in.truth.r_BN_N = vec(r);
        i.in.truth.v_BN_N = vec(v);
        model.update({t, second});
        return i.out.contact;
    }
    /// Up, north and east at the station, N, at time t.
    Vector3d up(double t) const
    {
        const double lon = i.par.longitude + i.par.spin * t, lat = i.par.latitude;
        return {std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)};
    }
    Vector3d east(double t) const { return Vector3d::UnitZ().cross(up(t)).normalized(); }
    Vector3d north(double t) const { return up(t).cross(east(t)); }
};

TEST_F(Station, StandsOnTheEllipsoidAndTurnsWithIt)
{
    prepare();
    // 48 deg N, 11 deg E, 600 m by the textbook: N = a / sqrt(1 - e^2 sin^2).
    const double e2 = 6.69437999014e-3, N = 6378137.0 / std::sqrt(1.0 - e2 * std::pow(std::sin(48 * deg), 2));
    for (const double t : {0.0, 5000.0, 70000.0}) {
        model.update({static_cast<sim::Ns>(t) * second, second});
        const double lon = 11.0 * deg + i.par.spin * t;
        const Vector3d r((N + 600.0) * std::cos(48 * deg) * std::cos(lon),
                         (N + 600.0) * std::cos(48 * deg) * std::sin(lon),
                         (N * (1.0 - e2) + 600.0) * std::sin(48 * deg));
        const Vector3d spin(0, 0, i.par.spin);
        EXPECT_LT((view(i.out.state.r_PN_N) - r).norm(), 1e-4);
        EXPECT_LT((view(i.out.state.v_PN_N) - spin.cross(r)).norm(), 1e-8);
        EXPECT_LT((view(i.out.state.a_PN_N) - spin.cross(spin.cross(r))).norm(), 1e-12);
        EXPECT_EQ(i.out.state.head.quality, QUALITY_GOOD);
    }
    // Another rate counts at once, also at an instant that has been computed.
    i.par.spin = 0.0;
    model.refresh();
    model.update({70000 * second, second});
    EXPECT_NEAR(i.out.state.r_PN_N.v[1] / i.out.state.r_PN_N.v[0], std::tan(11.0 * deg), 1e-12);
    EXPECT_EQ(view(i.out.state.v_PN_N).norm(), 0.0);
}

TEST_F(Station, SeesACraftInDirectionAndDistance)
{
    prepare();
    std::mt19937 random(1);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int round = 0; round < 300; round++) {
        const double t = 100.0 * round, azimuth = 2 * pi * share(random), elevation = pi * (share(random) - 0.5);
        const double range = 1e5 + 1e7 * share(random);
        model.update({100 * round * second, second});
        const Vector3d r_S = view(i.out.state.r_PN_N);
        const Vector3d way =
            range * (std::cos(elevation) * (std::cos(azimuth) * north(t) + std::sin(azimuth) * east(t)) +
                     std::sin(elevation) * up(t));
        const Vector3d v(7000.0 * share(random), -3000.0, 1000.0 * share(random));
        const GroundContact &contact = sees(r_S + way, v, 100 * round * second);
        EXPECT_NEAR(contact.range, range, 1e-6);
        EXPECT_NEAR(contact.elevation, elevation, 1e-9);
        EXPECT_NEAR(std::remainder(contact.azimuth - azimuth, 2 * pi), 0.0, 1e-9 / std::cos(elevation));
        EXPECT_GE(contact.azimuth, 0.0);
        EXPECT_EQ(contact.visible, elevation >= 10.0 * deg);
        // The range's rate is its derivative.
        const double h = 0.01;
        const auto at = [&](double dt) {
            GroundStation j = i;
            GroundStationModel other(j);
            other.set_body(model.bodies()[0]);
            j.par.longitude += i.par.spin * (t + dt);
            other.prepare({"world.other", 1, nullptr});
            other.reset(0);
            return (Vector3d(view(j.out.state.r_PN_N)) - (r_S + way + dt * v)).norm();
        };
        if (round % 30 == 0) {
            EXPECT_NEAR(contact.range_rate, (at(h) - at(-h)) / (2 * h), 1e-5);
        }
    }
}

TEST_F(Station, HasNoContactBeforeTheCraftHasAState)
{
    i.in.truth.head.quality = QUALITY_NONE;
    prepare();
    model.update({second, second});
    EXPECT_EQ(i.out.contact.head.quality, QUALITY_NONE);
    EXPECT_EQ(i.out.state.head.quality, QUALITY_GOOD);
}

} // namespace ground_station_model_test
} // namespace fledge::world
