// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/torque_rods_model.h"

#include "world/eigen.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

void TorqueRodsModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    seeded_ = sim::Random(setup.seed, setup.name);
    refresh();
}

void TorqueRodsModel::refresh()
{
    const auto &par = interface_.par;
    const bool limited = std::all_of(par.m_max, par.m_max + par.n, [](double most) { return most > 0.0; });
    check_faults(name_, {par.faults, par.n_faults}, RODS_MAX, limited);
}

void TorqueRodsModel::start(const Vec3 &, double *)
{
    field_.check(name_, "field");
    state_ = {};
    state_.faults.reset(seeded_);
    interface_.out = {};
    interface_.mem = {};
}

bool TorqueRodsModel::latch(const double *, const BodyRate &, double)
{
    state_.is_new = 1;
    return field_.changed();
}

bool TorqueRodsModel::stretch(sim::Ns t, sim::Ns &)
{
    if (!state_.is_new) {
        return false;
    }
    state_.is_new = 0;
    const auto &[command, injected] = interface_.in;
    const auto &par = interface_.par;
    const Vec3 before = state_.dipole_B;
    state_.dipole_B = {};
    state_.faults.begin(t, par.n_faults, par.faults, injected);
    bool saturated = false;
    for (std::size_t i = 0; i < par.n; i++) {
        const double most = par.m_max[i] > 0.0 ? par.m_max[i] : unlimited;
        const double asked = head_written(command.head) ? command.dipole[i] : 0.0;
        double m = std::clamp(asked, -most, most);
        saturated |= std::abs(m - asked) > 1e-9 * std::abs(asked); // what flight has scaled may exceed it by rounding
        state_.faults.apply(i, {&m, 1}, -most, most);
        m = std::clamp(m, -most, most);
        interface_.out.applied.dipole[i] = m;
        state_.dipole_B = vec_add(state_.dipole_B, vec_scale(m, vec_unit(par.axes_B[i])));
    }
    interface_.mem.saturated += saturated;
    return vec_norm2(vec_sub(state_.dipole_B, before)) != 0.0;
}

void TorqueRodsModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const Vec3 B_N = vec(field_->at(motion.start, motion.tau, view(motion.r_BN_N)));
    torque_ = vec_cross(state_.dipole_B, mat_vec(motion.C_BN, B_N));
    loads.torque = vec_add(loads.torque, torque_);
}

void TorqueRodsModel::publish(sim::Ns t, const double *, const Vec3 &)
{
    auto &[applied, torque] = interface_.out;
    applied.head = head_next(applied.head, t, QUALITY_GOOD);
    torque = {head_next(torque.head, t, QUALITY_GOOD), torque_};
}

void TorqueRodsModel::copy_setup(const sim::Model &original,
                                 const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    field_.copy(dynamic_cast<const TorqueRodsModel &>(original).field_, counterpart);
}

} // namespace fledge::world
