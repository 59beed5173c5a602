// SPDX-License-Identifier: Apache-2.0
// Star trackers and fine sun sensors.
#include "world/environment/testing/shine.h"
#include "world/sensors/star_tracker_model.h"
#include "world/sensors/sun_sensor_model.h"
#include "world/testing/sensing.h"

#include <cstring>

namespace attitude_sensors_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

struct Tracker : Bench<StarTracker, StarTrackerModel> {
    Tracker() { i.par.boresight_B = vec3(0, 0, 2); }

    const StarAttitude &out() const { return i.out.attitude; }
    bool fresh(Ns dt = 100 * ms)
    {
        const std::uint32_t before = out().head.sequence;
        step(dt);
        return out().head.sequence != before;
    }
    /// How the reading is turned from the truth, B components.
    Vector3d turn() const
    {
        const Vec3 sigma = mrp_relative(out().sigma_BN, i.in.truth.sigma_BN);
        const double length = vec_norm(sigma);
        return length > 0.0 ? Vector3d(4.0 * std::atan(length) / length * view(sigma)) : Vector3d(Vector3d::Zero());
    }
    /// Look into the direction of the angle from the z axis of N, about x.
    void look(double angle) { i.in.truth.sigma_BN = vec3(std::tan(-angle / 4.0), 0, 0); }
};

TEST(StarTracker, WithoutErrorsItGivesTheTruth)
{
    Tracker s;
    s.begin();
    s.i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
    s.step(second);
    EXPECT_LT(s.turn().norm(), 1e-15);
    EXPECT_EQ(s.out().head.t, second);
    EXPECT_EQ(s.out().head.quality, QUALITY_GOOD);
}

TEST(StarTracker, WithoutPowerItIsSilent)
{
    Tracker s;
    s.i.par.load = 9;
    s.begin();
    EXPECT_TRUE(s.fresh()) << "where no supply is wired";
    s.i.in.power.head.quality = QUALITY_GOOD;
    s.i.in.power.on = ~(1u << 9);
    EXPECT_FALSE(s.fresh());
    s.i.in.power.on = 1u << 9;
    EXPECT_TRUE(s.fresh());
}

TEST(StarTracker, NoiseIsThatOfItsDensityAcrossAndAboutTheBoresight)
{
    for (const Ns dt : {100 * ms, second}) {
        Tracker s;
        s.i.par.boresight_B = vec3(1, 2, -2);
        s.i.par.noise_across = 1e-10;
        s.i.par.noise_about = 4e-9;
        s.i.par.deviation_across = 1e-5;
        s.begin();
        s.i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
        const Vector3d boresight = Vector3d(1, 2, -2) / 3.0, side = Vector3d(2, -1, 0) / std::sqrt(5.0);
        const Vector3d other = boresight.cross(side);
        const double across = 1e-10 + 1e-10 / tick_seconds(dt), about = 4e-9 / tick_seconds(dt);
        Sample along, first, second_axis, crossed;
        for (int k = 0; k < 4000; k++) {
            s.step(dt);
            const Vector3d turn = s.turn();
            along.add(turn.dot(boresight));
            first.add(turn.dot(side));
            second_axis.add(turn.dot(other));
            crossed.add(turn.dot(side) * turn.dot(boresight));
        }
        EXPECT_TRUE(first.is_normal(across));
        EXPECT_TRUE(second_axis.is_normal(across));
        EXPECT_TRUE(along.is_normal(about));
        EXPECT_NEAR(crossed.mean(), 0.0, 4.0 * std::sqrt(across * about / 4000));
        // The tracker's own covariance says the same.
        const Matrix3d P = view(s.out().P_B);
        EXPECT_NEAR(boresight.dot(P * boresight), about, 1e-12 * about);
        EXPECT_NEAR(side.dot(P * side), across, 1e-12 * across);
        EXPECT_NEAR(side.dot(P * boresight), 0.0, 1e-12 * across);
    }
}

TEST(StarTracker, AMisalignmentTurnsTheReadingAndTheBoresight)
{
    Tracker s;
    s.i.par.misalignment = vec3(0.1, 0, 0);
    s.i.par.s_N = vec3(0, 0, 1);
    s.i.par.sun_exclusion = 0.05;
    s.begin();
    s.i.in.truth.sigma_BN = vec3(0, 0, 0);
    s.step(second);
    EXPECT_LT((s.turn() - Vector3d(0.1, 0, 0)).norm(), 1e-15);
    // The case turns by 0.1 about x, so that it looks at -y of B; a body turned back sees the Sun.
    s.i.in.truth.sigma_BN = vec3(std::tan(-0.1 / 4.0), 0, 0);
    s.step(second);
    EXPECT_EQ(s.i.mem.blind, 1u);
}

TEST(StarTracker, BrightBodiesBlindItWithinTheirAngles)
{
    // The boresight sweeps from z to -z of N; a body stands in z.
    for (double angle = 0.005; angle < 3.14; angle += 0.01) {
        Tracker s;
        s.i.par.sun_exclusion = 0.5;
        s.i.par.planet_exclusion = 0.3;
        s.i.par.planet_radius = 6e6;
        s.i.par.moon_exclusion = 0.1;
        s.i.par.moon_radius = 2e6;
        s.i.par.s_N = vec3(0, 0, 1);
        s.i.in.truth.r_BN_N = vec3(0, 0, -1e7); // the planet is at the origin of N
        s.wired = {"moon"};                     // but says nothing yet
        s.begin();
        s.look(angle);
        const bool sun = angle < 0.5, planet = angle < 0.3 + std::asin(0.6), moon = angle < 0.1 + std::asin(0.2);
        EXPECT_EQ(s.fresh(), !(sun || planet));
        EXPECT_EQ(s.i.mem.blind, (sun ? 1u : 0u) | (planet ? 2u : 0u)) << angle;

        // Wired bodies count where they are: the Sun elsewhere, the planet too, a moon in their place.
        s.i.in.sun.head.quality = s.i.in.planet.head.quality = s.i.in.moon.head.quality = QUALITY_GOOD;
        s.i.in.sun.r_PN_N = vec3(1e11, 0, 0);
        s.i.in.planet.r_PN_N = vec3(-1e8, 0, -1e7);
        s.i.in.moon.r_PN_N = vec3(0, 0, 0);
        EXPECT_EQ(s.fresh(), !moon);
        EXPECT_EQ(s.i.mem.blind, moon ? 4u : 0u) << angle;
    }
}

TEST(StarTracker, ItMeasuresUpToItsRate)
{
    Tracker s;
    s.i.par.rate_max = 0.01;
    s.begin();
    s.i.in.truth.omega_BN_B = vec3(0.006, 0, 0.0079);
    EXPECT_TRUE(s.fresh());
    s.i.in.truth.omega_BN_B = vec3(0.006, 0, 0.0081);
    EXPECT_FALSE(s.fresh());
    EXPECT_EQ(s.i.mem.blind, 8u);
    EXPECT_EQ(s.out().head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(s.out().head.t, 100 * ms);
}

TEST(StarTracker, LossesHaveTheirRateAndDurationWhateverThePeriodIs)
{
    // On and off by two rates a and b: off in a share of a / (a + b); a loss lasts for 1 / b.
    const double a = 0.05, b = 0.2;
    for (const Ns dt : {100 * ms, second}) {
        int lost = 0, losses = 0, updates = 0;
        for (std::uint64_t seed = 0; seed < 4; seed++) {
            Tracker s;
            s.i.par.loss_rate = a;
            s.i.par.loss_time = 1.0 / b;
            s.begin(seed);
            bool last = false;
            while (s.t < 3000 * second) {
                const bool now = !s.fresh(dt);
                lost += now;
                losses += now && !last;
                last = now;
                updates++;
            }
        }
        // In 12,000 s there are 480 losses.
        const double share = lost / static_cast<double>(updates);
        EXPECT_NEAR(share, a / (a + b), 4 * std::sqrt(2 * 0.2 * 0.8 / (a + b) / 12000)) << dt;
        const double p = 1 - std::exp(-a * tick_seconds(dt)), q = 1 - std::exp(-b * tick_seconds(dt));
        const double expected = updates * p * q / (p + q);
        EXPECT_NEAR(losses, expected, 4 * std::sqrt(expected)) << dt;
    }
}

TEST(StarTracker, AReadingComesLateWithItsOwnTime)
{
    for (const double latency : {0.0, 0.1, 0.25, 3.0}) {
        Tracker s;
        s.i.par.latency = latency;
        s.begin();
        for (int k = 1; k < 100; k++) {
            s.i.in.truth.sigma_BN = vec3(0.001 * k, 0, 0);
            s.step(100 * ms);
            const int whole = static_cast<int>(std::ceil(latency / 0.1 - 1e-9));
            if (k >= whole) {
                ASSERT_EQ(s.out().head.t, (k - whole) * 100 * ms) << latency;
                ASSERT_NEAR(s.out().sigma_BN.v[0], 0.001 * (k - whole), 1e-15);
                ASSERT_EQ(s.out().head.quality, QUALITY_GOOD);
            } else {
                ASSERT_EQ(s.out().head.quality, QUALITY_NONE);
            }
        }
        // What was measured before it went blind still comes.
        s.i.par.rate_max = 0.1;
        s.i.in.truth.omega_BN_B = vec3(1, 0, 0);
        int came = 0;
        for (int k = 0; k < 40; k++) {
            came += s.fresh();
        }
        EXPECT_EQ(came, static_cast<int>(std::ceil(latency / 0.1 - 1e-9)));
        EXPECT_EQ(s.out().head.t, 9900 * ms);
    }
}

TEST(StarTracker, FaultsTurnOrReplaceTheAttitude)
{
    Tracker s;
    s.fault(FAULT_BIAS, 2, 0.1);
    s.begin();
    s.i.in.truth.sigma_BN = vec3(0.2, -0.3, 0.4);
    s.step(second);
    EXPECT_LT((s.turn() - Vector3d(0, 0.1, 0)).norm(), 1e-15);
    s.i.par.faults[0].kind = FAULT_HIGH;
    s.step(second);
    EXPECT_EQ(s.out().sigma_BN.v[1], 1.0);
    s.i.par.faults[0] = {FAULT_DEAD, 0, 0.0, 0, 0};
    EXPECT_FALSE(s.fresh());
}

struct Sun : Bench<SunSensor, SunSensorModel> {
    Sun()
    {
        i.par.boresight_B = vec3(0, 0, 1);
        i.par.view = 1.0;
        i.par.s_N = vec3(0, 0, 5);
    }
    Vector3d s() const { return view(i.out.heading.s_B); }
};

TEST(SunSensor, GivesTheDirectionWithinItsView)
{
    Sun sun;
    sun.begin();
    for (double angle = 0.005; angle < 3.14; angle += 0.01) {
        sun.i.in.truth.sigma_BN = vec3(std::tan(angle / 4.0), 0, 0);
        const std::uint32_t before = sun.i.out.heading.head.sequence;
        sun.step(ms);
        EXPECT_EQ(sun.i.out.heading.head.sequence > before, angle < 1.0) << angle;
        if (angle < 1.0) {
            EXPECT_LT((sun.s() - Vector3d(0, std::sin(angle), std::cos(angle))).norm(), 1e-14);
        }
    }
    EXPECT_EQ(sun.i.out.heading.head.quality, QUALITY_DEGRADED);
}

TEST(SunSensor, IsBlindInShadow)
{
    Sun sun;
    sun.i.par.visible_min = 0.2;
    sun.begin();
    for (const double visible : {1.0, 0.21, 0.19, 0.0}) {
        sun.i.in.light.head.quality = QUALITY_GOOD;
        sun.i.in.light.visible = visible;
        sun.i.in.light.s_N = vec3(0, 0, 1);
        const std::uint32_t before = sun.i.out.heading.head.sequence;
        sun.step(ms);
        EXPECT_EQ(sun.i.out.heading.head.sequence > before, visible > 0.2);
    }
    sun.i.par.visible_min = 0.0;
    sun.step(ms);
    EXPECT_EQ(sun.i.out.heading.head.quality, QUALITY_DEGRADED) << "nothing of the Sun is too little in any case";
}

TEST(SunSensor, TheLightSaysWhereTheSunIsAndTheSunItselfComesFirst)
{
    Sun sun;
    sun.begin();
    sun.i.in.light.head.quality = QUALITY_GOOD;
    sun.i.in.light.visible = 1.0;
    sun.i.in.light.s_N = vec3(0, std::sin(0.3), std::cos(0.3));
    sun.step(ms);
    EXPECT_LT((sun.s() - view(sun.i.in.light.s_N)).norm(), 1e-15);
    sun.i.in.sun.head.quality = QUALITY_GOOD;
    sun.i.in.sun.r_PN_N = vec3(3e11, 0, 4e11);
    sun.step(ms);
    EXPECT_LT((sun.s() - Vector3d(0.6, 0, 0.8)).norm(), 1e-15);
}

TEST(SunSensor, APlanetInViewDrawsTheDirection)
{
    Shine shine;
    shine.i.par.albedo = 0.3;
    shine.prepare();
    Sun sun;
    const Vector3d r(0.3 * Shine::R, -1.2 * Shine::R, 0.0), boresight(0.6, 0.8, 0.0);
    sun.model.set_source(shine.model);
    sun.i.in.truth.r_BN_N = vec(r);
    sun.i.par.boresight_B = vec(boresight);
    sun.i.par.s_N = vec3(1, 0, 0);
    sun.begin();
    for (const double rejection : {0.0, 0.9, 1.0}) {
        sun.i.par.rejection = rejection;
        sun.step(ms);
        Vector3d sum(1, 0, 0);
        int in_view = 0;
        for (const auto &element : shine.model.at(0, 0.0, r)) {
            if (element.reflected > 0.0 && boresight.dot(element.towards_N) > std::cos(1.0)) {
                sum += (1.0 - rejection) * element.reflected / Shine::E * element.towards_N;
                in_view++;
            }
        }
        EXPECT_GT(in_view, 3);
        EXPECT_LT(in_view, 16);
        EXPECT_LT((sun.s() - sum.normalized()).norm(), 1e-14);
        EXPECT_EQ(sun.s()[1] > 0.01, rejection == 0.0);
    }
    sun.i.in.light.head.quality = QUALITY_GOOD;
    sun.i.in.light.s_N = vec3(1, 0, 0);
    const std::uint32_t before = sun.i.out.heading.head.sequence;
    sun.step(ms); // nothing of the Sun is visible
    EXPECT_EQ(sun.i.out.heading.head.sequence, before);
}

TEST(SunSensor, NoiseIsAnAngleAcrossTheDirection)
{
    for (const Ns dt : {100 * ms, second}) {
        Sun sun;
        sun.i.par.noise = 1e-8;
        sun.i.par.deviation = 1e-4;
        sun.begin();
        Sample x, y;
        for (int k = 0; k < 4000; k++) {
            sun.step(dt);
            x.add(std::asin(sun.s()[0]));
            y.add(std::asin(sun.s()[1]));
            ASSERT_NEAR(sun.s().norm(), 1.0, 1e-14);
        }
        EXPECT_TRUE(x.is_normal(1e-8 + 1e-8 / tick_seconds(dt)));
        EXPECT_TRUE(y.is_normal(1e-8 + 1e-8 / tick_seconds(dt)));
    }
}

} // namespace attitude_sensors_test
