// SPDX-License-Identifier: Apache-2.0
// A few modules and a model with hand-written tables, to test the kernel without the real ones.
#pragma once

#include "flight/msg/head.h"
#include "sim/error.h"
#include "sim/instance.h"
#include "sim/simulation.h"
#include "tests/error_of.h"

#include <memory>
#include <string>
#include <vector>

namespace fledge::sim::toys {

/// A message of one number.
struct Number {
    Head head;
    double x;
};

/// Puts out `value`, or a count of its updates from there if `ramp` is set. Has no input.
struct Source {
    struct {
        Number number;
    } out;
    struct {
        double value; // required, > 0
        double ramp;
    } par;
};

/// Puts out its input times `gain`, and remembers when it ran and how often it was at its limit.
struct Scale {
    struct {
        Number number;
        Number offset; // optional, distinct number
    } in;
    struct {
        Number number;
    } out;
    struct {
        double gain;
        double limit; // of the product's magnitude; 0: none
    } par;
    struct {
        std::int64_t t, dt;
        std::int64_t updates;
        std::uint64_t saturated;
    } mem;
};

/// A model: integrates its input over time exactly, as a sum of rectangles.
struct Tank {
    struct {
        Number flow; // optional
    } in;
    struct {
        Number level;
    } out;
    struct {
        double initial; // assumed, initial
    } par;
};

/// Takes a flow from inside a Tank; is advanced by it.
struct Leak {
    struct {
        Number command; // optional
    } in;
    struct {
        Number flow;
    } out;
};

extern const FledgeStruct number_type, source_type, scale_type, tank_interface, leak_interface;
extern const ModelType tank_type, leak_type;

constexpr Ns ms = 1'000'000;

/// A new instance of a module's or model's type in a process.
template <class Type> std::shared_ptr<Instance> make(Process &process, const std::string &name, const Type &type)
{
    auto instance = std::make_shared<Instance>(type);
    process.add(name, instance);
    return instance;
}

/// Good Numbers, each valid at its time.
std::shared_ptr<const Messages> messages(std::vector<Ns> times, std::initializer_list<double> values);

/// The level of a Tank is below a number.
Condition below(const std::shared_ptr<Instance> &tank, double x);

/// Let a Tank advance a Leak.
void attach(const Instance &tank, const Instance &leak);

/// Every update of a Source, Scale or Tank, in order, as (instance memory, time): for order tests.
struct Update {
    const void *memory;
    Ns t;
};
extern std::vector<Update> *updates; ///< null: not recorded

template <class T> T &interface(const std::shared_ptr<Instance> &instance)
{
    return *reinterpret_cast<T *>(instance->memory());
}

inline Port port(const std::shared_ptr<Instance> &instance, std::string_view name)
{
    return {instance, find_field(instance->type(), name)};
}

/// A Tank in the world, at 10 Hz, whose level a Scale in flight, at 2 Hz, drives from 8 to 0: x' = -0.5 x.
struct Loop {
    explicit Loop(WireOptions command = {}, WireOptions level = {});
    double level() const { return interface<Tank>(tank).out.level.x; }

    Simulation sim;
    std::shared_ptr<Instance> tank = std::make_shared<Instance>(tank_type);
    std::shared_ptr<Instance> control = std::make_shared<Instance>(scale_type);
};

} // namespace fledge::sim::toys
