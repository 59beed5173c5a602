// SPDX-License-Identifier: Apache-2.0
#include "world/environment/environment_model.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include <cmath>
#include <numbers>

namespace fledge::world {
namespace environment_model_test {

using Eigen::Vector3d;

TEST(Ellipsoid, AltitudesAreTheNormalDistanceToTheSurface)
{
    // A point at an altitude lies on the normal: its nearest point of the surface is the one below.
    for (const Ellipsoid ellipsoid : {Ellipsoid{6378137.0, 6356752.314245}, {7.1492e7, 6.6854e7}, {2.0, 2.0}}) {
        for (double latitude = -1.57; latitude < 1.58; latitude += 0.0785) {
            for (const double share : {-0.01, 0.0, 1e-3, 0.06, 0.5, 5.0, 60.0}) {
                const double altitude = share * ellipsoid.a;
                const Vector3d r = ellipsoid.point(latitude, 0.7, altitude), foot = ellipsoid.point(latitude, 0.7, 0.0);
                const double x = foot[0] / ellipsoid.a, y = foot[1] / ellipsoid.a, z = foot[2] / ellipsoid.b;
                EXPECT_NEAR(x * x + y * y + z * z, 1.0, 1e-14);
                EXPECT_NEAR((r - foot).norm(), std::abs(altitude), 1e-14 * ellipsoid.a + 1e-15 * altitude);
                const Vector3d gradient(foot[0] / (ellipsoid.a * ellipsoid.a), foot[1] / (ellipsoid.a * ellipsoid.a),
                                        foot[2] / (ellipsoid.b * ellipsoid.b));
                EXPECT_LT((r - foot).cross(gradient.normalized()).norm(), 1e-13 * ellipsoid.a * (1 + share));
                EXPECT_NEAR(ellipsoid.altitude(r), altitude, 1e-12 * ellipsoid.a) << latitude << " " << altitude;
            }
        }
    }
}

TEST(Ellipsoid, OfTheEarthIsThatOfWgs84)
{
    GravityBody earth;
    earth.naif = 399;
    earth.radius = 6378136.3; // of its field
    const Ellipsoid found = Ellipsoid::of(earth);
    EXPECT_EQ(found.a, 6378137.0);
    EXPECT_NEAR(found.b, 6356752.314245, 1e-6);
    earth.naif.reset();
    EXPECT_EQ(Ellipsoid::of(earth).b, 6378136.3);
}

} // namespace environment_model_test
} // namespace fledge::world
