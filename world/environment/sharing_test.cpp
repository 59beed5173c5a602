// SPDX-License-Identifier: Apache-2.0
// What is evaluated in the loop takes nothing from the heap, and may be shared between threads.
#include "sim/testing/allocations.h"
#include "world/environment/ephemeris.h"
#include "world/environment/harmonics.h"
#include "world/environment/orientation.h"
#include "world/environment/testing/files.h"
#include "world/environment/testing/kernel.h"

#include <thread>

namespace fledge::world {
namespace sharing_test {

using Eigen::Vector3d;
using testing::made_kernel;
using testing::TemporaryFile;
using testing::uniform_motion;

/// The sun on one segment, then the other; a planet's gravity as it turns.
struct World {
    World()
        : file("shared.bsp",
               made_kernel({uniform_motion(10, 0, 0, 50, 1000, 1), uniform_motion(10, 0, 50, 100, 2000, -1)})),
          field(HarmonicField::zero(4e14, 6.4e6, 20)), harmonics(field), orientation(Orientation::built_in(301))
    {
        ephemeris.add_spk(file.path());
    }

    /// Something of everything, at 100 instants.
    Vector3d evaluate() const
    {
        Ephemeris::Cursor cursor;
        Vector3d sum(0, 0, 0);
        for (int i = 0; i < 100; i++) {
            const double tau = (37 * i) % 100;
            const BodyAttitude attitude = orientation.at({0}, tau);
            sum += ephemeris.position(10, 0, {0}, tau, cursor);
            sum += ephemeris.state(10, 0, {0}, tau, cursor).v;
            sum += harmonics.gravity_N(attitude.dcm_PN, {7e6, 1e4 * i, 1e6}) + attitude.omega_PN_P;
        }
        return sum;
    }

    TemporaryFile file;
    Ephemeris ephemeris;
    HarmonicField field;
    Harmonics harmonics;
    Orientation orientation;
};

TEST(Environment, EvaluationTakesNothingFromTheHeap)
{
    const World world;
    const sim::testing::Allocations allocations;
    const Vector3d sum = world.evaluate();
    EXPECT_EQ(allocations.count(), 0);
    EXPECT_TRUE(sum.allFinite());
}

TEST(Environment, ThreadsShareItAndGetTheSameBits)
{
    const World world;
    const Vector3d expected = world.evaluate();
    Vector3d found[4];
    std::vector<std::thread> threads;
    for (Vector3d &result : found) {
        threads.emplace_back([&] { result = world.evaluate(); });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }
    for (const Vector3d &result : found) {
        EXPECT_EQ(result, expected);
    }
}

} // namespace sharing_test
} // namespace fledge::world
