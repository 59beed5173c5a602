// SPDX-License-Identifier: Apache-2.0
// The cost of an update of the modules of control and actuation.
#include "bench/bench.h"
#include "bench/update_time.h"

extern "C" {
#include "flight/actuation/momentum_dump.h"
#include "flight/actuation/rod_torques.h"
#include "flight/actuation/thruster_firing.h"
#include "flight/actuation/thruster_mapping.h"
#include "flight/actuation/wheel_balance.h"
#include "flight/actuation/wheel_torques.h"
#include "flight/control/mrp_feedback.h"
#include "flight/control/mrp_steering.h"
#include "flight/control/rate_servo.h"
#include "flight/protection/wheel_monitor.h"
}

#include <cstring>

namespace {

constexpr Head good{0, QUALITY_GOOD, 1};

WheelSet four_wheels()
{
    WheelSet set{};
    set.head = good;
    set.n = 4;
    const double x[] = {-0.5, 0.5, 0.5, -0.5}, y[] = {0.5, 0.5, -0.5, -0.5};
    for (int i = 0; i < 4; i++) {
        set.axes_B[i] = {{x[i], y[i], -0.7071067811865476}};
        set.J[i] = 0.01;
        set.u_max[i] = 0.2;
    }
    return set;
}

WheelSpeeds speeds()
{
    return {good, {100, -50, 30, 20}};
}

/// Two at each end of the body on two sides, which turn it about all axes in both directions.
ThrusterSet eight_thrusters()
{
    ThrusterSet set{};
    set.head = good;
    set.n = 8;
    for (int i = 0; i < 8; i++) {
        const double side = i & 1 ? 1 : -1, end = i & 2 ? 1 : -1, way = i & 4 ? 1 : -1;
        set.r_TC_B[i] = {{0.3 * side, 0.5 * end, 0.2 * way}};
        set.axes_B[i] = {{0.6 * way * end, 0.0, 0.8 * way * side}};
        set.F_max[i] = 1;
    }
    return set;
}

AttError error()
{
    return {good, {{0.1, 0.2, -0.3}}, {{1e-3, -2e-3, 3e-3}}, {{1e-4, 2e-4, 0}}, {}};
}

template <class T> void inertia(T &m)
{
    m.in.vehicle.head = good;
    for (int i = 0; i < 3; i++) {
        m.in.vehicle.I_B.m[i][i] = 50 + 10 * i;
        m.par.P.m[i][i] = 5;
    }
    m.in.error = error();
    m.in.wheels = four_wheels();
    m.in.speeds = speeds();
}

} // namespace

double time_control_update(const char *module, long n)
{
    const auto is = [&](const char *name) { return std::strcmp(module, name) == 0; };
    if (is("MrpFeedback")) {
        MrpFeedback m{};
        inertia(m);
        m.par.K = 1;
        return seconds_per_call(mrp_feedback_update, m, n);
    }
    if (is("MrpSteering")) {
        MrpSteering m{};
        m.in.error = error();
        m.par = {0.15, 1, 0.02};
        return seconds_per_call(mrp_steering_update, m, n);
    }
    if (is("RateServo")) {
        RateServo m{};
        inertia(m);
        m.in.command = {good, {{1e-3, 0, 0}}, {}};
        m.par.K_I = 1;
        m.par.u_I_max = 0.1;
        return seconds_per_call(rate_servo_update, m, n);
    }
    if (is("WheelTorques")) {
        WheelTorques m{};
        m.in.torque = {good, {{0.01, 0.02, -0.03}}};
        m.in.wheels = four_wheels();
        return seconds_per_call(wheel_torques_update, m, n);
    }
    if (is("WheelBalance")) {
        WheelBalance m{};
        m.in.torques = {good, {0.01, 0.02, -0.03}};
        m.in.wheels = four_wheels();
        m.in.speeds = speeds();
        m.par.K = 1e-4;
        return seconds_per_call(wheel_balance_update, m, n);
    }
    if (is("WheelMonitor")) {
        WheelMonitor m{};
        m.in.command = {good, {}};
        m.in.wheels = four_wheels();
        m.in.speeds = speeds();
        m.par.torque_max = 0.01;
        m.par.persistence = 5;
        return seconds_per_call(wheel_monitor_update, m, n,
                                [](auto &law, long, int64_t t) { law.in.speeds.head.t = t; });
    }
    if (is("ThrusterMapping") || is("ThrusterMapping, with a force") ||
        is("ThrusterMapping, another torque each time")) {
        ThrusterMapping m{};
        if (is("ThrusterMapping, with a force")) {
            m.in.force = {good, {{0.05, 0.0, -0.02}}};
        }
        m.in.torque = {good, {{0.01, 0.02, -0.03}}};
        m.in.thrusters = eight_thrusters();
        const bool turns = is("ThrusterMapping, another torque each time");
        return seconds_per_call(thruster_mapping_update, m, n, [&](ThrusterMapping &law, long i, int64_t) {
            if (turns) {
                law.in.torque.torque_B = {{i & 1 ? 0.01 : -0.01, i & 2 ? 0.02 : -0.02, i & 4 ? 0.03 : -0.03}};
            }
        });
    }
    if (is("ThrusterFiring")) {
        ThrusterFiring m{};
        m.in.forces = {good, {0.1, 0.01, 0.5, 0, 0, 1, 0.2, 0.3}};
        m.in.thrusters = eight_thrusters();
        m.par = {0.5, 0.02, 0.75, 0.25};
        return seconds_per_call(thruster_firing_update, m, n,
                                [](ThrusterFiring &law, long, int64_t t) { law.in.forces.head.t = t; });
    }
    if (is("MomentumDump")) {
        MomentumDump m{};
        m.in.wheels = four_wheels();
        m.in.speeds = speeds();
        m.par.gain = 1e-3;
        return seconds_per_call(momentum_dump_update, m, n);
    }
    if (is("RodTorques")) {
        RodTorques m{};
        m.in.torque = {good, {{1e-4, 2e-4, -3e-4}}};
        m.in.field = {good, {{2e-5, -1e-5, 3e-5}}};
        m.in.rods.head = good;
        m.in.rods.n = 3;
        for (int i = 0; i < 3; i++) {
            m.in.rods.axes_B[i].v[i] = 1;
            m.in.rods.m_max[i] = 30;
        }
        m.par.field_min = 1e-6;
        return seconds_per_call(rod_torques_update, m, n);
    }
    return -1.0;
}
