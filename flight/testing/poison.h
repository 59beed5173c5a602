// SPDX-License-Identifier: Apache-2.0
// Bad numbers for modules: what they do when one input is not finite, and when anything at all is
// thrown at them.
#pragma once

#include "flight/testing/eigen.h"

#include <gtest/gtest.h>

#include <cfloat>
#include <limits>
#include <utility>
#include <vector>

namespace flight::testing {

using Doubles = std::vector<double *>;

/// The addresses of all doubles of fields that hold nothing else: double, Vec3, Mat3 and arrays.
template <class... Field> Doubles doubles(Field &...fields)
{
    Doubles all;
    auto add = [&](double *first, std::size_t size) {
        for (std::size_t i = 0; i < size / sizeof(double); i++) {
            all.push_back(first + i);
        }
    };
    (add(reinterpret_cast<double *>(&fields), sizeof fields), ...);
    return all;
}

/// For each of `inputs`, which lie in `m`: with a NaN or an infinity there, an update leaves all
/// outputs as they were but for their quality, which falls to degraded. `heads` lists the heads of
/// the outputs of a module. `m` must have good outputs, and is left as it was.
template <class Module, class Update, class Heads>
void expect_held(Module &m, const Doubles &inputs, Update update, Heads heads)
{
    const Module good = m;
    Module expected = m;
    for (Head *head : heads(expected)) {
        ASSERT_EQ(head->quality, QUALITY_GOOD);
        head->quality = QUALITY_DEGRADED;
    }
    for (double *input : inputs) {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        for (double bad : {nan, -nan, HUGE_VAL, -HUGE_VAL}) {
            *input = bad;
            update(m);
            EXPECT_EQ(std::memcmp(&m.out, &expected.out, sizeof m.out), 0)
                << "double " << (reinterpret_cast<char *>(input) - reinterpret_cast<char *>(&m)) / 8
                << " of the module set to " << bad;
            m = good;
        }
    }
}

/// With a `hold` of 3 s, a module holds its torque so long after its last usable input, degraded, and then gives none.
/// input(m): the head of the input and a number of it.
template <class Module, class Update, class Input>
void expect_torque_ends(const Module &any, Update update, Input input)
{
    constexpr std::int64_t second = 1'000'000'000;
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        Module m = any;
        m.par.hold = 3;
        update(&m, {0, 0});
        EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
        const auto [head, number] = input(m);
        head->quality = lost;
        if (lost == QUALITY_GOOD) {
            *number = NAN;
        }
        for (int k = 1; k < 8; k++) {
            update(&m, {k * second, second});
            EXPECT_EQ(vec_norm(m.out.torque.torque_B) > 0, k <= 3);
            EXPECT_EQ(m.out.torque.head.quality, QUALITY_DEGRADED);
        }
    }
}

/// A number of any kind: ordinary, zero of either sign, tiny, huge, not finite.
inline double any_number(Random &random)
{
    using limits = std::numeric_limits<double>;
    static constexpr double special[] = {0.0,     -0.0,     1.0,      -1.0,      DBL_MIN,
                                         5e-324,  1e-170,   -1e-170,  1e160,     -1e160,
                                         DBL_MAX, -DBL_MAX, HUGE_VAL, -HUGE_VAL, limits::quiet_NaN()};
    constexpr int n = sizeof special / sizeof special[0];
    return random.below(2) ? random.real(-10, 10) : special[random.below(n)];
}

/// Mostly ordinary numbers, in every third round with up to three of any kind, in every ninth
/// nothing but those.
inline void throw_numbers(const Doubles &at, Random &random, int round)
{
    for (double *p : at) {
        *p = round % 9 == 0 ? any_number(random) : random.real(-10, 10);
    }
    auto n = static_cast<int>(at.size());
    for (int i = 0; round % 3 == 0 && i < 3; i++) {
        *at[static_cast<std::size_t>(random.below(n))] = any_number(random);
    }
}

inline Quality any_quality(Random &random)
{
    return static_cast<Quality>(random.below(4));
}

inline void expect_finite(const Doubles &outputs, int round)
{
    for (std::size_t i = 0; i < outputs.size(); i++) {
        ASSERT_TRUE(std::isfinite(*outputs[i])) << "output " << i << " in round " << round;
    }
}

} // namespace flight::testing
