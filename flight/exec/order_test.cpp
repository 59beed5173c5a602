// SPDX-License-Identifier: Apache-2.0
#include "flight/exec/order.h"

#include <gtest/gtest.h>

#include <vector>

namespace order_test {

const ExecRun runs[] = {{8, 1}, {1, 4}, {4, 3}, {2, 2}, {8, 1}};
constexpr uint32_t n_runs = 5, size = 8 + 4 + 12 + 4 + 8;

/// The place of each number, and the end, by the definition of a run.
std::vector<uint32_t> places()
{
    std::vector<uint32_t> found{0};
    for (const ExecRun &run : runs) {
        for (uint32_t i = 0; i < run.n; i++) {
            found.push_back(found.back() + run.width);
        }
    }
    return found;
}

TEST(Order, NumbersBeginWhereTheRunsSay)
{
    const auto all = places();
    for (uint32_t at = 0; at < size + 3; at++) {
        const auto found = std::find(all.begin(), all.end() - 1, at);
        const uint32_t width = found == all.end() - 1 ? 0 : found[1] - found[0];
        EXPECT_EQ(exec_number_at(runs, n_runs, at), width) << at;
    }
}

TEST(Order, AnyPartOfAStructIsReversedNumberByNumber)
{
    const auto all = places();
    for (auto from = all.begin(); from != all.end(); from++) {
        for (auto to = from; to != all.end(); to++) {
            std::vector<uint8_t> bytes, expected;
            for (auto number = from; number != to; number++) {
                for (uint32_t at = number[0]; at < number[1]; at++) {
                    bytes.push_back(static_cast<uint8_t>(at));
                    expected.push_back(static_cast<uint8_t>(number[1] - 1 - (at - number[0])));
                }
            }
            exec_reverse(runs, n_runs, bytes.data(), *from, *to);
            EXPECT_EQ(bytes, expected) << *from << " to " << *to;
        }
    }
}

} // namespace order_test
