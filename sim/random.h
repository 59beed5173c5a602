// SPDX-License-Identifier: Apache-2.0
// Random streams that give the same draws on every machine: xoshiro256** (Blackman and Vigna)
// seeded by splitmix64 from (run seed, name), so that adding a model changes no other's draws.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace fledge::sim {

/// A stream of random numbers. Its bytes are its whole state, so it may live in a snapshot.
class Random {
public:
    /// All zero: gives nothing but zeros until it is assigned a seeded one.
    Random() = default;

    /// The stream of this name in a run of this seed: FNV-1a over the seed's eight bytes, least
    /// significant first, then over the name, spread to 256 bits by splitmix64.
    Random(std::uint64_t run_seed, std::string_view name);

    /// A stream from a generator's state, which must not be all zero.
    explicit Random(const std::array<std::uint64_t, 4> &state) : state_(state) {}

    std::uint64_t bits();

    /// Uniform in [0, 1), 53 random bits.
    double uniform();

    /// Standard normal (Box and Muller, one of each pair kept for the next call).
    double normal();

private:
    std::array<std::uint64_t, 4> state_{};
    double kept_ = 0.0;
    std::uint64_t has_kept_ = 0;
};

} // namespace fledge::sim
