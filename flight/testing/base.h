// SPDX-License-Identifier: Apache-2.0
// A base reference in accelerated rotation, for the modules that turn relative to one.
#pragma once

#include "flight/msg/attitude.h"
#include "flight/testing/kinematics.h"

#include <gtest/gtest.h>

#include <vector>

namespace flight::testing {

inline std::int64_t ns(double t)
{
    return std::llround(t * 1e9);
}

/// A base that turns about an axis fixed in N, faster and faster: [R0N] = C turn(axis, angle).
struct Base {
    Matrix3d c = Matrix3d::Identity();
    Vector3d axis_N = Vector3d::UnitX();
    double rate = 0, acceleration = 0;

    AttReference at(double t) const
    {
        double angle = rate * t + acceleration * t * t / 2;
        Vector3d omega = axis_N * (rate + acceleration * t), domega = axis_N * acceleration;
        return {good(ns(t)), dcm_to_mrp(mat(c * turn(axis_N, angle))), vec(omega), vec(domega)};
    }
};

inline Base any_base(Random &random, double rate)
{
    return {random.attitude(), random.direction(), random.real(-rate, rate), random.real(-rate, rate) * rate};
}

/// The reference of a chain of modules at time t, all of which begin to turn at time 0.
template <class Module> AttReference run(std::vector<Module> chain, const Base &base, double t, UpdateOf<Module> update)
{
    AttReference reference = base.at(t);
    for (Module &m : chain) {
        m.in.base = base.at(0);
        update(&m, {0, 0});
        m.in.base = reference;
        update(&m, {ns(t), ns(t)});
        reference = m.out.reference;
    }
    return reference;
}

/// In chains of one to three modules, rate and acceleration are the derivatives. `make` makes a module
/// that turns at up to the given rate.
template <class Module> void expect_derivatives(Module (*make)(Random &, double), UpdateOf<Module> update)
{
    Random random{1};
    for (int i = 0; i < 1000; i++) {
        // The widest difference is a power of two in ns, so that all differences are exact times.
        double h = std::ldexp(1e-9, 26 + i % 12), rate = 0.05 / h;
        Base base = any_base(random, rate);
        std::vector<Module> chain;
        for (int k = 0; k <= i % 3; k++) {
            chain.push_back(make(random, rate));
        }
        double now = h * (1 + random.below(20));
        auto at = [&](double t) { return run(chain, base, now + t, update); };
        KinematicErrors errors = kinematic_errors(at, rate);
        EXPECT_LT(errors.rate, 1e-8);
        EXPECT_LT(errors.acceleration, 1e-8);
    }
}

} // namespace flight::testing
