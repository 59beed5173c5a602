// SPDX-License-Identifier: Apache-2.0
// B-dot takes energy out, whatever the rods are, and tumbles of a 12U CubeSat end within stated orbits.
#include "flight/testing/consistency.h"
#include "flight/testing/magnetic_orbit.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/actuation/b_dot.h"
#include "flight/actuation/rod_window.h"
}

namespace flight::testing {
namespace b_dot_test {

constexpr std::int64_t second = 1'000'000'000;
constexpr double degree = pi / 180;

BDot cubesat(const RodSet &rods)
{
    BDot m{};
    m.in.rods = rods;
    m.par = {4e-4, 1e-6, 0, 5, 10, 0.5 * degree, 1500, 10};
    return m;
}

BDot any(Random &random, int n, double m_max = 0)
{
    BDot m = cubesat(any_rods(random, n, m_max));
    m.in.field = {good(), vec(random.direction() * random.real(2e-5, 6e-5))};
    m.in.gyro = {good(), vec(random.vector(0.1))};
    return m;
}

TEST(BDot, damps_the_rate_across_the_field_and_never_drives_it)
{
    Random random{1};
    int limited = 0;
    for (int i = 0; i < 3000; i++) {
        BDot m = any(random, 1 + i % 8, i % 3 ? 0.5 : 0);
        m.par.bang_above = i % 3 == 2 ? 0.05 : 0;
        b_dot_update(&m, {0, 0});
        const Vector3d B = eigen(m.in.field.B_B), b = B.normalized(), omega = eigen(m.in.gyro.omega_BN_B);
        const Vector3d dipole = dipole_of(m.in.rods, m.out.command), L = dipole.cross(B);
        EXPECT_LT((L - eigen(m.out.achieved.torque_B)).norm(), 1e-18);
        EXPECT_LT(std::abs(L.dot(B)), 1e-12 * L.norm() * B.norm());
        EXPECT_LE(L.dot(omega), 0);
        EXPECT_LE(dipole.dot(B.cross(omega)), 0) << "m . dB";
        EXPECT_EQ(m.out.command.head.quality, i % 8 < 2 ? QUALITY_DEGRADED : QUALITY_GOOD);
        for (std::uint32_t k = 0; k < m.in.rods.n; k++) {
            EXPECT_TRUE(m.in.rods.m_max[k] == 0 || std::abs(m.out.command.dipole[k]) <= 0.5 * (1 + 1e-15));
        }
        const Vector3d wanted = -4e-4 * (omega - omega.dot(b) * b);
        limited += m.mem.saturated > 0;
        if (m.in.rods.n >= 3 && m.par.bang_above == 0) {
            EXPECT_LT(L.cross(wanted).norm(), 1e-12 * L.norm() * wanted.norm());
            EXPECT_EQ(L.norm() < (1 - 1e-9) * wanted.norm(), m.mem.saturated == 1);
        } else if (m.par.bang_above > 0 && b.cross(omega).norm() > 0.05) {
            EXPECT_EQ(std::abs(m.out.command.dipole[0]), 0.5);
        }
    }
    EXPECT_GT(limited, 300);
}

TEST(BDot, energy_never_rises)
{
    Random random{2};
    for (int i = 0; i < runs(10); i++) {
        const MagneticOrbit orbit = MagneticOrbit::any(random);
        BDot m = cubesat(any_rods(random, 3 + i % 3, 0.4));
        m.par.bang_above = i % 2 ? 0.02 : 0;
        Craft craft;
        craft.I = random.spd(0.02);
        craft.measure(random.attitude());
        craft.omega = random.direction() * 0.15;
        const double first = craft.energy();
        for (int k = 0; k < 20000; k++) {
            const Tick tick{k * second / 10, k ? second / 10 : 0};
            m.in.field = {good(tick.t), vec(craft.dcm_BN() * orbit.field_N(0.1 * k))};
            m.in.gyro = {good(tick.t), vec(craft.omega)};
            b_dot_update(&m, tick);
            const double before = craft.energy();
            Actions act;
            act.dipole_B = dipole_of(m.in.rods, m.out.command);
            craft.step(orbit, 0.1 * k, 0.1, act);
            ASSERT_LE(craft.energy(), before + 1e-12 * first);
        }
        EXPECT_LT(craft.energy(), 0.9 * first);
    }
}

TEST(BDot, measurements_show_the_rate_that_a_gyro_would)
{
    Random random{3};
    for (int i = 0; i < 300; i++) {
        BDot m = any(random, 3), gyro = m;
        const Vector3d omega = eigen(m.in.gyro.omega_BN_B), B = eigen(m.in.field.B_B);
        m.in.gyro = {};
        m.par.tau = i % 2 ? 0.05 : 0;
        for (int k = 0; k <= 100; k++) { // held for three updates of four, and growing as along an orbit
            const double t = 0.01 * (k / 4 * 4), more = 1 + 1e-3 * t;
            m.in.field = {good(std::llround(t * 1e9)), vec(more * (turn(omega, omega.norm() * t) * B))};
            b_dot_update(&m, {k * second / 100, k ? second / 100 : 0});
        }
        gyro.in.field = m.in.field;
        b_dot_update(&gyro, {second, second});
        const Vector3d found = dipole_of(m.in.rods, m.out.command), ideal = dipole_of(gyro.in.rods, gyro.out.command);
        EXPECT_LT((found - ideal).norm(), 0.02 * 4e-4 * omega.norm() / B.norm());
        EXPECT_NEAR(m.out.state.rate, omega.cross(B.normalized()).norm(), 1e-3 * omega.norm());
        EXPECT_NEAR(gyro.out.state.rate, omega.norm(), 1e-15);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
        EXPECT_TRUE(m.out.state.gyro == 0 && gyro.out.state.gyro == 1);
    }
}

struct Tumble {
    bool gyro, turns;
    double noise, slow, reported; ///< [T], [orbits] until the first may be, and the second is
};

/// Flies a 12U for 3 orbits: [orbits] when it is first below 0.5 deg/s, and when the module has known it for 1500 s.
void detumble(Random &random, const Tumble &how, double &slow, double &reported, double &last)
{
    const MagneticOrbit orbit = MagneticOrbit::any(random);
    Craft craft;
    craft.measure(random.attitude());
    craft.omega = random.direction() * random.real(5, 10) * degree;
    BDot m = cubesat(three_rods(0.4));
    RodWindow window{};
    window.par = {2 * second, 3 * second / 2, second / 5, 10};
    slow = reported = 9;
    const double dt = 0.5, period = 2 * pi / orbit.n;
    Actions act;
    for (int k = 0; k * dt < 3 * period; k++) {
        const double t = k * dt;
        const Tick tick{k * second / 2, k ? second / 2 : 0};
        m.in.field = {good(tick.t), vec(craft.dcm_BN() * orbit.field_N(t) + random.normals(how.noise))};
        if (how.gyro) {
            m.in.gyro = {good(tick.t), vec(craft.omega + random.normals(how.noise * 500))};
        }
        if (how.turns) {
            window.in.measured = m.in.field;
            window.in.measured.B_B = vec_add(m.in.field.B_B, vec(1e-4 * act.dipole_B)); // the field of the rods
            window.in.wanted = m.out.command;
            rod_window_update(&window, tick);
            m.in.field = window.out.field;
        }
        b_dot_update(&m, tick);
        act.dipole_B = dipole_of(m.in.rods, how.turns ? window.out.command : m.out.command);
        slow = craft.omega.norm() < 0.5 * degree ? std::min(slow, t / period) : slow;
        reported = m.out.state.detumbled ? std::min(reported, t / period) : reported;
        craft.step(orbit, t, dt, act);
    }
    last = craft.omega.norm();
    EXPECT_LT(slow, reported) << "it does not say so before it is so";
}

TEST(BDot, tumbles_of_a_12U_end_within_an_orbit)
{
    const Tumble ways[] = {{true, false, 0, 0.8, 1.1},     {true, true, 2e-7, 0.9, 1.2}, {false, false, 0, 0.8, 1.1},
                           {false, false, 1e-7, 0.8, 1.2}, {false, true, 0, 0.9, 1.2},   {false, true, 2e-7, 0.9, 1.3}};
    for (const Tumble &how : ways) {
        Random random{4};
        double most[3] = {0, 0, 0};
        for (int i = 0; i < campaign_runs(6, 100); i++) {
            double slow, reported, last;
            detumble(random, how, slow, reported, last);
            EXPECT_LT(slow, how.slow);
            EXPECT_LT(reported, how.reported);
            EXPECT_LT(last, how.gyro ? 0.01 * degree : 0.3 * degree) << "without a gyro it turns with the field";
            most[0] = std::max(most[0], slow);
            most[1] = std::max(most[1], reported);
            most[2] = std::max(most[2], last / degree);
        }
        std::printf("gyro %d, turns %d, noise %3.0f nT: slow after %.2f orbits, known after %.2f, at last %.3f deg/s\n",
                    how.gyro, how.turns, how.noise * 1e9, most[0], most[1], most[2]);
    }
}

TEST(BDot, ends_without_new_data_and_in_a_weak_field)
{
    for (const bool with_gyro : {true, false}) {
        for (const Quality lost : {QUALITY_NONE, QUALITY_STALE, QUALITY_DEGRADED, QUALITY_GOOD}) {
            Random random{5};
            BDot m = any(random, 3);
            m.par.hold = 3;
            m.in.gyro = with_gyro ? m.in.gyro : GyroRate{};
            m.in.field.head.t = -second;
            b_dot_update(&m, {-second, 0});
            EXPECT_EQ(head_written(m.out.command.head), with_gyro) << "two fields are needed without a gyro";
            m.in.field.head.t = 0;
            m.in.field.B_B = vec(turn(0, 0.1) * eigen(m.in.field.B_B));
            b_dot_update(&m, {0, second});
            EXPECT_EQ(m.out.command.head.quality, QUALITY_GOOD);
            m.in.field.head.quality = lost;
            m.in.field.B_B.v[0] = lost == QUALITY_GOOD ? NAN : m.in.field.B_B.v[0];
            for (int k = 1; k < 8; k++) {
                m.in.gyro.head.t = k * second;
                b_dot_update(&m, {k * second, second});
                EXPECT_EQ(dipole_of(m.in.rods, m.out.command).norm() > 0, k <= 3);
                EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
            }
        }
    }
    Random random{6};
    BDot m = any(random, 3);
    b_dot_update(&m, {0, 0});
    m.in.gyro.head.quality = QUALITY_STALE;
    b_dot_update(&m, {second, second});
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED) << "one field is no change";
    m.in.field = {good(2 * second), vec(turn(0, 0.1) * eigen(m.in.field.B_B))};
    b_dot_update(&m, {2 * second, second});
    EXPECT_EQ(m.out.command.head.t, 2 * second) << "changes stand in for a silent gyro";
    EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    EXPECT_NEAR(m.out.state.rate, 0.1, 0.1);
    for (const double weak : {1e-7, 0.0}) {
        m.in.field.B_B = vec3(weak, 0, 0);
        m.par.field_min = weak > 0 ? m.par.field_min : 0;
        b_dot_update(&m, {3 * second, second});
        EXPECT_EQ(dipole_of(m.in.rods, m.out.command).norm(), 0);
        EXPECT_EQ(m.out.command.head.quality, QUALITY_DEGRADED);
    }
}

} // namespace b_dot_test
} // namespace flight::testing
