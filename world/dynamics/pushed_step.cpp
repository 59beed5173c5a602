// SPDX-License-Identifier: Apache-2.0
#include "world/dynamics/pushed_step.h"

#include "world/actuators/torque_rods_model.h"
#include "world/dynamics/spacecraft_model.h"

namespace fledge::world {

using sim::state_block;

template <class Wheels> LANES_INLINE auto SpacecraftModel::state_at(const double *from, std::size_t at_wheels)
{
    return RigidState<typename Wheels::State>{quad_at(from + at_r), quad_at(from + at_v), quad_at(from + at_sigma),
                                              quad_at(from + at_omega), Wheels::load(from + at_wheels)};
}

/// Where a step that began at `from` ended, and the rates k there.
template <class Wheels>
LANES_INLINE void SpacecraftModel::end_pushed(const auto &from, const auto &x, const auto &k, std::size_t at_wheels,
                                              Quad gravity, sim::Ns dt)
{
    const auto store = [&](double *to, const auto &state) LANES_LAMBDA {
        put_quad(to + at_r, state.r);
        put_quad(to + at_v, state.v);
        put_quad(to + at_sigma, state.sigma);
        put_quad(to + at_omega, state.omega);
        Wheels::store(to + at_wheels, state.h);
    };
    store(x_, x);
    store(dx_, k);
    put(gravity_, gravity);
    end_in_registers(from.r, from.v, x.r, (x.r + x.v) + (x.sigma + x.omega) + Wheels::sum(x.h), tick_seconds(dt));
}

template <class Wheels, bool has_rods>
LANES_INLINE void SpacecraftModel::step_pushed(Wheels wheels, std::size_t at_wheels, sim::Ns dt)
{
    using Craft = PushedCraft<Wheels, has_rods>;
    Pushing pushing[pushing_parts];
    std::size_t n = 0;
    for (const Part &part : parts_) {
        Pushing &now = pushing[n];
        now.kind = part.effector == rods_ ? Pushing::as_rods : Pushing::as_wheels;
        if (const Ramp *ramp = part.effector->ramp()) {
            if (*ramp->acts == 0) {
                continue;
            }
            now.kind = Pushing::as_ramp;
            now.force = quad(ramp->force->at);
            now.force_rate = quad(ramp->force->rate);
            now.torque = quad(ramp->torque->at);
            now.torque_rate = quad(ramp->torque->rate);
            now.since = tick_seconds(from_ - *ramp->begin);
            now.since_end = tick_seconds(from_ + dt - *ramp->begin);
        }
        n++;
    }
    Quad dipole{};
    if constexpr (has_rods) {
        dipole = quad(rods_->dipole_B());
    }
    const Craft craft{wheels,
                      pushing,
                      n,
                      1.0 / interface_.par.mass,
                      quad_at(held_ + at_force_N),
                      quad_at(held_ + at_force_B),
                      quad_at(held_ + at_torque_B),
                      quad(center_),
                      dipole,
                      {quad_at(I_transposed_.m[0]), quad_at(I_transposed_.m[1]), quad_at(I_transposed_.m[2])},
                      {quad_at(I_inverse_.m[0]), quad_at(I_inverse_.m[1]), quad_at(I_inverse_.m[2])}};
    Quad gravity, B{};
    const auto fall = [&](double tau, Quad r) LANES_LAMBDA {
        return gravity = tau < 0.0 ? gravity_at(from_ + dt, 0.0, r) : gravity_at(from_, tau, r);
    };
    const auto field = [&]([[maybe_unused]] double tau, [[maybe_unused]] Quad r,
                           [[maybe_unused]] Quad sigma) LANES_LAMBDA {
        if constexpr (has_rods) {
            const Quad place = offset_ ? r - Attitude(sigma).to_N(quad(center_)) : r;
            B = tau < 0.0 ? rods_->field(from_ + dt, 0.0, place) : rods_->field(from_, tau, place);
        }
        return B;
    };
    const auto from = state_at<Wheels>(x_, at_wheels);
    auto x = from, k = state_at<Wheels>(dx_, at_wheels);
    craft.step(x, k, tick_seconds(dt), fall, field);
    if constexpr (has_rods) {
        rods_->keep(craft.turning(B, Attitude(x.sigma)));
    }
    end_pushed<Wheels>(from, x, k, at_wheels, gravity, dt);
}

template <bool has_rods> LANES_INLINE void SpacecraftModel::step_pushed_alone(sim::Ns dt)
{
    step_pushed<PushedAlone, has_rods>({}, 0, dt);
}

template <bool has_rods> LANES_INLINE void SpacecraftModel::step_pushed_rotors(sim::Ns dt)
{
    step_pushed<PushedRotors, has_rods>({{*rotors_}}, first_->at, dt);
}

template <bool has_rods> LANES_INLINE void SpacecraftModel::step_pushed_jitter(sim::Ns dt)
{
    step_pushed<PushedJitter, has_rods>({shaking_->lanes()}, first_->at, dt);
}

template <class Wheels> LANES_INLINE void SpacecraftModel::step_tanked(Wheels wheels, std::size_t at_wheels, sim::Ns dt)
{
    const TankedCraft<Wheels> craft{wheels,
                                    first_ == parts_.data(),
                                    *tanked_,
                                    hub_,
                                    tanked_->since(from_),
                                    tanked_->since(from_ + dt),
                                    quad_at(held_ + at_force_N),
                                    quad_at(held_ + at_force_B),
                                    quad_at(held_ + at_torque_B)};
    Quad gravity, a;
    const auto fall = [&](double tau, Quad r) LANES_LAMBDA {
        return gravity = tau < 0.0 ? gravity_at(from_ + dt, 0.0, r) : gravity_at(from_, tau, r);
    };
    const auto from = state_at<Wheels>(x_, at_wheels);
    auto x = from, k = state_at<Wheels>(dx_, at_wheels);
    typename TankedCraft<Wheels>::Shape last;
    craft.step(x, k, last, a, tick_seconds(dt), fall);
    put_quad(&whole_.mass, last.mass);
    put(whole_.drift, Quad{});
    put(a_, a);
    end_pushed<Wheels>(from, x, k, at_wheels, gravity, dt);
}

LANES_INLINE void SpacecraftModel::step_tanked_alone(sim::Ns dt)
{
    step_tanked<PushedAlone>({}, 0, dt);
}

LANES_INLINE void SpacecraftModel::step_tanked_rotors(sim::Ns dt)
{
    step_tanked<PushedRotors>({{*rotors_}}, first_->at, dt);
}

/// The step of a craft with one part with tanks, and at most another, with balanced wheels; else null.
SpacecraftModel::Step SpacecraftModel::tanked_step()
{
    const Part *wheels = nullptr;
    tanked_ = nullptr;
    if (parts_.size() > 2) {
        return nullptr;
    }
    for (const Part &part : parts_) {
        const auto *thrusters = dynamic_cast<const ThrustersModel *>(part.effector);
        if (thrusters && !tanked_ && thrusters->has_tanks() && !thrusters->source()) {
            tanked_ = thrusters;
        } else if (dynamic_cast<const ReactionWheelsModel *>(part.effector) && !part.couples &&
                   !part.effector->pushes()) {
            wheels = &part;
        } else {
            return nullptr;
        }
    }
    if (!tanked_) {
        return nullptr;
    }
    first_ = wheels;
    turned_ = wheels ? wheels->effector : nullptr;
    return wheels ? in_steps<&SpacecraftModel::step_tanked_rotors> : in_steps<&SpacecraftModel::step_tanked_alone>;
}

/// The step while something pushes a rigid craft. Its parts are at most one with wheels, one with rods, and others
/// whose forces are ramps; else null.
SpacecraftModel::Step SpacecraftModel::pushed_step()
{
    first_ = nullptr;
    shaking_ = nullptr;
    rods_ = nullptr;
    if (parts_.size() > pushing_parts || interface_.par.mass == 0.0) {
        return nullptr;
    }
    for (const Part &part : parts_) {
        const auto *rods = dynamic_cast<const TorqueRodsModel *>(part.effector);
        const auto *wheels = dynamic_cast<const ReactionWheelsModel *>(part.effector);
        if (rods && !rods_) {
            rods_ = rods;
        } else if (wheels && !first_ && wheels->size() <= state_block) {
            first_ = &part;
            shaking_ = wheels->pushes() ? wheels : nullptr;
        } else if (!part.effector->ramp()) {
            return nullptr;
        }
    }
    const auto chosen = [this](Step with_rods, Step without) { return rods_ ? with_rods : without; };
    return shaking_ ? chosen(in_steps<&SpacecraftModel::step_pushed_jitter<true>>,
                             in_steps<&SpacecraftModel::step_pushed_jitter<false>>)
           : first_ ? chosen(in_steps<&SpacecraftModel::step_pushed_rotors<true>>,
                             in_steps<&SpacecraftModel::step_pushed_rotors<false>>)
                    : chosen(in_steps<&SpacecraftModel::step_pushed_alone<true>>,
                             in_steps<&SpacecraftModel::step_pushed_alone<false>>);
}

} // namespace fledge::world
