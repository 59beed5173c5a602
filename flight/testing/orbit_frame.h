// SPDX-License-Identifier: Apache-2.0
// What Hill and velocity pointing have in common: a frame that follows from an orbit about Mars and, if it is
// wired, the planet's state. `update` is the module's; a Module that `make` makes is in a motion.
#pragma once

#include "flight/testing/conics.h"
#include "flight/testing/kinematics.h"
#include "flight/testing/poison.h"

#include <gtest/gtest.h>

namespace flight::testing {

template <class Module> using MakerOf = Module (*)(const Motion &);

struct Planet {
    Vector3d r = Vector3d::Zero(), v = Vector3d::Zero(), a = Vector3d::Zero();
    Vector3d position(double t) const { return r + t * v + t * t / 2 * a; }
    Vector3d velocity(double t) const { return v + t * a; }
};

/// The reference in a motion relative to the origin of N, or to a planet at time t.
template <class Module>
AttReference reference_of(MakerOf<Module> make, UpdateOf<Module> update, const Motion &motion,
                          const Planet *planet = nullptr, double t = 0)
{
    Module m = make(motion);
    if (planet) {
        m.in.planet = {good(), vec(planet->position(t)), vec(planet->velocity(t)), {}};
        m.in.orbit.r_BN_N = vec(motion.r + planet->position(t));
        m.in.orbit.v_BN_N = vec(motion.v + planet->velocity(t));
    }
    update(&m, {0, 0});
    return m.out.reference;
}

/// The reference is as good as the worst of the orbit and the planet, which need not be there.
template <class Module> void expect_quality_of_inputs(MakerOf<Module> make, UpdateOf<Module> update)
{
    Module m = make({{7e6, 0, 0}, {0, 3e3, 1e3}});
    const Head &head = m.out.reference.head;
    update(&m, {500, 0});
    EXPECT_EQ(head.quality, QUALITY_GOOD) << "without a planet message the planet rests at the origin";
    EXPECT_EQ(head.t, 500);
    EXPECT_EQ(head.sequence, 1u);

    m.in.planet.head = with(QUALITY_STALE);
    update(&m, {1000, 500});
    EXPECT_EQ(head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(head.sequence, 2u);

    m.in.planet.head = with(QUALITY_GOOD);
    m.in.orbit.head = with(QUALITY_STALE);
    update(&m, {1500, 500});
    EXPECT_EQ(head.quality, QUALITY_DEGRADED);
}

/// Where position and velocity span no plane, the last reference is held until they do again.
template <class Module> void expect_held_where_undefined(MakerOf<Module> make, UpdateOf<Module> update)
{
    const Motion motion{{7e6, 1e5, -3e6}, {500, 3e3, 1e3}};
    const Motion undefined[] = {{Vector3d::Zero(), motion.v},
                                {motion.r, Vector3d::Zero()},
                                {motion.r, 1e-4 * motion.r},
                                {motion.r, -1e-4 * motion.r},
                                {motion.r, 1e-4 * motion.r + Vector3d(0, 0, 1e-13)},
                                {motion.r * 1e-170, motion.v},
                                {motion.r * 1e200, motion.v}};
    for (const Motion &bad : undefined) {
        Module m = make(bad);
        update(&m, {0, 0});
        EXPECT_TRUE(all_zero(m.out)) << "there is no earlier reference to hold";

        m = make(motion);
        update(&m, {0, 0});
        const AttReference last = m.out.reference;
        m.in.orbit.r_BN_N = vec(bad.r);
        m.in.orbit.v_BN_N = vec(bad.v);
        update(&m, {500, 500});
        EXPECT_TRUE(same_content(m.out.reference, last));
        EXPECT_EQ(m.out.reference.head.quality, QUALITY_DEGRADED);
        EXPECT_EQ(m.out.reference.head.t, 0) << "its age can be seen";

        m.in.orbit.r_BN_N = vec(motion.r);
        m.in.orbit.v_BN_N = vec(motion.v);
        update(&m, {1000, 500});
        EXPECT_EQ(m.out.reference.head.quality, QUALITY_GOOD);
        EXPECT_EQ(m.out.reference.head.sequence, 2u);
    }
}

/// Without an orbit there is no reference.
template <class Module> void expect_nothing_of_nothing(MakerOf<Module> make, UpdateOf<Module> update)
{
    Module m = make({{7e6, 0, 0}, {0, 3e3, 0}});
    m.in = {};
    update(&m, {500, 0});
    EXPECT_TRUE(all_zero(m.out));
    m.in = make({{7e6, 0, 0}, {0, 3e3, 0}}).in;
    update(&m, {500, 0});
    EXPECT_FALSE(all_zero(m.out));
}

/// Against numbers that are not finite, at the inputs and at the doubles that `more` gives of a module, the last
/// reference is held.
template <class Module>
void expect_held_against_not_finite(
    MakerOf<Module> make, UpdateOf<Module> update, Doubles (*more)(Module &) = [](Module &) { return Doubles{}; })
{
    Module m = make({{7e6, 1e5, -3e6}, {500, 3e3, 1e3}});
    auto &[orbit, planet] = m.in;
    Doubles in = doubles(orbit.r_BN_N, orbit.v_BN_N, planet.r_PN_N, planet.v_PN_N);
    const Doubles others = more(m);
    in.insert(in.end(), others.begin(), others.end());
    planet.head = good();
    update(&m, {0, 0});
    expect_held(
        m, in,
        [update](Module &x) {
            update(&x, {500, 500});
        },
        [](Module &x) { return std::vector{&x.out.reference.head}; });
}

} // namespace flight::testing
