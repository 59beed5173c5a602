// SPDX-License-Identifier: Apache-2.0
// What sensors share: a random stream, faults of their channels, and the memory of both.
#pragma once

#include "flight/math/attitude.h"
#include "sim/error.h"
#include "sim/model.h"
#include "sim/random.h"
#include "world/faults.h"
#include "world/msg/power.h"

#include <algorithm>
#include <string>
#include <vector>

namespace fledge::world {

/// A model with the parameters n_faults and faults and the input injected. Readings: a Late, if it needs time until
/// it puts out a reading.
template <class Interface, std::size_t channels, class Readings = std::uint64_t> class Sensor : public sim::Model {
public:
    explicit Sensor(Interface &interface) : interface_(interface) {}

    void prepare(const sim::Setup &setup) override
    {
        name_ = setup.name;
        seeded_ = sim::Random(setup.seed, setup.name);
        wired_ = setup.wired;
        check();
    }
    void refresh() override { check(); }
    void reset(sim::Ns) override
    {
        state_ = {seeded_, {}, {}};
        state_.faults.reset(seeded_);
        interface_.out = {};
        if constexpr (requires { interface_.mem; }) {
            interface_.mem = {};
        }
    }
    void reseed() override
    {
        state_.random = seeded_;
        state_.faults.reseed(seeded_);
    }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span(&state_, 1)); }

protected:
    /// Whether every channel has limits of its own.
    virtual bool limited() const { return false; }

    /// Throws SetupError that begins with name_.
    virtual void check() const
    {
        const auto &par = interface_.par;
        check_faults(name_, {par.faults, par.n_faults}, channels, limited());
    }

    /// Whether an optional input is wired, or has been written by hand.
    bool has(const char *input, const Head &head) const
    {
        return head_written(head) || std::find(wired_.begin(), wired_.end(), input) != wired_.end();
    }

    /// Whether to_sun() has a direction.
    bool has_sun() const
    {
        const auto &in = interface_.in;
        if constexpr (requires { in.light; }) {
            if (has("light", in.light.head)) {
                return true;
            }
        }
        return vec_norm2(interface_.par.s_N) != 0.0 || has("sun", in.sun.head);
    }

    /// Towards the Sun, N components, of any length: by its own message, else by that of the light, else by s_N.
    Vec3 to_sun() const
    {
        const auto &in = interface_.in;
        if (head_written(in.sun.head)) {
            return vec_sub(in.sun.r_PN_N, in.truth.r_BN_N);
        }
        if constexpr (requires { in.light; }) {
            if (head_written(in.light.head)) {
                return in.light.s_N;
            }
        }
        return interface_.par.s_N;
    }

    bool begin_faults(sim::Ns t)
    {
        return state_.faults.begin(t, interface_.par.n_faults, interface_.par.faults, interface_.in.injected);
    }

    /// Whether its load of the input `power` has power, where it has such an input.
    bool powered() const
    {
        if constexpr (requires { interface_.in.power; }) {
            return supplied(&interface_.in.power, interface_.par.load);
        }
        return true;
    }

    /// Of a channel that is 1 while a unit works: whether it does.
    bool works(std::size_t channel)
    {
        double x = 1.0;
        state_.faults.apply(channel, {&x, 1}, 0.0, 1.0);
        return x >= 0.5;
    }

    double normal() { return state_.random.normal(); }
    Vec3 normals()
    {
        Vec3 drawn{};
        for (double &x : drawn.v) {
            x = normal();
        }
        return drawn;
    }

    struct State {
        sim::Random random;
        Faults<channels> faults;
        Readings readings;
    };
    Interface &interface_;
    std::string name_;
    sim::Random seeded_; ///< the stream as each run begins it
    std::vector<std::string> wired_;
    State state_{};
};

/// A sensor each of whose channels has limits of its own.
template <class Interface, std::size_t channels, class Readings = std::uint64_t>
class LimitedSensor : public Sensor<Interface, channels, Readings> {
public:
    using Sensor<Interface, channels, Readings>::Sensor;

protected:
    bool limited() const final { return true; }
};

/// The readings of a sensor that needs time until it puts them out.
template <class Reading> class Late {
public:
    /// Take a reading of the time t, if the sensor speaks, and write to `out` the newest that is `latency` [s] old. Its
    /// head keeps the time of the measurement. Without a new one, the output is held.
    void publish(const Reading &reading, bool speaks, double latency, sim::Ns t, Reading &out)
    {
        const auto delay = static_cast<sim::Ns>(latency * 1e9);
        if (speaks) {
            readings_.open(t, delay);
            if (readings_.opened()) {
                readings_.newest() = reading;
            }
        }
        const Head last = out.head;
        const Reading *due = readings_.empty() ? nullptr : &readings_.before(t - delay);
        if (due && due->head.t <= t - delay && (!head_written(last) || due->head.t > last.t)) {
            out = *due;
            out.head = head_next(last, due->head.t, due->head.quality);
        } else {
            out.head = head_held(last);
        }
    }

private:
    Delay<Reading> readings_;
};

/// The head of an output that the sensor writes, or, where it is silent, does not.
inline Head head_of_reading(Head last, sim::Ns t, Quality quality, bool speaks)
{
    return speaks ? head_next(last, t, quality) : head_held(last);
}

} // namespace fledge::world
