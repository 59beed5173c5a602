// SPDX-License-Identifier: Apache-2.0
// The solar system for world.Sky, and gravity fields from files.
#include "core/extension.h"
#include "core/triple.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/bodies.h"
#include "world/environment/earth_atmosphere_model.h"
#include "world/environment/harmonics.h"
#include "world/environment/sky.h"
#include "world/environment/sky_user.h"

#include <pybind11/stl.h>

#include <algorithm>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

using sim::Ns;
using world::Sky;
std::shared_ptr<Sky> make_sky(const std::string &epoch, int center, const std::vector<std::string> &kernels,
                              const std::optional<std::string> &leap_seconds, const std::optional<std::string> &pck,
                              const std::optional<world::EarthData> &earth, bool principal_axes)
{
    return std::make_shared<Sky>(world::SkySetup{epoch, center, kernels, leap_seconds, pck, earth, principal_axes});
}

std::array<Triple, 3> rows(const Eigen::Matrix3d &dcm)
{
    return {triple(dcm.row(0)), triple(dcm.row(1)), triple(dcm.row(2))};
}

world::EarthData make_earth(bool iau1980, const std::optional<std::string> &eop, std::optional<double> ut1_tai,
                            const std::optional<std::array<double, 2>> &pole)
{
    world::EarthData data;
    data.theory = iau1980 ? world::EarthData::Theory::iau1980 : world::EarthData::Theory::iau2006;
    data.eop = eop;
    data.ut1_tai = ut1_tai;
    if (pole) {
        data.pole = Eigen::Vector2d((*pole)[0], (*pole)[1]);
    }
    return data;
}

/// (r, v, a) of a body relative to another; that stands in for what only has a barycentre.
auto state(const Sky &sky, int body, int center, Ns t)
{
    const world::BodyState state = sky.ephemeris().state(sky.given_as(body), sky.given_as(center), sky.epoch_at(t));
    return std::tuple(triple(state.r), triple(state.v), triple(state.a));
}

auto orientation(const Sky &sky, int body, Ns t)
{
    const world::Orientation orientation = sky.orientation(body);
    sky.require(orientation, t, t);
    const world::BodyAttitude attitude = orientation.at(sky.epoch_at(t));
    return std::pair(rows(attitude.dcm_PN), triple(attitude.omega_PN_P));
}

world::TimeScale scale_of(const std::string &name)
{
    return name == "UTC"   ? world::TimeScale::utc
           : name == "TAI" ? world::TimeScale::tai
           : name == "TT"  ? world::TimeScale::tt
           : name == "GPS" ? world::TimeScale::gps
                           : world::TimeScale::tdb;
}

world::SkyUser &sky_user(py::handle object)
{
    if (auto *model = dynamic_cast<world::SkyUser *>(instance_of(object)->model())) {
        return *model;
    }
    throw py::type_error("expected a model that has a sky, found " + std::string(py::repr(object)));
}

/// mu [m^3/s^2], equatorial radius [m] and J2 to J6 of a body, as far as a text kernel has them.
auto body_in_kernel(const std::string &path, int body)
{
    const world::TextKernel kernel = world::TextKernel::read(path);
    const std::string prefix = "BODY" + std::to_string(body) + "_";
    const auto positive = [&](const std::string &name, double value) {
        if (!(value > 0.0)) {
            throw sim::SetupError(path + ":" + std::to_string(kernel.values(name).front().line) + ": " + name +
                                  " must be > 0; found " + sim::format_number(value));
        }
        return value;
    };
    std::optional<double> mu, radius;
    std::array<double, 5> J{};
    bool any = false;
    if (const std::string name = prefix + "GM"; kernel.has(name)) {
        mu = positive(name, kernel.number(name)) * 1e9;
    }
    if (const std::string name = prefix + "RADII"; kernel.has(name)) {
        radius = positive(name, world::equatorial_radius(kernel, body));
    }
    for (std::size_t i = 0; i < J.size(); i++) {
        if (const std::string name = prefix + "J" + std::to_string(i + 2); kernel.has(name)) {
            J[i] = kernel.number(name);
            any = true;
        }
    }
    if (!mu && !radius && !any) {
        throw sim::SetupError(path + ": has none of " + prefix + "GM, " + prefix + "RADII and " + prefix +
                              "J2 to J6; expected a kernel with " + world::body_name(body));
    }
    return std::tuple(mu, radius, J);
}

world::EarthAtmosphereModel &earth_atmosphere(py::handle object)
{
    if (auto *model = dynamic_cast<world::EarthAtmosphereModel *>(instance_of(object)->model())) {
        return *model;
    }
    throw py::type_error("expected an EarthAtmosphere, found " + std::string(py::repr(object)));
}

} // namespace

void bind_sky(py::module_ &m)
{
    py::class_<world::Harmonics, std::shared_ptr<world::Harmonics>>(m, "Harmonics",
                                                                    "A gravity field in spherical harmonics.")
        .def_property_readonly("degree", &world::Harmonics::degree)
        .def_property_readonly("mu", &world::Harmonics::mu)
        .def_property_readonly("radius", &world::Harmonics::radius)
        .def_property_readonly("has_tides", [](const world::Harmonics &field) { return field.tides.has_value(); });
    m.def(
        "harmonics",
        [](const std::string &path, std::optional<int> degree, const std::string &tides,
           const std::optional<std::string> &date, double mu) {
            return world::read_harmonics({path, degree, tides, date, mu});
        },
        "path"_a, "degree"_a, "tides"_a, "epoch"_a, "mu"_a,
        "Of a SHADR or ICGEM file, up to a degree or whole, with the solid tides that suit a tide system, "
        "\"file\" for its own, or without, \"\"; what changes in time as it is at the epoch. mu: of the body, or 0; it "
        "tells m from km.");

    py::class_<world::EarthData>(m, "EarthData")
        .def(py::init(&make_earth), "iau1980"_a, "eop"_a, "ut1_tai"_a, "pole"_a);
    py::class_<Sky, std::shared_ptr<Sky>>(m, "Sky")
        .def(py::init(&make_sky), "epoch"_a, "center"_a, "kernels"_a, "leap_seconds"_a, "pck"_a, "earth"_a,
             "principal_axes"_a)
        .def_property_readonly("center", &Sky::center)
        .def_property_readonly("bodies", [](const Sky &sky) { return sky.ephemeris().bodies(); })
        .def("state", state, "body"_a, "center"_a, "t"_a)
        .def("orientation", orientation, "body"_a, "t"_a)
        .def(
            "true_of_date", [](const Sky &sky, Ns t) { return rows(sky.true_of_date(t)); }, "t"_a)
        .def(
            "teme_of_date", [](const Sky &sky, Ns t) { return rows(sky.teme_of_date(t)); }, "t"_a)
        .def(
            "gps", [](const Sky &sky, Ns t) { return sky.time_system().gps(sky.epoch_at(t)); }, "t"_a)
        .def(
            "seconds", [](const Sky &sky, Ns t) { return sky.epoch_at(t).seconds(); }, "t"_a)
        .def(
            "text",
            [](const Sky &sky, Ns t, const std::string &scale) {
                return sky.time_system().text(sky.epoch_at(t), scale_of(scale));
            },
            "t"_a, "scale"_a)
        .def(
            "time_of",
            [](const Sky &sky, const std::string &text) {
                return sky.time_system().epoch(text).ns - sky.epoch_at(0).ns;
            },
            "text"_a);
    m.def(
        "set_sky",
        [](const AnyInstance &object, std::shared_ptr<Sky> sky) { sky_user(object).set_sky(std::move(sky)); },
        "object"_a, "sky"_a);
    m.def(
        "sky", [](const AnyInstance &object) { return std::const_pointer_cast<Sky>(sky_user(object).sky()); },
        "object"_a);

    py::class_<world::SpaceWeather, std::shared_ptr<world::SpaceWeather>>(
        m, "SpaceWeather", "The Sun's and the magnetic field's activity.")
        .def(py::init([](const std::vector<std::string> &files) {
                 return std::make_shared<world::SpaceWeather>(files, world::TimeSystem());
             }),
             "files"_a)
        .def_property_readonly("files", &world::SpaceWeather::files);
    m.def(
        "set_weather",
        [](const AnyInstance &object, std::shared_ptr<world::SpaceWeather> weather) {
            earth_atmosphere(object).set_weather(std::move(weather));
        },
        "object"_a, "weather"_a);
    m.def(
        "weather",
        [](const AnyInstance &object) {
            return std::const_pointer_cast<world::SpaceWeather>(earth_atmosphere(object).weather());
        },
        "object"_a);
    m.def("body_name", world::body_name, "id"_a);
    m.def(
        "body_id", [](const std::string &name) { return world::body_id(name); }, "name"_a);
    m.def("body_mu", world::body_mu, "id"_a);
    m.def("body_in_kernel", body_in_kernel, "path"_a, "id"_a, "(mu, radius, J), None for what it has not");
}

} // namespace fledge::core
