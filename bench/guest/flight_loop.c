/* SPDX-License-Identifier: Apache-2.0 */
/* The flight modules of the nadir spin, wired by hand, around a rigid body: a small closed loop. */
#include "bench/guest/guest.h"
#include "flight/actuation/wheel_torques.h"
#include "flight/control/mrp_feedback.h"
#include "flight/guidance/euler_rotation.h"
#include "flight/guidance/hill_pointing.h"
#include "flight/guidance/tracking_error.h"
#include "flight/math/attitude.h"
#include "flight/vehicle/vehicle_config.h"
#include "flight/vehicle/wheel_config.h"

static VehicleConfig vehicle;
static WheelConfig wheels;
static HillPointing guidance;
static EulerRotation spin;
static TrackingError tracking;
static MrpFeedback control;
static WheelTorques motor;

static const double inertia[3] = {700.0, 700.0, 800.0};

/* The attitude, the rates and the orbit after dt [s]. */
static void move(double dt)
{
    NavAttitude *a = &tracking.in.attitude;
    NavOrbit *o = &guidance.in.orbit;
    const Vec3 torque = motor.out.achieved.torque_B, w = a->omega_BN_B;
    const double *i = inertia;
    const Vec3 h = vec3(i[0] * w.v[0], i[1] * w.v[1], i[2] * w.v[2]);
    const Vec3 dh = vec_sub(torque, vec_cross(w, h));
    const Vec3 ds = mrp_rate(a->sigma_BN, w);
    a->omega_BN_B = vec_add(w, vec3(dt * dh.v[0] / i[0], dt * dh.v[1] / i[1], dt * dh.v[2] / i[2]));
    a->sigma_BN = mrp_short(vec_add(a->sigma_BN, vec_scale(dt, ds)));
    const double r = vec_norm(o->r_BN_N);
    o->v_BN_N = vec_add(o->v_BN_N, vec_scale(-dt * 4.282837e13 / (r * r * r), o->r_BN_N));
    o->r_BN_N = vec_add(o->r_BN_N, vec_scale(dt, o->v_BN_N));
}

uint32_t work(void)
{
    static const double x[] = {-0.5, 0.5, 0.5, -0.5}, y[] = {0.5, 0.5, -0.5, -0.5};
    const Head start = {0, QUALITY_GOOD, 1};
    Tick tick = {0, 500000000};
    for (int i = 0; i < 3; i++) {
        vehicle.par.I_B.m[i][i] = inertia[i];
        control.par.P.m[i][i] = 45.0;
    }
    wheels.par.n = 4;
    for (int i = 0; i < 4; i++) {
        wheels.par.axes_B[i] = vec3(x[i], y[i], -0.7071);
        wheels.par.J[i] = 0.1591549;
        wheels.par.u_max[i] = 0.2;
    }
    spin.par.rates.v[2] = 0.005235987755982988;
    tracking.par.sigma_BcB.v[2] = 1.0;
    control.par.K = 2.531;
    guidance.in.orbit.head = tracking.in.attitude.head = control.in.speeds.head = start;
    guidance.in.orbit.r_BN_N = vec3(0.0, -3.8e6, 0.0);
    guidance.in.orbit.v_BN_N = vec3(3300.0, 0.0, 400.0);
    tracking.in.attitude.sigma_BN = vec3(0.1, 0.2, -0.3);
    tracking.in.attitude.omega_BN_B = vec3(0.001, -0.01, 0.03);
    vehicle_config_update(&vehicle, tick);
    wheel_config_update(&wheels, tick);
    control.in.vehicle = vehicle.out.vehicle;
    control.in.wheels = motor.in.wheels = wheels.out.wheels;
    for (long n = 0; n < 2000L * ROUNDS; n++) {
        tick.t += tick.dt;
        guidance.in.orbit.head.t = tracking.in.attitude.head.t = control.in.speeds.head.t = tick.t;
        hill_pointing_update(&guidance, tick);
        spin.in.base = guidance.out.reference;
        euler_rotation_update(&spin, tick);
        tracking.in.reference = spin.out.reference;
        tracking_error_update(&tracking, tick);
        control.in.error = tracking.out.error;
        mrp_feedback_update(&control, tick);
        motor.in.torque = control.out.torque;
        wheel_torques_update(&motor, tick);
        move(0.5);
    }
    uint32_t sum = 1;
    for (int i = 0; i < 3; i++) {
        sum = mix(mix(sum, tracking.out.error.sigma_BR.v[i]), control.out.torque.torque_B.v[i]);
    }
    return sum;
}
