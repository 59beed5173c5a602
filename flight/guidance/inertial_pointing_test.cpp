// SPDX-License-Identifier: Apache-2.0
#include "flight/testing/poison.h"

extern "C" {
#include "flight/guidance/inertial_pointing.h"
}

#include <gtest/gtest.h>

namespace flight::testing {
namespace inertial_pointing_test {

InertialPointing pointing(Vec3 sigma_RN)
{
    InertialPointing m{};
    m.par.sigma_RN = sigma_RN;
    return m;
}

TEST(InertialPointing, rests_at_the_attitude_it_was_given)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        Vec3 sigma_RN = random.mrp();
        InertialPointing m = pointing(i % 2 ? mrp_shadow(sigma_RN) : sigma_RN);
        inertial_pointing_update(&m, {500, 0});
        const AttReference &reference = m.out.reference;
        EXPECT_LT(difference(dcm(reference.sigma_RN), dcm(sigma_RN)), 1e-14);
        EXPECT_LE(vec_norm(reference.sigma_RN), 1 + 1e-15);
        EXPECT_TRUE(all_zero(reference.omega_RN_N));
        EXPECT_TRUE(all_zero(reference.domega_RN_N));
        EXPECT_EQ(reference.head.quality, QUALITY_GOOD);
        EXPECT_EQ(reference.head.t, 500);
        EXPECT_EQ(reference.head.sequence, 1u);
    }
}

TEST(InertialPointing, follows_its_parameter)
{
    InertialPointing m = pointing(vec3(0.1, 0.2, 0.3));
    inertial_pointing_update(&m, {0, 0});
    m.par.sigma_RN = vec3(0, 0, 1); // exactly a half turn keeps the set it came with
    inertial_pointing_update(&m, {500, 500});
    EXPECT_EQ(eigen(m.out.reference.sigma_RN), Vector3d(0, 0, 1));
    EXPECT_EQ(m.out.reference.head.sequence, 2u);
}

TEST(InertialPointing, holds_the_last_reference_against_numbers_that_are_not_finite)
{
    InertialPointing m = pointing(vec3(0.1, 0.2, 0.3));
    inertial_pointing_update(&m, {0, 0});
    expect_held(
        m, doubles(m.par.sigma_RN),
        [](InertialPointing &x) {
            inertial_pointing_update(&x, {500, 500});
        },
        [](InertialPointing &x) { return std::vector{&x.out.reference.head}; });

    InertialPointing bad = pointing(vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0));
    inertial_pointing_update(&bad, {0, 0});
    EXPECT_TRUE(all_zero(bad.out)) << "there is no earlier reference to hold";
}

} // namespace inertial_pointing_test
} // namespace flight::testing
