// SPDX-License-Identifier: Apache-2.0
#include "flight/exec/condition.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>
#include <vector>

namespace condition_test {

ExecOperand element(FledgeType type, const void *at)
{
    return {at, 1, type, EXEC_ELEMENT};
}

TEST(Condition, ComparesNumbersOfAllTypesByTheirValues)
{
    const double real[] = {-7.0, 3.0};
    const float single = 3.0f;
    const std::int8_t small = -7;
    const std::uint16_t natural = 3;
    const std::int64_t low = -7;
    const std::uint64_t high = 3;
    const std::int32_t phase = -7;
    const std::vector<ExecOperand> sevens{element(FLEDGE_F64, &real[0]), element(FLEDGE_I8, &small),
                                          element(FLEDGE_I64, &low), element(FLEDGE_ENUM, &phase)};
    const std::vector<ExecOperand> threes{element(FLEDGE_F64, &real[1]), element(FLEDGE_F32, &single),
                                          element(FLEDGE_U16, &natural), element(FLEDGE_U64, &high)};
    const auto results = [](const ExecOperand &a, const ExecOperand &b) {
        std::vector<int> all;
        for (const ExecRelation relation :
             {EXEC_LESS, EXEC_LESS_EQUAL, EXEC_GREATER, EXEC_GREATER_EQUAL, EXEC_EQUAL, EXEC_NOT_EQUAL}) {
            all.push_back(exec_compare(&a, relation, &b));
        }
        return all;
    };
    for (const ExecOperand &a : sevens) {
        for (const ExecOperand &b : threes) {
            EXPECT_EQ(results(a, b), (std::vector<int>{1, 1, 0, 0, 0, 1})) << a.type << " " << b.type;
            EXPECT_EQ(results(b, a), (std::vector<int>{0, 0, 1, 1, 0, 1})) << b.type << " " << a.type;
        }
    }
    for (const auto &equal : {sevens, threes}) {
        for (const ExecOperand &a : equal) {
            EXPECT_EQ(results(a, equal[0]), (std::vector<int>{0, 1, 0, 1, 1, 0})) << a.type;
        }
    }
}

TEST(Condition, ComparesWideNumbersExactly)
{
    const std::int64_t next = (std::int64_t{1} << 53) + 1, least = std::numeric_limits<std::int64_t>::min();
    const double rounded = 9007199254740992.0;
    const std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
    const ExecOperand a = element(FLEDGE_I64, &next), b = element(FLEDGE_F64, &rounded);
    EXPECT_TRUE(exec_compare(&a, EXEC_GREATER, &b));
    EXPECT_FALSE(exec_compare(&b, EXEC_EQUAL, &a));
    const ExecOperand c = element(FLEDGE_I64, &least), d = element(FLEDGE_U64, &most);
    EXPECT_TRUE(exec_compare(&c, EXEC_LESS, &d));
}

TEST(Condition, AMeasureOfWideNumbersIsADoubleAndAnUnknownRelationNeverHolds)
{
    const std::int64_t legs[] = {3, 4};
    const double five = 5.0;
    const ExecOperand norm = {legs, 2, FLEDGE_I64, EXEC_NORM}, b = element(FLEDGE_F64, &five);
    EXPECT_TRUE(exec_compare(&norm, EXEC_EQUAL, &b));
    EXPECT_FALSE(exec_compare(&b, static_cast<ExecRelation>(EXEC_NOT_EQUAL + 1), &b));
}

TEST(Condition, MeasuresVectorsOfAllTypesInTheOrderOfMemory)
{
    std::mt19937 random(3);
    std::uniform_real_distribution<double> number(-1.0, 1.0);
    for (int run = 0; run < 200; run++) {
        double x[7], sum = 0.0, largest = 0.0;
        std::int16_t whole[7];
        double sum_whole = 0.0;
        for (int i = 0; i < 7; i++) {
            x[i] = number(random);
            whole[i] = static_cast<std::int16_t>(random());
            sum += x[i] * x[i];
            sum_whole += static_cast<double>(whole[i]) * whole[i];
            largest = std::max(largest, std::abs(x[i]));
        }
        EXPECT_EQ(exec_measured(EXEC_NORM, FLEDGE_F64, x, 7), fm_sqrt(sum));
        EXPECT_EQ(exec_measured(EXEC_NORM, FLEDGE_I16, whole, 7), fm_sqrt(sum_whole));
        EXPECT_EQ(exec_measured(EXEC_MAX_ABS, FLEDGE_F64, x, 7), largest);
        EXPECT_EQ(exec_measured(EXEC_ELEMENT, FLEDGE_F64, x, 7), x[0]);
    }
}

/// A random condition of constants: its parts in postfix order, and its truth.
bool condition(std::mt19937 &random, int depth, std::vector<std::pair<ExecJoin, int>> &parts)
{
    const unsigned kind = depth > 0 ? random() % 4 : 0;
    if (kind == 0) {
        const int holds = random() % 2 != 0;
        parts.emplace_back(EXEC_COMPARE, holds);
        return holds;
    }
    const bool a = condition(random, depth - 1, parts);
    if (kind == 1) {
        parts.emplace_back(EXEC_INVERSE, 0);
        return !a;
    }
    const bool b = condition(random, depth - 1, parts);
    parts.emplace_back(kind == 2 ? EXEC_BOTH : EXEC_EITHER, 0);
    return kind == 2 ? a && b : a || b;
}

TEST(Condition, JoinsItsParts)
{
    std::mt19937 random(4);
    int held = 0;
    for (int run = 0; run < 5000; run++) {
        std::vector<std::pair<ExecJoin, int>> parts;
        const bool expected = condition(random, 7, parts);
        std::uint64_t results = 0;
        for (const auto &[join, holds] : parts) {
            results = exec_join(results, join, holds);
        }
        ASSERT_EQ(results & 1u, static_cast<std::uint64_t>(expected));
        held += expected;
    }
    EXPECT_GT(held, 1000);
    EXPECT_LT(held, 4000);
}

TEST(Condition, KeepsSoManyResultsAsItSays)
{
    std::uint64_t results = 0;
    for (int i = 0; i < EXEC_DEPTH; i++) {
        results = exec_join(results, EXEC_COMPARE, 1);
    }
    for (int i = 1; i < EXEC_DEPTH; i++) {
        results = exec_join(results, EXEC_BOTH, 0);
    }
    EXPECT_EQ(results, 1u);
}

} // namespace condition_test
