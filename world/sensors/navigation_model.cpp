// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/navigation_model.h"

#include "flight/math/attitude.h"

namespace fledge::world {

namespace {

bool is_zero(const Vec3 &a)
{
    return a.v[0] == 0.0 && a.v[1] == 0.0 && a.v[2] == 0.0;
}

/// The MRP of a turn by |angles| [rad] about their direction. The limit for small angles is
/// angles / 4, which is exact to rounding below 1e-8 rad.
Vec3 mrp_of_turn(const Vec3 &angles)
{
    const double angle = vec_norm(angles);
    return vec_scale(angle > 1e-8 ? fm_tan(0.25 * angle) / angle : 0.25, angles);
}

} // namespace

void NavigationModel::prepare(const sim::Setup &setup)
{
    seeded_ = sim::Random(setup.seed, setup.name);
}

void NavigationModel::reset(sim::Ns)
{
    random_ = seeded_;
    interface_.out = {};
}

/// The bias, with noise where there is any.
Vec3 NavigationModel::error(const Vec3 &bias, const Vec3 &deviation)
{
    Vec3 sum = bias;
    for (int i = 0; i < 3; i++) {
        sum.v[i] += deviation.v[i] * random_.normal();
    }
    return sum;
}

void NavigationModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const CraftState &truth = interface_.in.truth;
    NavAttitude &attitude = interface_.out.attitude;
    NavOrbit &orbit = interface_.out.orbit;

    Vec3 turn = par.attitude_bias, rate = par.rate_bias;
    Vec3 position = par.position_bias, velocity = par.velocity_bias;
    if (!(is_zero(par.attitude_noise) && is_zero(par.rate_noise) && is_zero(par.position_noise) &&
          is_zero(par.velocity_noise))) {
        // All twelve are drawn, so switching one noise off leaves the others as they were.
        turn = error(par.attitude_bias, par.attitude_noise);
        rate = error(par.rate_bias, par.rate_noise);
        position = error(par.position_bias, par.position_noise);
        velocity = error(par.velocity_bias, par.velocity_noise);
    }

    const Quality quality = quality_through(truth.head);
    attitude.head = head_next(attitude.head, tick.t, quality);
    attitude.sigma_BN = is_zero(turn) ? truth.sigma_BN : mrp_compose(mrp_of_turn(turn), truth.sigma_BN);
    attitude.omega_BN_B = vec_add(truth.omega_BN_B, rate);

    orbit.head = head_next(orbit.head, tick.t, quality);
    orbit.r_BN_N = vec_add(truth.r_BN_N, position);
    orbit.v_BN_N = vec_add(truth.v_BN_N, velocity);
    orbit.a_BN_N = truth.a_BN_N;
}

} // namespace fledge::world
