// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/coarse_sun_sensors_model.h"

#include "world/environment/testing/shine.h"
#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <random>

namespace coarse_sun_sensors_model_test {

using namespace fledge::world;
using namespace fledge::world::testing;

struct Sensors {
    CoarseSunSensors i{};
    CoarseSunSensorsModel model{i};

    /// Along the corners of a cube, so that opposite ones share the Sun.
    Sensors()
    {
        i.par.n = 8;
        for (unsigned k = 0; k < 8; k++) {
            i.par.axes_B[k] = vec3(k & 1 ? 2.0 : -2.0, k & 2 ? 2.0 : -2.0, k & 4 ? 2.0 : -2.0);
            i.par.current[k] = 1e-3 * (k + 1);
        }
        i.in.truth.head.quality = QUALITY_GOOD;
        i.par.s_N = vec3(0, 0, 3);
    }
    double current(std::size_t k)
    {
        model.update({0, 0});
        return i.out.currents.current[k];
    }
    Vector3d axis(std::size_t k) { return Vector3d(view(i.par.axes_B[k])).normalized(); }
};

TEST(CoarseSunSensors, TheCurrentFollowsTheCosineOfTheAngleToTheSun)
{
    // Against a rotation by Eigen, which shares no code with the model's.
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (int round = 0; round < 300; round++) {
        Sensors s;
        const Eigen::Quaterniond q =
            Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
        const Vector3d sun(normal(random), normal(random), normal(random));
        const Vector3d sigma = q.vec() / (1.0 + q.w());
        s.i.in.truth.sigma_BN = vec3(sigma[0], sigma[1], sigma[2]);
        s.i.par.s_N = vec3(sun[0], sun[1], sun[2]);
        const Vector3d s_B = q.inverse() * sun.normalized();
        s.model.update({0, 0});
        Vector3d sum = Vector3d::Zero();
        for (std::size_t k = 0; k < 8; k++) {
            const double cosine = s.axis(k).dot(s_B);
            ASSERT_NEAR(s.i.out.currents.current[k], s.i.par.current[k] * std::max(cosine, 0.0), 1e-15);
            sum += 0.75 * s.i.out.currents.current[k] / s.i.par.current[k] * s.axis(k);
        }
        EXPECT_LT((sum - s_B).norm(), 1e-12) << "of opposite sensors each gives its half of 4/3 s";
    }
}

TEST(CoarseSunSensors, BeyondItsFieldOfViewASensorIsDark)
{
    Sensors s;
    s.i.par.axes_B[0] = vec3(0, 0, 1);
    s.i.par.view[0] = 1.0;
    for (double angle = 0.0; angle < 3.1; angle += 0.01) {
        s.i.par.s_N = vec3(std::sin(angle), 0, std::cos(angle));
        EXPECT_NEAR(s.current(0), angle < 1.0 ? 1e-3 * std::cos(angle) : 0.0, 1e-15) << angle;
        s.i.par.view[0] = 0.0;
        EXPECT_NEAR(s.current(0), angle < M_PI / 2 ? 1e-3 * std::cos(angle) : 0.0, 1e-15) << angle;
        s.i.par.view[0] = 1.0;
    }
}

TEST(CoarseSunSensors, AWiredSunIsSeenFromWhereTheCraftIs)
{
    Sensors s;
    s.i.in.sun.head.quality = QUALITY_GOOD;
    s.i.in.sun.r_PN_N = vec3(1e11, 1e11, 1e11);
    s.i.in.truth.r_BN_N = vec3(1e11, 1e11, 0);
    s.i.par.s_N = vec3(1, 0, 0);
    EXPECT_NEAR(s.current(4), 5e-3 / std::sqrt(3.0), 1e-15); // it stands along +z
    s.i.in.sun.head.quality = QUALITY_STALE;
    s.current(4);
    EXPECT_EQ(s.i.out.currents.head.quality, QUALITY_DEGRADED);
}

TEST(CoarseSunSensors, AFaultIsOfItsSensorAndWithinItsCurrents)
{
    Sensors sound, faulty;
    faulty.i.par.n_faults = 3;
    faulty.i.par.faults[0] = {FAULT_HIGH, 1, 0.0, 0, 0};
    faulty.i.par.faults[1] = {FAULT_DEAD, 1u << 7, 0.0, 0, 0};
    faulty.i.par.faults[2] = {FAULT_BIAS, 1u << 6, 1.0, 0, 0};
    for (std::size_t k = 0; k < 8; k++) {
        EXPECT_EQ(faulty.current(k), k == 0 || k == 6 ? 1e-3 * static_cast<double>(k + 1)
                                     : k == 7         ? 0.0
                                                      : sound.current(k))
            << k;
    }
    EXPECT_GT(sound.current(7), 0.0);
    faulty.i.par.faults[0].channels = 0; // no current flows, and that is what they give
    faulty.i.par.faults[0].kind = FAULT_DEAD;
    faulty.i.par.n_faults = 1;
    EXPECT_EQ(faulty.current(7), 0.0);
    EXPECT_EQ(faulty.i.out.currents.head.quality, QUALITY_GOOD);
}

TEST(CoarseSunSensors, AnEclipseTakesItsShareOfTheCurrent)
{
    Sensors s;
    const double whole = s.current(5);
    s.i.in.light.head.quality = QUALITY_GOOD;
    s.i.in.light.s_N = vec3(0, 0, 1);
    s.i.par.s_N = vec3(1, 0, 0); // the sunlight knows better
    for (const double visible : {1.0, 0.25, 0.0}) {
        s.i.in.light.visible = visible;
        EXPECT_NEAR(s.current(5), visible * whole, 1e-18);
    }
    EXPECT_GT(whole, 1e-3);
    EXPECT_EQ(s.i.out.currents.head.quality, QUALITY_GOOD);
    s.i.in.light.head.quality = QUALITY_STALE;
    s.current(5);
    EXPECT_EQ(s.i.out.currents.head.quality, QUALITY_DEGRADED);
}

TEST(CoarseSunSensors, SeeWhatAPlanetReflectsPerLightOfTheSun)
{
    Shine shine;
    shine.i.par.albedo = 0.3;
    shine.i.par.emissivity = 0.7; // they do not see it
    shine.prepare();
    Sensors s;
    const Vector3d r(1.3 * Shine::R, 0.2 * Shine::R, -0.4 * Shine::R);
    s.model.set_source(shine.model);
    s.i.in.truth.r_BN_N = vec(r);
    s.i.in.light.head.quality = QUALITY_GOOD;
    s.i.in.light.s_N = vec3(0, 0, 1);
    const auto of_planet = [&](const Vector3d &axis, double view) {
        double sum = 0.0;
        for (const auto &element : shine.model.at(0, 0.0, r)) {
            const double cosine = axis.dot(element.towards_N);
            sum += cosine > std::max(std::cos(view), 0.0) ? cosine * element.reflected / Shine::E : 0.0;
        }
        return sum;
    };
    for (const double visible : {1.0, 0.0}) { // in eclipse they see the planet alone
        s.i.in.light.visible = visible;
        for (std::size_t k = 0; k < 8; k++) {
            const double wanted = visible * std::max(s.axis(k)[2], 0.0) + of_planet(s.axis(k), 2.0);
            EXPECT_NEAR(s.current(k), s.i.par.current[k] * wanted, 1e-15) << k;
        }
    }
    // Beyond its field of view it is dark, and together with the Sun it is more than the Sun alone.
    s.i.in.light.visible = 1.0;
    s.i.par.axes_B[0] = vec3(-1, 0, 0);
    s.i.par.view[0] = 0.5;
    EXPECT_NEAR(s.current(0), 1e-3 * of_planet({-1, 0, 0}, 0.5), 1e-15);
    EXPECT_LT(s.current(0), 0.9e-3 * of_planet({-1, 0, 0}, 2.0));
    s.i.in.light.s_N = vec3(-1, 0, 0);
    EXPECT_NEAR(s.current(0), 1e-3 * (1.0 + of_planet({-1, 0, 0}, 0.5)), 1e-15);
    EXPECT_GT(s.current(0), 1.01e-3);
}

} // namespace coarse_sun_sensors_model_test
