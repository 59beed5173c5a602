// SPDX-License-Identifier: Apache-2.0
// What was at earlier times: a queue of fixed size, whose bytes are its whole state. A delay of more than its size in
// updates moves in steps of delay / (size - 1).
#pragma once

#include "sim/model.h"

#include <array>

namespace fledge::world {

template <class Value, std::size_t size = 64> class Delay {
public:
    /// Make room for a value of time t, if it is time for one of a queue of this delay.
    void open(sim::Ns t, sim::Ns delay)
    {
        opened_ = n_ == 0 || t - times_[newest_at()] >= delay / static_cast<sim::Ns>(size - 1);
        if (opened_) {
            times_[n_++ % size] = t;
        }
    }
    bool opened() const { return opened_; }
    Value &newest() { return values_[newest_at()]; }
    bool empty() const { return n_ == 0; }

    /// The last value that is not of a later time; where there is none, the first.
    const Value &before(sim::Ns t) const { return values_[at(t)]; }

    void clear() { n_ = opened_ = 0; }

private:
    std::size_t newest_at() const { return (n_ - 1) % size; }
    std::size_t at(sim::Ns t) const
    {
        std::uint64_t k = n_;
        for (const std::uint64_t first = n_ > size ? n_ - size : 0; k - 1 > first && times_[(k - 1) % size] > t;) {
            k--;
        }
        return (k - 1) % size;
    }

    std::uint64_t n_ = 0, opened_ = 0; ///< how many values there were; whether the last update added one
    std::array<sim::Ns, size> times_{};
    std::array<Value, size> values_{};
};

} // namespace fledge::world
