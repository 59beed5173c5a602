// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/navigation_model.h"

#include "world/testing/flyer.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <vector>

namespace navigation_model_test {

using namespace fledge;
using namespace fledge::world;
using namespace fledge::world::testing;

struct Nav {
    Navigation nav_interface{};
    NavigationModel model{nav_interface};
    Ns t = 0;

    void begin(std::uint64_t seed = 1, const char *name = "world.nav")
    {
        const auto method = sim::make_rk4();
        model.prepare({name, seed, method.get()});
        nav_interface.in.truth.head.quality = QUALITY_GOOD;
        nav_interface.in.truth.sigma_BN = vec3(0.3, -0.2, 0.5);
        nav_interface.in.truth.omega_BN_B = vec3(0.01, 0.02, -0.03);
        nav_interface.in.truth.r_BN_N = vec3(7e6, -1e6, 2e6);
        nav_interface.in.truth.v_BN_N = vec3(100, 7000, -500);
        nav_interface.in.truth.a_BN_N = vec3(-7, 1, -2);
        model.reset(0);
        t = 0;
    }

    void step()
    {
        t += 100 * ms;
        model.update({t, 100 * ms});
    }

    /// The rotation of the navigated attitude relative to the truth, B components.
    Vector3d turn() const
    {
        const Vec3 sigma = mrp_relative(nav_interface.out.attitude.sigma_BN, nav_interface.in.truth.sigma_BN);
        const double length = vec_norm(sigma);
        return length > 0.0 ? Vector3d(4.0 * std::atan(length) / length * view(sigma)) : Vector3d(Vector3d::Zero());
    }
};

bool same(const Vec3 &a, const Vec3 &b)
{
    return std::memcmp(&a, &b, sizeof a) == 0;
}

TEST(Navigation, IsPerfectByDefault)
{
    Nav nav;
    nav.begin();
    nav.step();
    EXPECT_TRUE(same(nav.nav_interface.out.attitude.sigma_BN, nav.nav_interface.in.truth.sigma_BN));
    EXPECT_TRUE(same(nav.nav_interface.out.attitude.omega_BN_B, nav.nav_interface.in.truth.omega_BN_B));
    EXPECT_TRUE(same(nav.nav_interface.out.orbit.r_BN_N, nav.nav_interface.in.truth.r_BN_N));
    EXPECT_TRUE(same(nav.nav_interface.out.orbit.v_BN_N, nav.nav_interface.in.truth.v_BN_N));
    EXPECT_TRUE(same(nav.nav_interface.out.orbit.a_BN_N, nav.nav_interface.in.truth.a_BN_N));
    EXPECT_EQ(nav.nav_interface.out.attitude.head.t, nav.t);
    EXPECT_EQ(nav.nav_interface.out.attitude.head.quality, QUALITY_GOOD);
    EXPECT_EQ(nav.nav_interface.out.attitude.head.sequence, 1u);
    nav.step();
    EXPECT_EQ(nav.nav_interface.out.orbit.head.sequence, 2u);
}

TEST(Navigation, IsAsGoodAsTheTruthIsFresh)
{
    Nav nav;
    nav.begin();
    nav.nav_interface.in.truth.head.quality = QUALITY_STALE;
    nav.step();
    EXPECT_EQ(nav.nav_interface.out.attitude.head.quality, QUALITY_DEGRADED);
    nav.nav_interface.in.truth.head.quality = QUALITY_NONE;
    nav.step();
    EXPECT_EQ(nav.nav_interface.out.orbit.head.quality, QUALITY_NONE);
}

TEST(Navigation, BiasesAddAndTurn)
{
    Nav nav;
    nav.nav_interface.par.attitude_bias = vec3(0.02, -0.5, 0.03); // of any size
    nav.nav_interface.par.rate_bias = vec3(1e-4, 2e-4, 3e-4);
    nav.nav_interface.par.position_bias = vec3(10, 20, 30);
    nav.nav_interface.par.velocity_bias = vec3(0.1, 0.2, 0.3);
    nav.begin();
    nav.step();
    EXPECT_LT((nav.turn() - view(nav.nav_interface.par.attitude_bias)).norm(), 1e-14);
    EXPECT_EQ(nav.nav_interface.out.attitude.omega_BN_B.v[1], 0.02 + 2e-4);
    EXPECT_EQ(nav.nav_interface.out.orbit.r_BN_N.v[2], 2e6 + 30.0);
    EXPECT_EQ(nav.nav_interface.out.orbit.v_BN_N.v[0], 100.0 + 0.1);

    nav.nav_interface.par.attitude_bias = vec3(1e-9, 0, -2e-9); // and as small as that
    nav.model.refresh();
    nav.step();
    EXPECT_LT((nav.turn() - view(nav.nav_interface.par.attitude_bias)).norm(), 1e-15);
}

TEST(Navigation, AttitudesAreOfTheShortSet)
{
    Nav nav;
    nav.nav_interface.par.attitude_bias = vec3(0.1, 0, 0);
    nav.begin();
    nav.nav_interface.in.truth.sigma_BN = vec3(0.999, 0, 0); // 0.1 rad more passes 180 deg
    nav.step();
    EXPECT_LE(vec_norm(nav.nav_interface.out.attitude.sigma_BN), 1.0);
    EXPECT_LT(nav.nav_interface.out.attitude.sigma_BN.v[0], 0.0);
    EXPECT_NEAR(nav.turn()[0], 0.1, 1e-13);
}

TEST(Navigation, NoiseHasItsDeviationOnEveryAxis)
{
    Nav nav;
    nav.nav_interface.par.attitude_noise = vec3(1e-3, 2e-3, 3e-3);
    nav.nav_interface.par.rate_noise = vec3(1e-5, 2e-5, 3e-5);
    nav.nav_interface.par.position_noise = vec3(1, 2, 3);
    nav.nav_interface.par.velocity_noise = vec3(0.1, 0.2, 0.3);
    nav.nav_interface.par.position_bias = vec3(0, 50, 0);
    nav.begin();
    constexpr int n = 20000;
    std::array<double, 12> sum{}, square{};
    double cross = 0.0; // of two axes, and of two successive draws of one
    double lag = 0.0, last = 0.0;
    for (int i = 0; i < n; i++) {
        nav.step();
        const auto &truth = nav.nav_interface.in.truth;
        const auto &out = nav.nav_interface.out;
        std::array<double, 12> error;
        for (std::size_t k = 0; k < 3; k++) {
            error[k] = nav.turn()[static_cast<int>(k)] / nav.nav_interface.par.attitude_noise.v[k];
            error[3 + k] =
                (out.attitude.omega_BN_B.v[k] - truth.omega_BN_B.v[k]) / nav.nav_interface.par.rate_noise.v[k];
            error[6 + k] = (out.orbit.r_BN_N.v[k] - truth.r_BN_N.v[k] - nav.nav_interface.par.position_bias.v[k]) /
                           nav.nav_interface.par.position_noise.v[k];
            error[9 + k] = (out.orbit.v_BN_N.v[k] - truth.v_BN_N.v[k]) / nav.nav_interface.par.velocity_noise.v[k];
        }
        for (std::size_t k = 0; k < 12; k++) {
            sum[k] += error[k] / n;
            square[k] += error[k] * error[k] / n;
        }
        cross += error[0] * error[1] / n;
        lag += error[0] * last / n;
        last = error[0];
    }
    const double root = std::sqrt(static_cast<double>(n));
    for (std::size_t k = 0; k < 12; k++) {
        EXPECT_NEAR(sum[k], 0.0, 4.0 / root) << k;
        EXPECT_NEAR(square[k], 1.0, 4.0 * std::sqrt(2.0) / root) << k;
    }
    EXPECT_NEAR(cross, 0.0, 4.0 / root);
    EXPECT_NEAR(lag, 0.0, 4.0 / root);
}

std::vector<double> draws(Nav &nav)
{
    std::vector<double> all;
    for (int i = 0; i < 50; i++) {
        nav.step();
        const auto &out = nav.nav_interface.out;
        all.insert(all.end(), out.attitude.sigma_BN.v, out.attitude.sigma_BN.v + 3);
        all.insert(all.end(), out.orbit.r_BN_N.v, out.orbit.r_BN_N.v + 3);
    }
    return all;
}

TEST(Navigation, SameSeedAndNameGiveTheSameBits)
{
    const auto fly = [](std::uint64_t seed, const char *name) {
        Nav nav;
        nav.nav_interface.par.attitude_noise = nav.nav_interface.par.position_noise = vec3(0.01, 0.01, 0.01);
        nav.begin(seed, name);
        return draws(nav);
    };
    EXPECT_EQ(fly(5, "world.nav"), fly(5, "world.nav"));
    EXPECT_NE(fly(5, "world.nav"), fly(6, "world.nav"));
    EXPECT_NE(fly(5, "world.nav"), fly(5, "world.nav2"));
}

TEST(Navigation, ResetAndMemoryRepeatTheStream)
{
    Nav nav;
    nav.nav_interface.par.attitude_noise = nav.nav_interface.par.position_noise = vec3(0.01, 0.01, 0.01);
    nav.begin();
    const auto first = draws(nav);
    std::vector<std::byte> saved(nav.model.memory().begin(), nav.model.memory().end());
    const auto second = draws(nav);
    EXPECT_NE(first, second);
    std::memcpy(nav.model.memory().data(), saved.data(), saved.size());
    EXPECT_EQ(draws(nav), second);
    nav.model.reset(0);
    EXPECT_EQ(draws(nav), first);
}

TEST(Navigation, SwitchingOneNoiseOffLeavesTheOthers)
{
    const auto positions = [](double attitude_noise) {
        Nav nav;
        nav.nav_interface.par.attitude_noise = vec3(attitude_noise, 0, 0);
        nav.nav_interface.par.position_noise = vec3(1, 1, 1);
        nav.begin();
        nav.step();
        nav.step();
        return Vector3d(view(nav.nav_interface.out.orbit.r_BN_N));
    };
    EXPECT_EQ(positions(0.01), positions(0.0));
}

TEST(Navigation, FaultsHaveTheirChannels)
{
    Nav nav;
    nav.nav_interface.par.n_faults = 3;
    nav.nav_interface.par.faults[0] = {FAULT_BIAS, 1u << 1, 0.1, 0, 0};
    nav.nav_interface.par.faults[1] = {FAULT_HIGH, 1u << 5, 2.0, 0, 0};
    nav.nav_interface.par.faults[2] = {FAULT_DROPOUT, 7u << 6, 0.0, 250 * ms, 0};
    nav.begin();
    for (int k = 1; k < 5; k++) {
        nav.nav_interface.in.truth.r_BN_N.v[1] = k;
        nav.nav_interface.in.truth.v_BN_N.v[1] = k;
        nav.step();
        EXPECT_LT((nav.turn() - Vector3d(0, 0.1, 0)).norm(), 1e-14);
        EXPECT_EQ(nav.nav_interface.out.attitude.omega_BN_B.v[2], 2.0);
        EXPECT_EQ(nav.nav_interface.out.orbit.r_BN_N.v[1], std::min(k, 2));
        EXPECT_EQ(nav.nav_interface.out.orbit.v_BN_N.v[1], k);
    }
    nav.nav_interface.par.faults[2].channels = 63u << 6; // the whole message
    nav.step();
    EXPECT_EQ(nav.nav_interface.out.orbit.head.t, 400 * ms);
    EXPECT_EQ(nav.nav_interface.out.orbit.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(nav.nav_interface.out.attitude.head.t, 500 * ms);
}

} // namespace navigation_model_test
