// SPDX-License-Identifier: Apache-2.0
#include "world/sensors/navigation_model.h"

#include "world/eigen.h"

namespace fledge::world {

/// The bias, with noise where there is any.
Vec3 NavigationModel::error(const Vec3 &bias, const Vec3 &deviation)
{
    Vec3 sum = bias;
    for (int i = 0; i < 3; i++) {
        sum.v[i] += deviation.v[i] * normal();
    }
    return sum;
}

void NavigationModel::prepare(const sim::Setup &setup)
{
    Sensor::prepare(setup);
    take_parameters();
}

void NavigationModel::refresh()
{
    Sensor::refresh();
    take_parameters();
}

void NavigationModel::take_parameters()
{
    const auto &par = interface_.par;
    bias_turn_ = mrp_turn(par.attitude_bias);
    noisy_ = !(is_zero(par.attitude_noise) && is_zero(par.rate_noise) && is_zero(par.position_noise) &&
               is_zero(par.velocity_noise));
}

void NavigationModel::update(Tick tick)
{
    const auto &par = interface_.par;
    Vec3 turn = par.attitude_bias, mrp = bias_turn_, rate = par.rate_bias;
    Vec3 position = par.position_bias, velocity = par.velocity_bias;
    if (noisy_) {
        // All twelve are drawn, so switching one noise off leaves the others as they were.
        turn = error(par.attitude_bias, par.attitude_noise);
        mrp = mrp_turn(turn);
        rate = error(par.rate_bias, par.rate_noise);
        position = error(par.position_bias, par.position_noise);
        velocity = error(par.velocity_bias, par.velocity_noise);
    }

    if (begin_faults(tick.t)) {
        update_faultily(tick.t, turn, rate, position, velocity);
    } else {
        write(tick.t, mrp, rate, position, velocity);
    }
}

inline void NavigationModel::write(sim::Ns t, const Vec3 &mrp, const Vec3 &rate, const Vec3 &position,
                                   const Vec3 &velocity)
{
    const CraftState &truth = interface_.in.truth;
    NavAttitude &attitude = interface_.out.attitude;
    NavOrbit &orbit = interface_.out.orbit;

    const Quality quality = quality_through(truth.head);
    attitude.head = head_next(attitude.head, t, quality);
    attitude.sigma_BN = is_zero(mrp) ? truth.sigma_BN : mrp_compose(mrp, truth.sigma_BN);
    attitude.omega_BN_B = vec_add(truth.omega_BN_B, rate);

    orbit.head = head_next(orbit.head, t, quality);
    orbit.r_BN_N = vec_add(truth.r_BN_N, position);
    orbit.v_BN_N = vec_add(truth.v_BN_N, velocity);
    orbit.a_BN_N = truth.a_BN_N;
}

void NavigationModel::update_faultily(sim::Ns t, Vec3 turn, const Vec3 &rate, const Vec3 &position,
                                      const Vec3 &velocity)
{
    Faults<12> &faults = state_.faults;
    auto &out = interface_.out;
    const auto before = out;
    faults.add(0, turn.v);
    write(t, mrp_turn(turn), rate, position, velocity);

    bool oriented = faults.replace(0, out.attitude.sigma_BN.v, -1.0, 1.0);
    oriented |= faults.apply(3, out.attitude.omega_BN_B.v);
    bool placed = faults.apply(6, out.orbit.r_BN_N.v);
    placed |= faults.apply(9, out.orbit.v_BN_N.v);
    if (!oriented) {
        out.attitude = before.attitude;
        out.attitude.head = head_held(before.attitude.head);
    }
    if (!placed) {
        out.orbit = before.orbit;
        out.orbit.head = head_held(before.orbit.head);
    }
}

} // namespace fledge::world
