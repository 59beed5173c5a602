// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "emulator/testing/lock_step.h"

namespace threaded_test {

using namespace fledge::emulator;
using namespace fledge::emulator::testing;

TEST(Threaded, RandomProgramsGoAsWithTheReference)
{
    for (std::uint64_t seed = 1; seed <= 1500; seed++) {
        ASSERT_EQ(difference_of(seed, &make_interpreter, &make_threaded), "");
    }
}

} // namespace threaded_test
