// SPDX-License-Identifier: Apache-2.0
// Random losses are a Markov process of two states, sampled exactly: within dt a loss begins with the probability
// 1 - exp(-loss_rate dt), and one that lasts ends with 1 - exp(-dt / loss_time).
#include "world/sensors/star_tracker_model.h"

#include "sim/text.h"

#include <numbers>

namespace fledge::world {

namespace {

/// Whether the limb of a sphere, or a point of no radius, is within `exclusion` of the direction `boresight`.
bool blinds(const Vec3 &way, double radius, const Vec3 &boresight, double exclusion)
{
    const double distance = vec_norm(way);
    if (exclusion == 0.0 || distance == 0.0) {
        return false;
    }
    const double half = distance > radius ? fm_asin(radius / distance) : 0.5 * std::numbers::pi;
    return fm_acos(std::clamp(vec_dot(vec_unit(way), boresight), -1.0, 1.0)) < exclusion + half;
}

} // namespace

void StarTrackerModel::check() const
{
    Sensor::check();
    const auto &par = interface_.par;
    if (par.sun_exclusion > 0.0 && !has_sun()) {
        throw sim::SetupError(name_ + ".sun_exclusion is " + sim::format_number(par.sun_exclusion) +
                              " rad, but the tracker has no Sun: wire its input sun, or give it s_N");
    }
    if (par.moon_exclusion > 0.0 && !has("moon", interface_.in.moon.head)) {
        throw sim::SetupError(name_ + ".moon_exclusion is " + sim::format_number(par.moon_exclusion) +
                              " rad, but the tracker has no moon: wire its input moon");
    }
}

/// The bits of Blind. dt [s]: since the last update.
std::uint32_t StarTrackerModel::blinded_by(double dt, const Vec3 &boresight_B)
{
    const auto &in = interface_.in;
    const auto &par = interface_.par;
    const Vec3 boresight_N = mat_transpose_vec(mrp_to_dcm(in.truth.sigma_BN), boresight_B);
    const auto to = [&](const auto &body) { return vec_sub(body.r_PN_N, in.truth.r_BN_N); };
    const Vec3 to_moon = head_written(in.moon.head) ? to(in.moon) : Vec3{};

    const double loss_lasts = par.loss_time > 0.0 ? fm_exp(-dt / par.loss_time) : 0.0; // probabilities
    const double loss_begins = 1.0 - fm_exp(-par.loss_rate * dt);
    interface_.mem.lost = state_.random.uniform() < (interface_.mem.lost ? loss_lasts : loss_begins);

    std::uint32_t bits = 0;
    bits |= blinds(to_sun(), 0.0, boresight_N, par.sun_exclusion) ? by_sun : 0u;
    bits |= blinds(to(in.planet), par.planet_radius, boresight_N, par.planet_exclusion) ? by_planet : 0u;
    bits |= blinds(to_moon, par.moon_radius, boresight_N, par.moon_exclusion) ? by_moon : 0u;
    bits |= par.rate_max > 0.0 && vec_norm(in.truth.omega_BN_B) > par.rate_max ? by_rate : 0u;
    return bits | (interface_.mem.lost ? by_loss : 0u);
}

void StarTrackerModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const CraftState &truth = interface_.in.truth;
    const double dt = tick_seconds(tick.dt);
    const auto variance = [&](double deviation, double noise) {
        return deviation * deviation + (dt > 0.0 ? noise / dt : 0.0);
    };
    const double across = variance(par.deviation_across, par.noise_across);
    const double about = variance(par.deviation_about, par.noise_about);
    const Vec3 case_B = mrp_turn(par.misalignment), boresight_S = vec_unit(par.boresight_B);

    // White noise of the variance `across` about all axes, and more or less about the boresight.
    const Vec3 white = normals();
    const double along = vec_dot(white, boresight_S) * (fm_sqrt(about) - fm_sqrt(across));
    Vec3 turn = vec_add(vec_scale(fm_sqrt(across), white), vec_scale(along, boresight_S));

    const Vec3 boresight_B = mat_transpose_vec(mrp_to_dcm(case_B), boresight_S);
    interface_.mem.blind = blinded_by(dt, boresight_B);
    begin_faults(tick.t);
    state_.faults.add(0, turn.v);
    StarAttitude reading{};
    reading.sigma_BN = mrp_compose(mrp_turn(turn), mrp_compose(case_B, truth.sigma_BN));
    const bool speaks = state_.faults.replace(0, reading.sigma_BN.v, -1.0, 1.0);
    reading.head = {tick.t, quality_through(truth.head), 0};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            reading.P_B.m[i][j] = (i == j ? across : 0.0) + (about - across) * boresight_S.v[i] * boresight_S.v[j];
        }
    }
    const bool sees = speaks && powered() && interface_.mem.blind == 0;
    state_.readings.publish(reading, sees, par.latency, tick.t, interface_.out.attitude);
}

} // namespace fledge::world
