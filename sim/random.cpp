// SPDX-License-Identifier: Apache-2.0
// xoshiro256**: state s of four words,
//   result = rotl(5 s1, 7) 9;  t = s1 << 17;
//   s2 ^= s0;  s3 ^= s1;  s1 ^= s2;  s0 ^= s3;  s2 ^= t;  s3 = rotl(s3, 45).
#include "sim/random.h"

#include "flight/math/elementary.h"

#include <bit>

namespace fledge::sim {

namespace {

std::uint64_t fnv1a(std::uint64_t hash, std::uint8_t byte)
{
    return (hash ^ byte) * 0x100000001b3u;
}

std::uint64_t splitmix64(std::uint64_t &counter)
{
    counter += 0x9e3779b97f4a7c15u;
    std::uint64_t z = counter;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

} // namespace

Random::Random(std::uint64_t run_seed, std::string_view name)
{
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (int shift = 0; shift < 64; shift += 8) {
        hash = fnv1a(hash, static_cast<std::uint8_t>(run_seed >> shift));
    }
    for (const char c : name) {
        hash = fnv1a(hash, static_cast<std::uint8_t>(c));
    }
    // Four successive values cannot all be 0, as splitmix64 takes each value once.
    for (std::uint64_t &word : state_) {
        word = splitmix64(hash);
    }
}

std::uint64_t Random::bits()
{
    auto &[s0, s1, s2, s3] = state_;
    const std::uint64_t result = std::rotl(s1 * 5, 7) * 9;
    const std::uint64_t t = s1 << 17;
    s2 ^= s0;
    s3 ^= s1;
    s1 ^= s2;
    s0 ^= s3;
    s2 ^= t;
    s3 = std::rotl(s3, 45);
    return result;
}

double Random::uniform()
{
    return static_cast<double>(bits() >> 11) * 0x1p-53;
}

double Random::normal()
{
    if (has_kept_) {
        has_kept_ = 0;
        return kept_;
    }
    constexpr double two_pi = 6.283185307179586;
    const double radius = fm_sqrt(-2.0 * fm_log(1.0 - uniform())); // the argument is never 0
    double sine, cosine;
    fm_sincos(two_pi * uniform(), &sine, &cosine);
    kept_ = radius * sine;
    has_kept_ = 1;
    return radius * cosine;
}

} // namespace fledge::sim
