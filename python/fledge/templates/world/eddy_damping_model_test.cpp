// SPDX-License-Identifier: Apache-2.0
// The model by its properties, without the kernel.
#include "world/eddy_damping_model.h"

#include "flight/testing/eigen.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace {

using namespace my_sat;
using namespace flight::testing;

struct Damping {
    EddyDamping interface = {};
    EddyDampingModel model{interface};

    explicit Damping(std::uint64_t seed = 1)
    {
        interface.in.truth.head = good();
        model.prepare({"world.damping", seed, nullptr});
        model.reset(0);
    }

    Vec3 torque()
    {
        model.update({0, 0});
        return interface.out.load.torque_B;
    }

    std::vector<double> torques(int n)
    {
        std::vector<double> all;
        for (int i = 0; i < n; i++) {
            const Vec3 one = torque();
            all.insert(all.end(), one.v, one.v + 3);
        }
        return all;
    }
};

TEST(EddyDamping, takes_energy_and_never_gives_any)
{
    flight::testing::Random random{1};
    for (int i = 0; i < 1000; i++) {
        Damping d;
        d.interface.par.damping = random.real(0, 1);
        d.interface.in.truth.omega_BN_B = vec(random.vector());
        const Vec3 &omega = d.interface.in.truth.omega_BN_B;
        EXPECT_NEAR(vec_dot(d.torque(), omega), -d.interface.par.damping * vec_norm2(omega), 1e-15);
    }
    EXPECT_EQ(vec_norm(Damping().torque()), 0.0);
}

TEST(EddyDamping, noise_has_its_deviation)
{
    Damping d;
    d.interface.par.noise = 0.1;
    double square = 0.0;
    for (double x : d.torques(10000)) {
        square += x * x / 30000;
    }
    EXPECT_NEAR(square, 0.01, 4 * 0.01 * std::sqrt(2.0 / 30000));
}

TEST(EddyDamping, the_seed_and_the_memory_fix_the_noise)
{
    Damping d, other{2};
    d.interface.par.noise = other.interface.par.noise = 0.1;
    const auto first = d.torques(5);
    EXPECT_NE(first, other.torques(5));

    const std::vector<std::byte> there(d.model.memory().begin(), d.model.memory().end());
    const auto second = d.torques(5);
    EXPECT_NE(second, first);
    std::ranges::copy(there, d.model.memory().begin());
    EXPECT_EQ(d.torques(5), second);
    d.model.reset(0);
    EXPECT_EQ(d.torques(5), first);
}

} // namespace
