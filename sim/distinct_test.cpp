// SPDX-License-Identifier: Apache-2.0
// Inputs that must not say the same, as two bodies to point at must not.
#include "sim/testing/toys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace distinct_test {

using namespace fledge::sim;
using namespace fledge::sim::toys;
using ::testing::HasSubstr;

/// Two tanks, and a module whose inputs `number` and `offset` must differ.
struct Pair {
    Pair()
    {
        Process &world = sim.add_process("world");
        Process &flight = sim.add_process("flight");
        for (auto [name, tank] : {std::pair{"a", &a}, std::pair{"b", &b}}) {
            *tank = std::make_shared<Instance>(tank_type);
            world.add(name, *tank);
            world.add_task({name, 1000, 0, 0, {*tank}});
        }
        sum = std::make_shared<Instance>(scale_type);
        flight.add("sum", sum);
        flight.add_task({"gnc", 1000, 0, 0, {sum}});
    }
    std::string error()
    {
        try {
            sim.prepare();
        } catch (const SetupError &error) {
            return error.what();
        }
        return "";
    }

    Simulation sim;
    std::shared_ptr<Instance> a, b, sum;
};

TEST(Distinct, OneOutputForBothIsRefused)
{
    Pair pair;
    pair.sim.connect(port(pair.a, "level"), port(pair.sum, "number"));
    pair.sim.connect(port(pair.a, "level"), port(pair.sum, "offset"));
    EXPECT_EQ(pair.error(), "flight.sum.offset must differ from flight.sum.number: world.a.level feeds both");
    EXPECT_FALSE(pair.sim.prepared());
}

TEST(Distinct, SoAreTwoOutputsThatSayTheSame)
{
    Pair pair;
    pair.sim.connect(port(pair.a, "level"), port(pair.sum, "number"));
    pair.sim.connect(port(pair.b, "level"), port(pair.sum, "offset"));
    EXPECT_THAT(pair.error(), HasSubstr("world.b.level and world.a.level say the same"));
    interface<Tank>(pair.b).par.initial = 1.0;
    EXPECT_EQ(pair.error(), "");
}

} // namespace distinct_test
