// SPDX-License-Identifier: Apache-2.0
// The electronics of star trackers and gyros: what they hold, against Eigen's rotations and sums of angles.
#include "world/avionics/gyro_electronics_model.h"
#include "world/avionics/star_tracker_electronics_model.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <random>

namespace sensor_electronics_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

template <class Interface, class Model> struct Unit {
    Interface i{};
    Model model{i};
    Ns t = 0;

    Unit()
    {
        i.par.tick = ms;
        i.par.load = 3;
        model.prepare({"world.electronics", 1, nullptr});
        model.reset(0);
    }
    void step(Ns dt = 100 * ms)
    {
        t += dt;
        model.update({t, dt});
    }
    void power(bool on)
    {
        i.in.power.head.quality = QUALITY_GOOD;
        i.in.power.on = on ? 1u << 3 : 0u;
    }
};

struct Tracker : Unit<StarTrackerElectronics, StarTrackerElectronicsModel> {
    Tracker()
    {
        i.par.bits = 24;
        i.par.residual = 1e-6;
        i.par.lost_after = 500 * ms;
    }
    const StarTrackerRegisters &out() const { return i.out.registers; }
    void see(const Vec3 &sigma, Ns latency = 0)
    {
        i.in.attitude.head = head_next(i.in.attitude.head, t + 100 * ms - latency, QUALITY_GOOD);
        i.in.attitude.sigma_BN = sigma;
        step();
    }
};

TEST(StarTrackerElectronics, AQuaternionIsItsNearestCounts)
{
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    Tracker s;
    s.i.par.sigma_SB = vec3(0.1, -0.3, 0.2);
    const Mat3 mount = mrp_to_dcm(s.i.par.sigma_SB);
    for (int k = 0; k < 500; k++) {
        const Vec3 sigma = mrp_turn(vec3(normal(random), normal(random), normal(random)));
        s.see(sigma, 30 * ms);
        const Mat3 dcm = mrp_to_dcm(sigma);
        // Eigen's quaternion turns vectors, a DCM turns frames.
        Eigen::Quaterniond wanted((view(mount) * view(dcm)).transpose());
        const double sign = wanted.w() < 0 ? -1.0 : 1.0, full = (1 << 23) - 1;
        const double parts[] = {wanted.w(), wanted.x(), wanted.y(), wanted.z()};
        for (std::size_t j = 0; j < 4; j++) {
            ASSERT_NEAR(s.out().q[j], sign * full * parts[j], 0.5 + 1e-6) << k;
        }
        EXPECT_EQ(s.out().time, static_cast<std::uint32_t>(s.t / ms - 30));
        EXPECT_EQ(s.out().counter, static_cast<std::uint32_t>(k + 1));
        EXPECT_EQ(s.out().tracks, 1u);
    }
}

TEST(StarTrackerElectronics, TheResidualIsThatAcrossTheBoresight)
{
    Tracker s;
    s.i.par.sigma_SB = vec3(std::tan(M_PI / 8), 0, 0); // the boresight is B's second axis, or against it
    s.i.in.attitude.P_B.m[0][0] = s.i.in.attitude.P_B.m[2][2] = 25e-12;
    s.i.in.attitude.P_B.m[1][1] = 1600e-12;
    s.see(vec3(0, 0, 0));
    EXPECT_EQ(s.out().residual, 5u);
}

TEST(StarTrackerElectronics, ABlindTrackerNoLongerTracksAndWithoutPowerItStandsStill)
{
    Tracker s;
    s.step();
    EXPECT_EQ(s.out().tracks, 0u);
    s.see(vec3(0, 0, 0));
    for (int k = 1; k <= 8; k++) {
        s.step();
        EXPECT_EQ(s.out().tracks, k <= 5) << k;
        EXPECT_EQ(s.out().counter, 1u);
    }
    s.see(vec3(0, 0, 0));
    s.power(false);
    s.see(vec3(0.5, 0, 0));
    EXPECT_EQ(s.out().counter, 2u);
    EXPECT_EQ(s.out().q[1], 0);
    s.power(true);
    s.step();
    EXPECT_EQ(s.out().counter, 2u) << "what came without power is gone";
    s.see(vec3(0.5, 0, 0));
    EXPECT_EQ(s.out().counter, 3u);
}

struct Gyros : Unit<GyroElectronics, GyroElectronicsModel> {
    Gyros()
    {
        i.par.bits = 16;
        i.par.scale = 1e-5;
    }
    const GyroRegisters &out() const { return i.out.registers; }
    void turn(const Vec3 &rate)
    {
        i.in.rate.head = head_next(i.in.rate.head, t + 100 * ms, QUALITY_GOOD);
        i.in.rate.omega_BN_B = rate;
        step();
    }
};

TEST(GyroElectronics, CountsAreTheAngleTurnedAroundTheirRange)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> speed(-0.5, 0.7);
    Gyros g;
    g.turn(vec3(1, 1, 1)); // since when angles are summed up
    EXPECT_EQ(g.out().angle[0], 0u);
    double angle = 0.0, most = 0.0;
    for (int k = 0; k < 5000; k++) {
        const double rate = speed(random);
        angle += 0.1 * rate;
        most = std::max(most, angle);
        g.turn(vec3(rate, -rate, 0));
        const double counts = std::fmod(angle / 1e-5, 65536.0);
        const double off = std::remainder(g.out().angle[0] - counts, 65536.0);
        const double other = std::remainder(g.out().angle[1] + counts, 65536.0);
        ASSERT_LE(std::abs(off), 0.5 + 1e-6) << k;
        ASSERT_LE(std::abs(other), 0.5 + 1e-6) << k;
        ASSERT_LT(g.out().angle[0], 65536u);
        EXPECT_EQ(g.out().time, static_cast<std::uint32_t>(g.t / ms));
    }
    EXPECT_GT(most, 10 * 0.65536);
    EXPECT_EQ(g.out().angle[2], 0u);
}

TEST(GyroElectronics, ATurnWithoutSamplesCountsAtTheNextAndOneWithoutPowerIsLost)
{
    Gyros g;
    g.turn(vec3(0.1, 0, 0));
    for (int k = 0; k < 9; k++) {
        g.step();
    }
    EXPECT_EQ(g.out().counter, 1u);
    g.turn(vec3(0.1, 0, 0));
    EXPECT_EQ(g.out().angle[0], 10000u);
    EXPECT_EQ(g.out().counter, 2u);
    g.power(false);
    g.turn(vec3(0.1, 0, 0));
    EXPECT_EQ(g.out().angle[0], 10000u);
    g.power(true);
    g.turn(vec3(0.1, 0, 0));
    EXPECT_EQ(g.out().angle[0], 0u);
    EXPECT_EQ(g.out().counter, 1u);
    g.turn(vec3(0.1, 0, 0));
    EXPECT_EQ(g.out().angle[0], 1000u);
}

} // namespace sensor_electronics_test
