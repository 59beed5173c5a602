// SPDX-License-Identifier: Apache-2.0
#include "world/actuators/torque_rods_model.h"

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
    state_.again = 1;
    for (std::size_t i = 0; i < par.n; i++) {
        axes_B_[i] = vec_unit(par.axes_B[i]);
    }
}

void TorqueRodsModel::start(const Vec3 &, double *)
{
    field_.check(name_, "field");
    state_ = {};
    state_.again = 1;
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
    const bool commanded = head_written(command.head);
    bool same = !state_.faults.begin(t, par.n_faults, par.faults, injected) && state_.again == 0;
    for (std::size_t i = 0; i < par.n; i++) {
        const double requested = commanded ? command.dipole[i] : 0.0;
        same &= requested == state_.requested[i];
        state_.requested[i] = requested;
    }
    const Vec3 before = state_.dipole_B;
    if (!same) {
        apply();
    }
    interface_.mem.saturated += state_.saturated;
    return vec_norm2(vec_sub(state_.dipole_B, before)) != 0.0;
}

/// Apply faults and limits to the requested dipoles.
void TorqueRodsModel::apply()
{
    const auto &par = interface_.par;
    state_.again = state_.faults.any();
    state_.dipole_B = {};
    state_.saturated = 0;
    for (std::size_t i = 0; i < par.n; i++) {
        const double most = par.m_max[i] > 0.0 ? par.m_max[i] : unlimited, requested = state_.requested[i];
        double m = std::clamp(requested, -most, most);
        state_.saturated |=
            std::abs(m - requested) > 1e-9 * std::abs(requested); // flight's scaling may exceed it by rounding
        state_.faults.apply(i, {&m, 1}, -most, most);
        m = std::clamp(m, -most, most);
        interface_.out.applied.dipole[i] = m;
        state_.dipole_B = vec_add(state_.dipole_B, vec_scale(m, axes_B_[i]));
    }
}

void TorqueRodsModel::derive(const double *, const Motion &motion, double *, Loads &loads) const
{
    const Eigen::Vector3d B_N = field_->at(motion.start, motion.tau, view(motion.r_BN_N));
    sim::in_registers<&TorqueRodsModel::turn>(*this, B_N.x(), B_N.y(), B_N.z(), motion.sigma_BN, loads);
}

/// Add the torque in the field x, y, z.
LANES_INLINE void TorqueRodsModel::turn(double x, double y, double z, const Vec3 &sigma_BN, Loads &loads) const
{
    const Quad torque = cross(quad(state_.dipole_B), Attitude(quad(sigma_BN)).to_B(Quad{x, y, z, 0.0}));
    keep(torque);
    put(loads.torque, quad(loads.torque) + torque);
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
