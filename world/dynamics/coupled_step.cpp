// SPDX-License-Identifier: Apache-2.0
// The steps in registers of a craft with coupled parts. The compiler schedules this file's instructions before it
// assigns registers (world/CMakeLists.txt), so that the matrix of the next stage and the accelerations of this one
// stand between each other.
#include "world/dynamics/coupled_step.h"

#include "world/actuators/control_moment_gyros_model.h"
#include "world/dynamics/hinged_panels_model.h"
#include "world/dynamics/reaction_wheels_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/eigen.h"

#include <utility>

namespace fledge::world {

using sim::state_block;

namespace {

template <class Model> const Model &as(const auto *part)
{
    return static_cast<const Model &>(*part->effector);
}

/// How many a part of this model has; 0 if it is another model's.
template <class Model> std::size_t count(const auto &part)
{
    const auto *model = dynamic_cast<const Model *>(part.effector);
    return model ? model->size() : 0;
}

} // namespace

template <class First, class Second>
LANES_INLINE void SpacecraftModel::step_coupled(First first, std::size_t at_first, Second second, std::size_t at_second,
                                                sim::Ns dt)
{
    using Craft = CoupledCraft<First, Second>;
    using State = typename Craft::State;
    const auto load = [&](const double *from) LANES_LAMBDA {
        return State{quad_at(from + at_r),     quad_at(from + at_v),        quad_at(from + at_sigma),
                     quad_at(from + at_omega), first.load(from + at_first), second.load(from + at_second)};
    };
    const auto store = [&](double *to, const State &x) LANES_LAMBDA {
        put_quad(to + at_r, x.r);
        put_quad(to + at_v, x.v);
        put_quad(to + at_sigma, x.sigma);
        put_quad(to + at_omega, x.omega);
        first.store(to + at_first, x.first);
        second.store(to + at_second, x.second);
    };
    Quad torque = quad_at(held_ + at_torque_B);
    if constexpr (std::is_same_v<Second, BalancedWheels>) {
        torque += quad(*rotors_->reaction);
    }
    const Craft craft{first, second, hub_, torque, tick_seconds(dt)};
    Quad gravity;
    const auto fall = [&](double tau, Quad r) LANES_LAMBDA {
        return gravity = tau < 0.0 ? gravity_at(from_ + dt, 0.0, r) : gravity_at(from_, tau, r);
    };
    const State from = load(x_);
    const auto end = [&](const State &x, const typename Craft::Rates &rates, Quad mass) LANES_LAMBDA {
        store(x_, x);
        store(dx_, rates.k);
        put_quad(&whole_.mass, mass);
        put(whole_.drift, rates.drift);
        put(a_, rates.a);
        put(gravity_, gravity);
        const Quad sum = (x.r + x.v) + (x.sigma + x.omega) + (First::sum(x.first) + Second::sum(x.second));
        end_in_registers(from.r, from.v, x.r, sum, craft.h);
    };
    craft.step(from, load(dx_), fall, end);
}

LANES_INLINE void SpacecraftModel::step_wheels(sim::Ns dt)
{
    step_coupled(as<ReactionWheelsModel>(first_).lanes(), first_->at, NoPart{}, 0, dt);
}

template <std::size_t most> LANES_INLINE void SpacecraftModel::step_gyros(sim::Ns dt)
{
    const auto &gyros = as<ControlMomentGyrosModel>(first_);
    if constexpr (most == 4) {
        step_coupled(gyros.lanes(), first_->at, NoPart{}, 0, dt);
    } else {
        step_coupled(gyros.lanes(), first_->at, gyros.lanes(4), first_->at, dt);
    }
}

template <std::size_t most> LANES_INLINE void SpacecraftModel::step_panels(sim::Ns dt)
{
    step_coupled(as<HingedPanelsModel>(first_).up_to<most>(), first_->at, NoPart{}, 0, dt);
}

template <std::size_t most> LANES_INLINE void SpacecraftModel::step_panels_and_balanced_wheels(sim::Ns dt)
{
    step_coupled(as<HingedPanelsModel>(first_).up_to<most>(), first_->at, BalancedWheels{*rotors_}, second_->at, dt);
}

/// The step of a craft with up to four wheels with imbalance, eight gyros or four panels, or with panels and balanced
/// wheels; else null. For eight wheels with imbalance, and for such wheels with panels, registers are too few: the
/// general way is as fast.
SpacecraftModel::Step SpacecraftModel::coupled_step()
{
    if (parts_.size() > 2) {
        return nullptr;
    }
    first_ = &parts_.front();
    second_ = &parts_.back();
    if (count<HingedPanelsModel>(*first_) == 0) {
        std::swap(first_, second_);
    }
    const bool alone = first_ == second_;
    const std::size_t panels = count<HingedPanelsModel>(*first_), wheels = count<ReactionWheelsModel>(*first_),
                      gyros = count<ControlMomentGyrosModel>(*first_);
    if (alone && gyros > 0) {
        return gyros > 4 ? in_steps<&SpacecraftModel::step_gyros<8>> : in_steps<&SpacecraftModel::step_gyros<4>>;
    }
    if (alone && wheels > 0) {
        return wheels > 4 ? nullptr : in_steps<&SpacecraftModel::step_wheels>;
    }
    if (panels == 0 || panels > 4 || (!alone && second_->couples)) {
        return nullptr;
    }
    if (alone) {
        return panels > 2 ? in_steps<&SpacecraftModel::step_panels<4>> : in_steps<&SpacecraftModel::step_panels<2>>;
    }
    turned_ = second_->effector;
    return panels > 2 ? in_steps<&SpacecraftModel::step_panels_and_balanced_wheels<4>>
                      : in_steps<&SpacecraftModel::step_panels_and_balanced_wheels<2>>;
}

} // namespace fledge::world
