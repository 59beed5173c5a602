// SPDX-License-Identifier: Apache-2.0
// Wheels that do what they are commanded, and wheels that do not.
#include "flight/testing/eigen.h"

extern "C" {
#include "flight/protection/wheel_monitor.h"
}

#include <gtest/gtest.h>

#include <string>

namespace flight::testing {
namespace wheel_monitor_test {

constexpr std::int64_t period = 500'000'000;

struct Wheels {
    WheelMonitor m{};
    std::int64_t t = 0;
    double given[4] = {1, 1, 1, 1}; // part of the command that the motors give
    double Omega[4] = {};
    int each = 1; // updates from one measurement to the next

    Wheels()
    {
        m.par.torque_max = 0.02;
        m.par.persistence = 4;
        m.in.wheels = {good(), 4, 0, {}, {0.1, 0.1, 0.1, 0.1}, {}};
        m.in.speeds.head = good();
    }

    /// n updates with commands of 0.1 N m in turn of sign.
    void fly(int n)
    {
        for (int i = 0; i < n; i++, t += period) {
            if (i % each == 0) {
                m.in.speeds.head.t = t;
                std::copy(Omega, Omega + 4, m.in.speeds.Omega);
            }
            wheel_monitor_update(&m, {t, t ? period : 0});
            m.in.command.head = good(t);
            for (int k = 0; k < 4; k++) {
                m.in.command.u[k] = (i / 3 + k) % 2 ? 0.1 : -0.1;
                Omega[k] += given[k] * m.in.command.u[k] / 0.1 * 0.5;
            }
        }
    }

    std::string available() const
    {
        std::string out;
        for (int k = 0; k < 4; k++) {
            out += m.out.availability.available[k] ? 'y' : 'n';
        }
        return out;
    }
};

TEST(WheelMonitor, sound_wheels_stay_in_use)
{
    Wheels w;
    w.given[1] = 0.85; // friction of 0.015 N m
    w.fly(100);
    EXPECT_EQ(w.available(), "yyyy");
    EXPECT_EQ(w.m.out.availability.available[4], 0) << "there is none";
    EXPECT_EQ(w.m.out.state.tripped, 0u);
    EXPECT_NEAR(w.m.out.state.value, 0.75, 1e-9);
    EXPECT_EQ(w.m.out.availability.head.quality, QUALITY_GOOD);
}

TEST(WheelMonitor, a_wheel_that_stops_is_taken_out_after_its_persistence_and_stays_out)
{
    Wheels w;
    w.fly(20);
    w.given[2] = 0;
    w.fly(4); // the first sees what was commanded before
    EXPECT_EQ(w.available(), "yyyy");
    w.fly(1);
    EXPECT_EQ(w.available(), "yyny");
    EXPECT_EQ(w.m.out.state.tripped, 1u);
    w.given[2] = 1;
    w.fly(50);
    EXPECT_EQ(w.available(), "yyny");
    EXPECT_EQ(w.m.out.state.trips, 1u);
    w.m.par.on = 0b0100;
    w.m.par.off = 0b0001;
    w.fly(1);
    EXPECT_EQ(w.available(), "nyyy");
    wheel_monitor_reset(&w.m);
    w.m.par.on = w.m.par.off = 0;
    w.fly(20);
    EXPECT_EQ(w.available(), "yyyy");
}

TEST(WheelMonitor, of_the_last_wheels_no_fault_is_believed)
{
    Wheels w;
    w.m.par.least = 3;
    w.fly(20);
    for (double &given : w.given) {
        given = 0;
    }
    w.fly(20);
    EXPECT_EQ(w.available(), "nyyy");
    EXPECT_EQ(w.m.out.state.trips, 1u);
}

TEST(WheelMonitor, slow_tachometers_condemn_no_wheel)
{
    Wheels w;
    w.each = 3; // as the commands change
    w.fly(99);
    EXPECT_EQ(w.available(), "yyyy");
    EXPECT_EQ(w.m.out.state.unknown, 67u);
}

TEST(WheelMonitor, a_short_disturbance_and_missing_speeds_do_not_count)
{
    Wheels w;
    for (int i = 0; i < 20; i++) {
        w.given[0] = 0;
        w.fly(3);
        w.given[0] = 1;
        w.fly(1);
        w.fly(1);
    }
    EXPECT_EQ(w.available(), "yyyy");
    w.given[0] = 0;
    w.m.in.speeds.head.quality = QUALITY_NONE;
    w.fly(20);
    EXPECT_EQ(w.available(), "yyyy");
    EXPECT_EQ(w.m.out.availability.head.quality, QUALITY_DEGRADED);
    EXPECT_EQ(w.m.out.state.unknown, 21u) << "and the first update";
}

} // namespace wheel_monitor_test
} // namespace flight::testing
