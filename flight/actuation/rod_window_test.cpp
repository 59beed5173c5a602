// SPDX-License-Identifier: Apache-2.0
// No measurement that rods disturb passes, and rods that take turns with the magnetometer still dump momentum.
#include "flight/testing/magnetic_orbit.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/momentum_dump.h"
#include "flight/actuation/rod_torques.h"
#include "flight/actuation/rod_window.h"
}

#include <deque>

namespace flight::testing {
namespace rod_window_test {

constexpr std::int64_t ms = 1'000'000, second = 1000 * ms;

RodWindow window(std::int64_t period = 2 * second, std::int64_t on = 1400 * ms, std::int64_t settle = 200 * ms)
{
    RodWindow m{};
    m.par = {period, on, settle, 0};
    m.in.wanted.head = m.in.measured.head = good();
    m.in.wanted.dipole[0] = 0.3;
    m.in.wanted.dipole[7] = -0.1;
    return m;
}

void at(RodWindow &m, std::int64_t t, std::int64_t dt = 100 * ms)
{
    m.in.wanted.head.t = m.in.measured.head.t = t;
    rod_window_update(&m, {t, dt});
}

TEST(RodWindow, no_disturbed_measurement_passes)
{
    Random random{1};
    for (int round = 0; round < runs(300); round++) {
        const std::int64_t dt = (1 + random.below(10)) * 50 * ms, period = (2 + random.below(12)) * 150 * ms;
        const std::int64_t latency = random.below(8) * 30 * ms;
        RodWindow m = window(period, random.below(12) * 150 * ms, random.below(5) * 40 * ms);
        std::deque<MeasuredField> line; // from the sensor, which says in B_B whether rods disturb it
        std::int64_t off = 7, last = 0;
        std::uint32_t clean = 0, taken = 0;
        bool acts = false;
        for (int k = 0; k < 200; k++) {
            const std::int64_t t = k * dt + 7;
            off = acts ? t : off; // the command acts until this instant
            const bool undisturbed = k > 0 && t > off && t - off >= m.par.settle;
            clean += undisturbed;
            line.push_back({good(t), vec3(undisturbed ? 1 : 2, static_cast<double>(t), 0)});
            while (!line.empty() && line.front().head.t + latency <= t) {
                m.in.measured = line.front();
                line.pop_front();
            }
            m.in.wanted.head = good(t);
            rod_window_update(&m, {t, k ? dt : 0});
            acts = m.out.command.dipole[0] != 0;
            EXPECT_EQ(acts, t % period < m.par.on);
            if (m.out.field.head.sequence != taken) {
                taken = m.out.field.head.sequence;
                EXPECT_NE(m.out.field.B_B.v[0], 2.0) << "in round " << round << " at " << t;
                EXPECT_EQ(m.out.field.B_B.v[1], static_cast<double>(m.out.field.head.t));
                EXPECT_GT(m.out.field.head.t, last);
                last = m.out.field.head.t;
            }
            EXPECT_EQ(m.out.state.taken, taken);
            const bool old = taken && t - m.out.field.head.t > period;
            EXPECT_EQ(m.out.field.head.quality, !taken ? QUALITY_NONE : old ? QUALITY_DEGRADED : QUALITY_GOOD);
        }
        EXPECT_LE(taken, clean);
        if (latency == 0) {
            EXPECT_GE(taken + 2, clean) << "none is lost but those before the first off part";
        }
    }
}

TEST(RodWindow, says_the_part_of_time_that_the_rods_are_on)
{
    RodWindow m = window();
    double sum = 0;
    for (int k = 0; k <= 200; k++) {
        at(m, k * 100 * ms, k ? 100 * ms : 0);
        sum += m.out.command.dipole[0] / 0.3;
        EXPECT_NEAR(m.out.state.share, 0.7, 1e-12);
    }
    EXPECT_NEAR(sum, 141, 1e-9);
    m = window(); // at 0.6 s the parts of single periods differ, but not their mean
    double mean = 0;
    for (int k = 0; k < 10000; k++) {
        at(m, k * 600 * ms, k ? 600 * ms : 0);
        mean += (m.out.command.dipole[0] != 0) / 10000.0;
        EXPECT_GE(m.out.state.share, 0.5);
        EXPECT_LE(m.out.state.share, 1.0);
    }
    EXPECT_NEAR(mean, 0.7, 1e-3);
}

TEST(RodWindow, rods_are_off_in_their_part_whatever_comes_in_and_end_without_commands)
{
    for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
        RodWindow m = window(10 * second, 6 * second);
        m.par.hold = 2;
        rod_window_update(&m, {0, 0});
        EXPECT_EQ(m.out.command.dipole[7], -0.1);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        m.in.wanted.head.quality = lost;
        if (lost == QUALITY_GOOD) {
            m.in.wanted.dipole[3] = NAN;
        }
        for (int k = 1; k < 30; k++) {
            rod_window_update(&m, {k * second, second});
            EXPECT_EQ(m.out.command.dipole[0] != 0, k <= 2) << k;
            EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
        }
    }
    RodWindow always = window(2 * second, 2 * second), never = window(2 * second, 0), wrong = window(-5, 1);
    for (int k = 0; k < 40; k++) {
        for (RodWindow *m : {&always, &never, &wrong}) {
            at(*m, k * 100 * ms, k ? 100 * ms : 0);
            EXPECT_EQ(m->out.command.dipole[0] != 0, m == &always);
        }
    }
    EXPECT_FALSE(head_written(always.out.field.head)) << "no measurement while the rods never go off";
    EXPECT_EQ(never.out.state.taken, 38u) << "from when they are known to have settled";
}

TEST(RodWindow, bad_measurements_do_not_pass)
{
    RodWindow m = window(), before = m;
    at(m, 1500 * ms);
    at(m, 1800 * ms);
    EXPECT_EQ(m.out.field.head.t, 1800 * ms);
    m.in.measured.B_B.v[2] = INFINITY;
    at(m, 1900 * ms);
    EXPECT_EQ(m.out.field.head.t, 1800 * ms);
    EXPECT_EQ(m.out.field.head.quality, QUALITY_GOOD) << "held until a period has passed";

    Random random{3};
    const std::int64_t times[] = {0, -1, INT64_MAX, INT64_MIN, 5 * second, 7};
    for (int round = 0; round < runs(20000); round++) {
        m = round % 7 ? m : before;
        throw_numbers(doubles(m.in.wanted.dipole, m.in.measured.B_B, m.par.hold), random, round);
        m.in.wanted.head = {times[random.below(6)], any_quality(random), 1};
        m.in.measured.head = {times[random.below(6)], any_quality(random), 1};
        m.par.period = times[random.below(6)];
        m.par.on = times[random.below(6)];
        m.par.settle = times[random.below(6)];
        rod_window_update(&m, {times[random.below(6)], second});
        expect_finite(doubles(m.out.command.dipole, m.out.field.B_B, m.out.state.share), round);
    }
}

/// Momentum that wheels have left after some orbits, of 1, if rods take it out while the body keeps to the Hill frame.
double dumped(Random &random, const RodSet &rods, bool turns, double orbits)
{
    const MagneticOrbit orbit = MagneticOrbit::any(random);
    const Vector3d h0 = random.direction() * 0.02, omega(0, 0, orbit.n);
    MomentumDump dump{};
    RodTorques law{};
    RodWindow m = window(4 * second, 3 * second, second / 2);
    dump.par = {{}, 2e-3, 0, 0, 0, 10};
    law.par = {1e-6, 10};
    law.in.rods = rods;
    dump.in.wheels.head = good();
    dump.in.wheels.n = 3;
    m.par.hold = 10;
    for (int i = 0; i < 3; i++) {
        dump.in.wheels.axes_B[i] = vec(Vector3d::Unit(i));
        dump.in.wheels.J[i] = 1;
    }
    Vector3d h = h0;
    RodCommand command{};
    const double dt = 1;
    for (int k = 0; k * dt < orbits * 2 * pi / orbit.n; k++) {
        const Tick tick{k * second, k ? second : 0};
        const Vector3d B = orbit.hill(k * dt) * orbit.field_N(k * dt);
        dump.in.speeds.head = law.in.field.head = m.in.measured.head = good(tick.t);
        std::copy(h.begin(), h.end(), dump.in.speeds.Omega);
        momentum_dump_update(&dump, tick);
        law.in.field.B_B = m.in.measured.B_B = vec(B);
        law.in.field = turns ? m.out.field : law.in.field;
        if (turns && dipole_of(rods, command).norm() > 0) {
            m.in.measured.B_B.v[0] += 1e-3; // the rods' own field
        }
        law.in.torque = dump.out.torque;
        rod_torques_update(&law, tick);
        m.in.wanted = law.out.command;
        rod_window_update(&m, tick);
        command = turns ? m.out.command : law.out.command;
        const Vector3d L = dipole_of(rods, command).cross(B);
        if (!turns) {
            EXPECT_LE(L.dot(h), 1e-12 * L.norm() * h.norm()) << "no rods, however few, put momentum in";
        }
        h += dt * (L - omega.cross(h + dt / 2 * (L - omega.cross(h))));
    }
    return h.norm() / h0.norm();
}

TEST(RodWindow, any_set_of_rods_dumps_momentum_with_and_without_turns)
{
    Random random{4};
    for (int n = 1; n <= 8; n++) {
        for (int i = 0; i < runs(5); i++) {
            const RodSet rods = any_rods(random, n, 0.4);
            for (const bool turns : {false, true}) {
                const double left = dumped(random, rods, turns, 3);
                EXPECT_LT(left, n == 1 ? 1 : n == 2 ? 0.8 : 0.02) << n << " rods, turns " << turns;
            }
        }
    }
}

TEST(RodWindow, its_share_is_one_at_most)
{
    RodWindow m = window(2 * second, 2 * second, 0);
    at(m, 0);
    at(m, second, 5 * second); // more than went by
    at(m, 2 * second, second);
    EXPECT_EQ(m.out.state.share, 1.0);
}

} // namespace rod_window_test
} // namespace flight::testing
