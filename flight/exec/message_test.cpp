// SPDX-License-Identifier: Apache-2.0
// Which of several messages an input takes: the chain of exec_takes against a search through all of them.
extern "C" {
#include "flight/exec/message.h"
}

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace exec_message_test {

TEST(Message, TheChainOfWiresTakesWhatASearchFinds)
{
    std::mt19937 chance(11);
    int later = 0;
    for (int run = 0; run < 3000; run++) {
        const int64_t t = 10, stale_after = run % 2 ? 4 : 0;
        const auto by = static_cast<ExecChoice>(EXEC_NEWEST + chance() % 3);
        std::vector<Head> sources(2 + chance() % 4), aged;
        for (Head &source : sources) {
            source = {static_cast<int64_t>(chance() % 11), static_cast<Quality>(chance() % 4), 1};
            aged.push_back(source);
            if (stale_after > 0 && t - source.t > stale_after) {
                aged.back().quality = std::min(source.quality, QUALITY_STALE);
            }
        }
        // As the programs carry wires.
        std::size_t taken = 0;
        Head held = aged[0];
        for (std::size_t i = 1; i < sources.size(); i++) {
            if (exec_takes(by, held, sources[i], t, stale_after)) {
                taken = i;
                held = aged[i];
            }
        }
        // As the rules are written: a rank for each, and the first of the highest.
        const auto rank = [&](const Head &head) -> int64_t {
            return by == EXEC_NEWEST ? (head_written(head) ? 1 + head.t : 0)
                                     : std::min<int64_t>(head.quality, by == EXEC_FIRST ? QUALITY_DEGRADED : 3);
        };
        const auto found =
            std::max_element(aged.begin(), aged.end(), [&](const Head &a, const Head &b) { return rank(a) < rank(b); });
        EXPECT_EQ(taken, static_cast<std::size_t>(found - aged.begin())) << "rule " << by << ", run " << run;
        later += taken > 0;
    }
    EXPECT_GT(later, 500);
}

TEST(Message, AnInputWithOneWireTakesWhatComes)
{
    EXPECT_TRUE(exec_takes(EXEC_SOLE, {5, QUALITY_GOOD, 2}, {4, QUALITY_NONE, 1}, 6, 0));
}

} // namespace exec_message_test
