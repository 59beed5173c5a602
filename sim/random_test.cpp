// SPDX-License-Identifier: Apache-2.0
#include "sim/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

namespace random_test {

using fledge::sim::Random;

// The definition as a map over 256 bits, one word at a time, in 128-bit arithmetic where the
// implementation has machine words.
struct Definition {
    using Wide = unsigned __int128;
    std::uint64_t s[4];

    static std::uint64_t rotate(std::uint64_t x, int k)
    {
        const Wide wide = static_cast<Wide>(x) << k;
        return static_cast<std::uint64_t>(wide) | static_cast<std::uint64_t>(wide >> 64);
    }

    std::uint64_t operator()()
    {
        const std::uint64_t a = s[0], b = s[1], c = s[2], d = s[3];
        s[0] = a ^ d ^ b;
        s[1] = b ^ c ^ a;
        s[2] = c ^ a ^ (b << 17);
        s[3] = rotate(d ^ b, 45);
        return rotate(b * 5, 7) * 9;
    }
};

TEST(Random, FollowsTheDefinitionOfXoshiro256StarStar)
{
    Random random({1, 2, 3, 4});
    // By hand, from state (1, 2, 3, 4): rotl(5 s1, 7) 9 = 10 * 128 * 9; then s1 = 2 ^ 3 ^ 1 = 0.
    EXPECT_EQ(random.bits(), 11520u);
    EXPECT_EQ(random.bits(), 0u);
    // Then s0 = 1 ^ 4 ^ 2 = 7, s2 = 3 ^ 1 ^ (2 << 17) = 262146, so s1 = 0 ^ 262146 ^ 7 = 262149.
    EXPECT_EQ(random.bits(), 262149u * 5 * 128 * 9);

    Definition definition{{1, 2, 3, 4}};
    Random again({1, 2, 3, 4});
    for (int i = 0; i < 100000; i++) {
        ASSERT_EQ(again.bits(), definition()) << i;
    }
}

TEST(Random, IsSeededByFnvAndSplitmix)
{
    // FNV-1a of eight zero bytes, computed here by repeated multiplication, and splitmix64's
    // published first value for the counter 1234567: 6457827717110365317.
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (int i = 0; i < 8; i++) {
        hash *= 0x100000001b3u;
    }
    const auto splitmix = [](std::uint64_t counter, int n) {
        std::uint64_t z = counter + static_cast<std::uint64_t>(n) * 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    };
    ASSERT_EQ(splitmix(1234567, 1), 6457827717110365317u);
    Random expected({splitmix(hash, 1), splitmix(hash, 2), splitmix(hash, 3), splitmix(hash, 4)});
    Random stream(0, "");
    for (int i = 0; i < 10; i++) {
        EXPECT_EQ(stream.bits(), expected.bits());
    }
}

TEST(Random, SameSeedAndNameGiveTheSameBits)
{
    Random a(42, "world.nav"), b(42, "world.nav");
    for (int i = 0; i < 1001; i++) {
        ASSERT_EQ(a.normal(), b.normal());
    }
    Random copy = a; // in the middle of a pair
    EXPECT_EQ(copy.normal(), a.normal());
    static_assert(std::is_trivially_copyable_v<Random>);
}

TEST(Random, NamesAndSeedsGiveDifferentUncorrelatedStreams)
{
    std::set<std::uint64_t> first;
    for (std::uint64_t seed = 0; seed < 100; seed++) {
        for (int i = 0; i < 100; i++) {
            first.insert(Random(seed, "wheel" + std::to_string(i)).bits());
        }
    }
    EXPECT_EQ(first.size(), 10000u);

    const int n = 100000;
    const std::pair<Random, Random> pairs[] = {
        {Random(7, "world.nav1"), Random(7, "world.nav2")},
        {Random(7, "world.nav"), Random(8, "world.nav")},
        {Random(0, ""), Random(1, "")},
    };
    for (auto [a, b] : pairs) {
        double product = 0.0;
        for (int i = 0; i < n; i++) {
            product += a.normal() * b.normal();
        }
        EXPECT_LT(std::abs(product / n), 4.0 / std::sqrt(n));
    }
}

/// The largest distance between a sample's distribution and `cdf`, times sqrt(n).
template <typename Cdf> double kolmogorov(std::vector<double> sample, Cdf cdf)
{
    std::sort(sample.begin(), sample.end());
    const double n = static_cast<double>(sample.size());
    double distance = 0.0;
    for (std::size_t i = 0; i < sample.size(); i++) {
        const double p = cdf(sample[i]);
        const double rank = static_cast<double>(i);
        distance = std::max({distance, (rank + 1.0) / n - p, p - rank / n});
    }
    return distance * std::sqrt(n);
}

// A distance beyond 1.95 has a probability of 0.001.
constexpr double kolmogorov_limit = 1.95;

TEST(Random, UniformIsUniform)
{
    Random random(1, "uniform");
    std::vector<double> sample(200000);
    for (double &x : sample) {
        x = random.uniform();
        ASSERT_GE(x, 0.0);
        ASSERT_LT(x, 1.0);
    }
    EXPECT_LT(kolmogorov(sample, [](double x) { return x; }), kolmogorov_limit);
}

TEST(Random, UniformUsesAll53BitsAndStaysBelowOne)
{
    // rotl(5 s1, 7) 9 is all ones for the s1 found by inverting it: 9 and 5 are odd, so invertible.
    const std::uint64_t inverse_9 = 0x8e38e38e38e38e39u, inverse_5 = 0xcccccccccccccccdu;
    ASSERT_EQ(inverse_9 * 9, 1u);
    ASSERT_EQ(inverse_5 * 5, 1u);
    const std::uint64_t product = ~std::uint64_t{0} * inverse_9;
    const std::uint64_t s1 = (product >> 7 | product << 57) * inverse_5;
    EXPECT_EQ(Random({0, s1, 0, 0}).uniform(), std::nextafter(1.0, 0.0));
}

TEST(Random, NormalIsNormal)
{
    Random random(1, "normal");
    std::vector<double> sample(200000);
    double moment[5] = {};
    for (double &x : sample) {
        x = random.normal();
        double power = 1.0;
        for (double &m : moment) {
            m += power / static_cast<double>(sample.size());
            power *= x;
        }
    }
    EXPECT_LT(kolmogorov(sample, [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }), kolmogorov_limit);
    // Within four standard deviations of each sample moment: 1, 2, 15 and 96 over n.
    const double root = std::sqrt(static_cast<double>(sample.size()));
    EXPECT_NEAR(moment[1], 0.0, 4.0 * 1.0 / root);
    EXPECT_NEAR(moment[2], 1.0, 4.0 * std::sqrt(2.0) / root);
    EXPECT_NEAR(moment[3], 0.0, 4.0 * std::sqrt(15.0) / root);
    EXPECT_NEAR(moment[4], 3.0, 4.0 * std::sqrt(96.0) / root);
}

TEST(Random, BothOfANormalPairAreIndependent)
{
    Random random(3, "pairs");
    const int n = 100000;
    double product = 0.0, squares = 0.0;
    for (int i = 0; i < n; i++) {
        const double a = random.normal(), b = random.normal();
        product += a * b;
        squares += (a * a - 1.0) * (b * b - 1.0);
    }
    EXPECT_LT(std::abs(product / n), 4.0 / std::sqrt(n));
    EXPECT_LT(std::abs(squares / n), 4.0 * 2.0 / std::sqrt(n));
}

} // namespace random_test
