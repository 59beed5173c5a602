// SPDX-License-Identifier: Apache-2.0
#include "world/environment/celestial_body_model.h"

#include "sim/error.h"
#include "world/eigen.h"
#include "world/environment/bodies.h"

namespace fledge::world {

using sim::Ns;

void CelestialBodyModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    if (!sky_) {
        throw sim::SetupError(name_ + ".sky is missing: the sky in which " + body_name(interface_.par.id) + " is");
    }
    refresh();
}

void CelestialBodyModel::refresh()
{
    target_ = sky_->given_as(interface_.par.id);
    covered_ = 0;
    cursor_ = {};
    try {
        sky_->require(target_, 0, 0);
    } catch (const sim::SetupError &error) {
        throw sim::SetupError(name_ + ": " + error.what());
    }
}

void CelestialBodyModel::ensure_data_until(Ns until)
{
    if (until <= covered_) {
        return;
    }
    try {
        sky_->require(target_, covered_, until);
    } catch (const sim::SetupError &error) {
        throw sim::SetupError(name_ + ": " + error.what());
    }
    covered_ = until;
}

void CelestialBodyModel::reset(Ns t)
{
    interface_.out = {};
    publish(t);
}

void CelestialBodyModel::publish(Ns t)
{
    try {
        const BodyState state = sky_->state(target_, t, cursor_);
        interface_.out.state = {head_next(interface_.out.state.head, t, QUALITY_GOOD), vec(state.r), vec(state.v),
                                vec(state.a)};
    } catch (const sim::RunError &error) {
        throw sim::RunError(name_ + ": " + error.what());
    }
}

std::vector<std::string> CelestialBodyModel::assumptions() const
{
    const int target = sky_ ? sky_->given_as(interface_.par.id) : interface_.par.id;
    if (target == interface_.par.id) {
        return {};
    }
    return {"state: the ephemeris has no " + body_name(interface_.par.id) + "; it is that of " + body_name(target)};
}

void CelestialBodyModel::copy_setup(const sim::Model &original, const std::function<sim::Model *(const sim::Model *)> &)
{
    sky_ = dynamic_cast<const CelestialBodyModel &>(original).sky_;
}

} // namespace fledge::world
