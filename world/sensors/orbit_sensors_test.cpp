// SPDX-License-Identifier: Apache-2.0
// Receivers of navigation satellites, and sensors of other spacecraft.
#include "world/sensors/craft_sensor_model.h"
#include "world/sensors/gps_receiver_model.h"
#include "world/testing/sensing.h"

namespace orbit_sensors_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

using Receiver = Bench<GpsReceiver, GpsReceiverModel>;
using Camera = Bench<CraftSensor, CraftSensorModel>;

TEST(GpsReceiver, ItsAntennaMovesWithTheBody)
{
    Receiver g;
    g.i.par.r_AB_B = vec3(0.5, -1.0, 2.0);
    g.begin();
    g.i.in.truth.r_BN_N = vec3(7e6, 1e5, -2e5);
    g.i.in.truth.v_BN_N = vec3(10, 7500, 300);
    g.i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
    g.i.in.truth.omega_BN_B = vec3(0.3, -0.2, 0.4);
    g.step(second);
    const Mat3 C_BN = mrp_to_dcm(g.i.in.truth.sigma_BN);
    const Matrix3d C_NB = view(C_BN).transpose();
    const Vector3d arm(0.5, -1.0, 2.0), omega(0.3, -0.2, 0.4);
    EXPECT_LT((view(g.i.out.orbit.r_BN_N) - (view(g.i.in.truth.r_BN_N) + C_NB * arm)).norm(), 1e-9);
    EXPECT_LT((view(g.i.out.orbit.v_BN_N) - (view(g.i.in.truth.v_BN_N) + C_NB * omega.cross(arm))).norm(), 1e-12);
    EXPECT_EQ(g.i.out.orbit.a_BN_N.v[1], 0.0);
}

TEST(GpsReceiver, NoiseHasItsDeviations)
{
    Receiver g;
    g.i.par.position_noise = vec3(1, 2, 3);
    g.i.par.velocity_noise = vec3(0.1, 0.2, 0.3);
    g.begin();
    std::array<Sample, 6> samples;
    for (int k = 0; k < 3000; k++) {
        g.step(second);
        for (std::size_t i = 0; i < 3; i++) {
            samples[i].add(g.i.out.orbit.r_BN_N.v[i]);
            samples[3 + i].add(g.i.out.orbit.v_BN_N.v[i]);
        }
    }
    for (std::size_t i = 0; i < 3; i++) {
        const double s = static_cast<double>(i + 1);
        EXPECT_TRUE(samples[i].is_normal(s * s));
        EXPECT_TRUE(samples[3 + i].is_normal(0.01 * s * s));
    }
}

TEST(GpsReceiver, ItsErrorWandersWithItsCorrelationWhateverThePeriodIs)
{
    // Over many seeds: the variance is that at any time, and two times apart by T correlate by 1 / e.
    for (const Ns dt : {second, 5 * second}) {
        Sample begins, ends, differences;
        for (std::uint64_t seed = 0; seed < 700; seed++) {
            Receiver g;
            g.i.par.wander = vec3(5, 5, 5);
            g.i.par.wander_time = 60.0;
            g.begin(seed);
            const Vec3 first = g.i.out.orbit.r_BN_N;
            while (g.t < 60 * second) {
                g.step(dt);
            }
            for (int i = 0; i < 3; i++) {
                begins.add(first.v[i]);
                ends.add(g.i.out.orbit.r_BN_N.v[i]);
                differences.add(g.i.out.orbit.r_BN_N.v[i] - first.v[i]);
            }
        }
        EXPECT_TRUE(begins.is_normal(25.0));
        EXPECT_TRUE(ends.is_normal(25.0));
        EXPECT_TRUE(differences.is_normal(2.0 * 25.0 * (1.0 - std::exp(-1.0))));
    }
    Receiver constant;
    constant.i.par.wander = vec3(5, 5, 5);
    constant.begin();
    const double drawn = constant.i.out.orbit.r_BN_N.v[0];
    constant.step(1000 * second);
    EXPECT_EQ(constant.i.out.orbit.r_BN_N.v[0], drawn);
}

TEST(GpsReceiver, AFixComesLateAndFaultsHaveTheirChannels)
{
    Receiver g;
    g.i.par.latency = 2.0;
    g.fault(FAULT_BIAS, 1u << 2, 100.0);
    g.fault(FAULT_BIAS, 1u << 4, 1.0);
    g.begin();
    for (int k = 1; k < 10; k++) {
        g.i.in.truth.r_BN_N = vec3(k, k, k);
        g.step(second);
        if (k > 2) {
            EXPECT_EQ(g.i.out.orbit.head.t, (k - 2) * second);
            EXPECT_EQ(g.i.out.orbit.r_BN_N.v[0], k - 2);
            EXPECT_EQ(g.i.out.orbit.r_BN_N.v[2], k + 98);
            EXPECT_EQ(g.i.out.orbit.v_BN_N.v[1], 1.0);
        }
    }
}

/// A camera at some attitude, with another craft 1 km away in its direction z.
struct Scene : Camera {
    Matrix3d C_BN;

    Scene()
    {
        i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
        i.in.truth.omega_BN_B = vec3(0.01, 0.02, 0.03);
        i.in.truth.r_BN_N = vec3(1e3, 2e3, 3e3);
        i.in.truth.v_BN_N = vec3(1, 2, 3);
        i.in.other.head.quality = QUALITY_GOOD;
        i.in.other.sigma_BN = vec3(-0.5, 0.1, 0.3);
        i.in.other.omega_BN_B = vec3(-0.03, 0.01, 0.02);
        i.in.other.v_BN_N = vec3(1.5, 1, 3);
        const Mat3 dcm = mrp_to_dcm(i.in.truth.sigma_BN);
        C_BN = view(dcm);
        place(Vector3d(0, 0, 1000));
    }
    void place(const Vector3d &r_B) { i.in.other.r_BN_N = vec(view(i.in.truth.r_BN_N) + C_BN.transpose() * r_B); }
};

TEST(CraftSensor, SeesPositionAndAttitudeRelativeToItsBody)
{
    Scene c;
    c.begin();
    c.step(second);
    const SeenCraft &seen = c.i.out.seen;
    const Mat3 C_TN = mrp_to_dcm(c.i.in.other.sigma_BN), read = mrp_to_dcm(seen.sigma_TB);
    const Matrix3d C_TB = view(C_TN) * c.C_BN.transpose();
    EXPECT_LT((view(seen.r_TB_B) - Vector3d(0, 0, 1000)).norm(), 1e-9);
    EXPECT_LT((view(seen.v_TB_B) - c.C_BN * Vector3d(0.5, -1, 0)).norm(), 1e-12);
    EXPECT_LT((view(read) - C_TB).norm(), 1e-14);
    const Vector3d rate = C_TB.transpose() * view(c.i.in.other.omega_BN_B) - view(c.i.in.truth.omega_BN_B);
    EXPECT_LT((view(seen.omega_TB_B) - rate).norm(), 1e-15);
    EXPECT_EQ(seen.head.quality, QUALITY_GOOD);
}

TEST(CraftSensor, NoiseOfThePositionIsOfRangeAndBearing)
{
    Scene c;
    c.i.par.range_noise = 0.5;
    c.i.par.range_share = 1e-3;
    c.i.par.bearing_noise = 2e-4;
    c.i.par.velocity_noise = 0.01;
    c.i.par.attitude_noise = 1e-3;
    c.i.par.rate_noise = 1e-4;
    c.begin();
    const Vec3 sigma = mrp_relative(c.i.in.other.sigma_BN, c.i.in.truth.sigma_BN);
    const Vector3d v = c.C_BN * Vector3d(0.5, -1, 0);
    Sample range, bearing, speed, turn;
    for (int k = 0; k < 3000; k++) {
        c.step(second);
        range.add(c.i.out.seen.r_TB_B.v[2] - 1000.0);
        bearing.add(c.i.out.seen.r_TB_B.v[0]);
        speed.add(c.i.out.seen.v_TB_B.v[1] - v[1]);
        turn.add(4.0 * mrp_relative(c.i.out.seen.sigma_TB, sigma).v[1]);
    }
    EXPECT_TRUE(range.is_normal(1.5 * 1.5));
    EXPECT_TRUE(bearing.is_normal(0.2 * 0.2));
    EXPECT_TRUE(speed.is_normal(1e-4));
    EXPECT_TRUE(turn.is_normal(1e-6));
}

TEST(CraftSensor, HasAViewAndARange)
{
    Scene c;
    c.i.par.boresight_B = vec3(0, 0, 3);
    c.i.par.view = 0.5;
    c.i.par.range_max = 2000.0;
    c.begin();
    const auto sees = [&](double distance, double angle) {
        c.place(distance * Vector3d(std::sin(angle), 0, std::cos(angle)));
        const std::uint32_t before = c.i.out.seen.head.sequence;
        c.step(second);
        return c.i.out.seen.head.sequence != before;
    };
    EXPECT_TRUE(sees(1000, 0.49));
    EXPECT_FALSE(sees(1000, 0.51));
    EXPECT_TRUE(sees(1999, 0));
    EXPECT_FALSE(sees(2001, 0));
    c.i.par.view = 0.0; // the whole hemisphere
    EXPECT_TRUE(sees(1000, 1.57));
    EXPECT_FALSE(sees(1000, 1.58));
    c.i.par.boresight_B = {}; // everywhere
    EXPECT_TRUE(sees(1000, 3.0));
}

TEST(CraftSensor, FaultsHaveTheirChannels)
{
    Scene c;
    c.fault(FAULT_BIAS, 1u << 7, 0.1); // about the second axis of T
    c.fault(FAULT_DEAD, 7u);
    c.begin();
    c.step(second);
    const Vec3 turn = mrp_relative(c.i.out.seen.sigma_TB, mrp_relative(c.i.in.other.sigma_BN, c.i.in.truth.sigma_BN));
    EXPECT_LT((view(turn) - Vector3d(0, std::tan(0.025), 0)).norm(), 1e-15);
    EXPECT_EQ(view(c.i.out.seen.r_TB_B).norm(), 0.0);
    EXPECT_EQ(c.i.out.seen.head.quality, QUALITY_GOOD) << "something of it speaks";
}

} // namespace orbit_sensors_test
