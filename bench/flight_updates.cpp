// SPDX-License-Identifier: Apache-2.0
// The cost of each flight module's update, on the inputs that it has in the nadir spin.
#include "bench/bench.h"
#include "bench/update_time.h"

extern "C" {
#include "flight/actuation/wheel_torques.h"
#include "flight/control/mrp_feedback.h"
#include "flight/guidance/euler_rotation.h"
#include "flight/guidance/hill_pointing.h"
#include "flight/guidance/tracking_error.h"
#include "flight/vehicle/vehicle_config.h"
#include "flight/vehicle/wheel_config.h"
}

#include <cstring>

namespace {

/// The chain of the nadir spin, wired by hand.
struct Chain {
    Chain()
    {
        const Head good{0, QUALITY_GOOD, 1};
        for (int i = 0; i < 3; i++) {
            vehicle.par.I_B.m[i][i] = i < 2 ? 700.0 : 800.0;
            control.par.P.m[i][i] = 45.0;
        }
        wheels.par.n = 4;
        const double x[] = {-0.5, 0.5, 0.5, -0.5}, y[] = {0.5, 0.5, -0.5, -0.5};
        for (int i = 0; i < 4; i++) {
            wheels.par.axes_B[i] = Vec3{{x[i], y[i], -0.7071}};
            wheels.par.J[i] = 0.1591549;
            wheels.par.u_max[i] = 0.2;
        }
        spin.par.rates.v[2] = 0.005235987755982988;
        tracking.par.sigma_BcB.v[2] = 1.0;
        control.par.K = 2.531;
        guidance.in.orbit = {good, {{0.0, -6.27e6, 0.0}}, {{2612.0, 1044.0, 0.0}}, {}};
        tracking.in.attitude = {good, {{0.1, 0.2, -0.3}}, {{0.001, -0.01, 0.03}}};
        control.in.speeds.head = good;
        vehicle_config_update(&vehicle, {0, 0});
        wheel_config_update(&wheels, {0, 0});
        control.in.vehicle = vehicle.out.vehicle;
        control.in.wheels = motor.in.wheels = wheels.out.wheels;
        hill_pointing_update(&guidance, {0, 0});
        spin.in.base = guidance.out.reference;
        euler_rotation_update(&spin, {0, 0});
        tracking.in.reference = spin.out.reference;
        tracking_error_update(&tracking, {0, 0});
        control.in.error = tracking.out.error;
        mrp_feedback_update(&control, {0, 0});
        motor.in.torque = control.out.torque;
        wheel_torques_update(&motor, {0, 0});
    }

    VehicleConfig vehicle{};
    WheelConfig wheels{};
    HillPointing guidance{};
    EulerRotation spin{};
    TrackingError tracking{};
    MrpFeedback control{};
    WheelTorques motor{};
};

} // namespace

double time_flight_update(const char *module, long n)
{
    Chain chain;
    const auto is = [&](const char *name) { return std::strcmp(module, name) == 0; };
    return is("HillPointing")    ? seconds_per_call(hill_pointing_update, chain.guidance, n)
           : is("EulerRotation") ? seconds_per_call(euler_rotation_update, chain.spin, n)
           : is("TrackingError") ? seconds_per_call(tracking_error_update, chain.tracking, n)
           : is("MrpFeedback")   ? seconds_per_call(mrp_feedback_update, chain.control, n)
           : is("WheelTorques")  ? seconds_per_call(wheel_torques_update, chain.motor, n)
                                 : -1.0;
}
