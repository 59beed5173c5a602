// SPDX-License-Identifier: Apache-2.0
// What carries units of bytes (packets, frames) between a flight process and the ground, in simulated time: a model, or
// the memory of a caller outside.
#pragma once

#include "sim/integrator.h"

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

/// A unit of bytes, and when it was sent or came.
struct Packet {
    Ns t; ///< -1: before the first instant
    std::vector<std::uint8_t> bytes;
};

using Unit = std::span<const std::uint8_t>;

/// The newest packet of a stream, of which each packet has the id in its first two bytes.
struct Newest {
    std::uint16_t stream = 0;
    std::uint64_t count = 0; ///< of packets since the first Units::newest() of the stream
    std::vector<std::uint8_t> bytes = {};
};

/// Units for a caller outside, if there is one: they are no part of the simulation's state.
class Units {
public:
    /// The newest packet of a stream, from now on.
    std::shared_ptr<Newest> newest(std::uint16_t stream)
    {
        for (const auto &known : newest_) {
            if (known->stream == stream) {
                return known;
            }
        }
        newest_.push_back(std::make_shared<Newest>(Newest{stream}));
        return newest_.back();
    }
    /// Those since the last call. They are kept from the first call on.
    std::vector<Packet> take()
    {
        keeps_ = true;
        return std::exchange(kept_, {});
    }
    void put(Ns t, Unit unit)
    {
        if (keeps_) {
            kept_.push_back({t, {unit.begin(), unit.end()}});
        }
        for (const auto &of : newest_) {
            if (unit.size() >= 2 && (unit[0] << 8 | unit[1]) == of->stream) {
                of->count++;
                of->bytes.assign(unit.begin(), unit.end());
            }
        }
    }

private:
    std::vector<Packet> kept_;
    std::vector<std::shared_ptr<Newest>> newest_;
    bool keeps_ = false;
};

/// A model that carries units, without looking into them.
class Carrier {
public:
    virtual ~Carrier() = default;

    /// The name of the flight process.
    virtual const std::string &serves() const = 0;

    /// Flight and the ground send at a time, which does not fall.
    virtual void send_down(Ns t, Unit unit) = 0;
    virtual void send_up(Ns t, Unit unit) = 0;

    /// [1/s] bits.
    virtual double down_rate() const = 0;
    virtual double up_rate() const = 0;

    /// As things stand, when the next unit arrives at flight, which may have been before; Ns's largest: none is on the
    /// way.
    virtual Ns next_up() const = 0;

    /// Call with each unit that has reached flight until t, in their order.
    virtual void receive(Ns t, const std::function<void(Unit)> &unit) = 0;

    /// What has reached the ground until t since the last call; kept from the first call on.
    virtual std::vector<Packet> take(Ns t) = 0;
};

} // namespace fledge::sim
