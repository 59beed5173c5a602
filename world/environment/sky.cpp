// SPDX-License-Identifier: Apache-2.0
#include "world/environment/sky.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/de405.h"

#include <algorithm>

namespace fledge::world {

using sim::Ns;

namespace {

TimeSystem time_of(const SkySetup &setup)
{
    return setup.leap_seconds ? TimeSystem::read(*setup.leap_seconds) : TimeSystem();
}

Ephemeris ephemeris_of(const SkySetup &setup)
{
    Ephemeris ephemeris;
    for (const std::string &kernel : setup.kernels) {
        if (kernel == "DE405") {
            ephemeris.add_de405(setup.de405);
        } else {
            ephemeris.add_spk(kernel);
        }
    }
    return ephemeris;
}

std::optional<TextKernel> constants_of(const SkySetup &setup)
{
    if (!setup.pck) {
        return std::nullopt;
    }
    TextKernel constants = TextKernel::read(*setup.pck);
    const std::vector<std::string> names = constants.names();
    if (std::none_of(names.begin(), names.end(),
                     [](const std::string &name) { return name.starts_with("BODY") && name.ends_with("_PM"); })) {
        throw sim::SetupError(*setup.pck + ": says of no body how it turns (BODY499_PM, say); "
                                           "expected a kernel of planetary constants (.tpc)");
    }
    return constants;
}

} // namespace

Sky::Sky(SkySetup setup)
    : Sky(ephemeris_of(setup), time_of(setup), time_of(setup).epoch(setup.epoch), setup.center, constants_of(setup),
          setup.earth, setup.principal_axes ? read_de405(setup.de405).librations : nullptr)
{
    setup_ = std::move(setup);
}

Sky::Sky(Ephemeris ephemeris, TimeSystem time, Epoch epoch, int center, std::optional<TextKernel> pck,
         const std::optional<EarthData> &earth, std::shared_ptr<const Librations> moon)
    : ephemeris_(std::move(ephemeris)), time_(std::move(time)), epoch_(epoch), center_(center),
      given_center_(given_as(center)), pck_(std::move(pck)), moon_(std::move(moon))
{
    // The lowest number is at the root of the tree: the barycentre of the solar system, mostly.
    if (const std::vector<int> known = ephemeris_.bodies(); !known.empty()) {
        ephemeris_.require(given_center_, known.front(), epoch_, epoch_);
    }
    if (earth) {
        theory_ = earth->theory;
        earth_ = std::make_shared<EarthRotation>(*earth, time_);
        earth_->require(epoch_, epoch_);
    }
    if (moon_) {
        moon_->require(epoch_, epoch_);
    }
}

Epoch Sky::epoch_at(Ns t) const
{
    Epoch epoch;
    if (__builtin_add_overflow(epoch_.ns, t, &epoch.ns)) {
        throw sim::SetupError(sim::format_time(t) + " from " + time_.text(epoch_, TimeScale::tdb) +
                              " lies beyond the years 1708 to 2291, in which time is counted");
    }
    return epoch;
}

int Sky::given_as(int body) const
{
    const std::vector<int> known = ephemeris_.bodies();
    const auto has = [&](int id) { return std::binary_search(known.begin(), known.end(), id); };
    const bool planet = body > 100 && body < 1000 && body % 100 == 99;
    // Mercury, Venus and Mars are at their barycentres, which the ephemeris itself knows.
    return planet && body > 500 && !has(body) && has(body / 100) ? body / 100 : body;
}

Eigen::Vector3d Sky::position(int body, Ns start, double tau, Ephemeris::Cursor &cursor) const
{
    try {
        return ephemeris_.position(body, given_center_, {epoch_.ns + start}, tau, cursor);
    } catch (const sim::SetupError &error) {
        throw sim::RunError(error.what());
    }
}

BodyState Sky::state(int body, Ns t, Ephemeris::Cursor &cursor) const
{
    try {
        return ephemeris_.state(body, given_center_, {epoch_.ns + t}, 0.0, cursor);
    } catch (const sim::SetupError &error) {
        throw sim::RunError(error.what());
    }
}

void Sky::require(int body, Ns from, Ns to) const
{
    ephemeris_.require(body, given_center_, epoch_at(from), epoch_at(to));
}

void Sky::require(const Orientation &orientation, Ns from, Ns to) const
{
    orientation.require(epoch_at(from), epoch_at(to));
}

Eigen::Matrix3d Sky::true_of_date(Ns t) const
{
    return world::true_of_date(theory_, time_, epoch_at(t));
}

Orientation Sky::orientation(int body) const
{
    if (earth_ && body == 399) {
        return Orientation::of(earth_);
    }
    if (moon_ && body == 301) {
        return Orientation::of(moon_);
    }
    return pck_ && pck_->has("BODY" + std::to_string(body) + "_PM") ? Orientation::from(*pck_, body)
                                                                    : Orientation::built_in(body);
}

} // namespace fledge::world
