// SPDX-License-Identifier: Apache-2.0
// A spacecraft's parts and gravity; orbits.
#include "core/extension.h"
#include "core/script.h"
#include "core/triple.h"

#include "sim/error.h"
#include "world/avionics/radio_model.h"
#include "world/dynamics/ephemeris_craft_model.h"
#include "world/dynamics/orbit.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/harmonics.h"
#include "world/environment/magnetism_model.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace py::literals;

namespace fledge::core {

namespace {

world::SpacecraftModel &craft_of(py::handle object)
{
    auto *craft = dynamic_cast<world::SpacecraftModel *>(instance_of(object)->model());
    if (!craft) {
        throw py::type_error("expected a Spacecraft, found " + std::string(py::repr(object)));
    }
    return *craft;
}

void attach(const AnyInstance &object, const AnyInstance &part)
{
    auto &craft = craft_of(object);
    auto *effector = is_root(part.ptr()) ? dynamic_cast<world::Effector *>(instance_of(part)->model()) : nullptr;
    if (!effector) {
        throw sim::SetupError(path_of(object.ptr()) + ".parts: expected a part of a spacecraft, such as " +
                              "ReactionWheels; found " +
                              (is_object(part.ptr()) ? path_of(part.ptr()) : std::string(py::repr(part))));
    }
    craft.attach(*effector);
    // The craft holds references to its parts, because the model only has pointers.
    Root *root = as_root(object.ptr());
    py::list parts;
    if (root->parts) {
        parts = py::list(py::reinterpret_borrow<py::tuple>(root->parts));
    }
    parts.append(part);
    Py_XSETREF(root->parts, py::tuple(parts).release().ptr());
}

/// (name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface, pole_stays)
using BodyFields = std::tuple<std::string, double, double, std::array<double, 5>, Triple, Triple, Triple,
                              std::optional<int>, std::shared_ptr<world::Harmonics>, std::optional<double>, bool>;

world::GravityBody body_from(const BodyFields &fields)
{
    const auto &[name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface, pole_stays] = fields;
    return {name, mu, radius, J, vector(pole_N), vector(r_PN_N), vector(v_PN_N), naif, field, surface, pole_stays};
}

std::vector<BodyFields> fields_of(const std::vector<world::GravityBody> &bodies)
{
    return list_of(bodies, [](const world::GravityBody &b) {
        return BodyFields{b.name,
                          b.mu,
                          b.radius,
                          b.J,
                          triple(b.pole_N),
                          triple(b.r_PN_N),
                          triple(b.v_PN_N),
                          b.naif,
                          std::const_pointer_cast<world::Harmonics>(b.field),
                          b.surface,
                          b.pole_stays};
    });
}

template <class T> T &model_of(py::handle object, const char *expected)
{
    if (auto *model = dynamic_cast<T *>(instance_of(object)->model())) {
        return *model;
    }
    throw py::type_error(std::string("expected ") + expected + ", found " + std::string(py::repr(object)));
}

world::EnvironmentModel &environment_of(py::handle object)
{
    return model_of<world::EnvironmentModel>(object, "a model of the environment");
}

/// Of the part, what takes the source of this name.
world::Consumer &consumer_of(py::handle object, std::string_view port)
{
    auto &part = model_of<world::Consumer>(object, "a part that asks a model");
    for (const auto &further : part.further()) {
        if (further.port == port) {
            return *further.consumer;
        }
    }
    return part;
}

/// The objects of its sources.
py::list sources_of(py::handle object)
{
    PyObject *parts = as_root(object.ptr())->parts;
    return parts ? py::list(py::reinterpret_borrow<py::tuple>(parts)) : py::list();
}

/// The object holds references to its sources, because the model only has pointers.
void set_source(const AnyInstance &object, const AnyInstance &source, const char *port)
{
    auto &part = consumer_of(object, port);
    if (!is_root(source.ptr()) || !instance_of(source)->model() || !part.set_source(*instance_of(source)->model())) {
        throw sim::SetupError(path_of(object.ptr()) + "." + port + ": expected " + part.source_text() + "; found " +
                              (is_object(source.ptr()) ? path_of(source.ptr()) : std::string(py::repr(source))));
    }
    py::list sources = sources_of(object);
    sources.append(source);
    Py_XSETREF(as_root(object.ptr())->parts, py::tuple(sources).release().ptr());
}

using OrbitRows =
    std::vector<std::tuple<sim::Ns, sim::Ns, int, std::vector<sim::Ns>, std::vector<Triple>, std::vector<Triple>>>;
using AttitudeRows = std::vector<std::tuple<sim::Ns, sim::Ns, std::vector<sim::Ns>, std::vector<std::array<double, 4>>,
                                            std::vector<std::array<double, 4>>>>;

std::shared_ptr<world::CraftEphemeris> ephemeris_of(const std::string &orbit_file, const std::string &attitude_file,
                                                    const OrbitRows &orbits, const AttitudeRows &attitudes)
{
    const auto vectors = [](const std::vector<Triple> &rows) {
        std::vector<Eigen::Vector3d> found(rows.size());
        std::transform(rows.begin(), rows.end(), found.begin(), vector);
        return found;
    };
    const auto quaternions = [](const std::vector<std::array<double, 4>> &rows) {
        std::vector<Eigen::Vector4d> found(rows.size());
        std::transform(rows.begin(), rows.end(), found.begin(),
                       [](const std::array<double, 4> &row) { return Eigen::Vector4d(row.data()); });
        return found;
    };
    auto made = std::make_shared<world::CraftEphemeris>();
    made->orbit_file = orbit_file;
    made->attitude_file = attitude_file;
    for (const auto &[begin, end, degree, t, r, v] : orbits) {
        made->orbits.push_back({begin, end, degree, t, vectors(r), vectors(v)});
    }
    for (const auto &[begin, end, t, beta, rates] : attitudes) {
        made->attitudes.push_back({begin, end, t, quaternions(beta), quaternions(rates)});
    }
    return made;
}

} // namespace

void bind_world(py::module_ &m)
{
    m.def("attach", attach, "object"_a, "part"_a);
    m.def(
        "parts", [](const AnyInstance &object) -> Typed<py::tuple, "tuple[Model, ...]"> {
            craft_of(object);
            PyObject *parts = as_root(object.ptr())->parts;
            return parts ? py::reinterpret_borrow<py::tuple>(parts) : py::tuple();
        },
        "object"_a);
    m.def(
        "add_gravity",
        [](const AnyInstance &object, const BodyFields &body) { craft_of(object).add_gravity(body_from(body)); },
        "object"_a, "body"_a);
    m.def(
        "expect_orbit",
        [](const AnyInstance &object, const BodyFields &body) { craft_of(object).expect_orbit(body_from(body)); },
        "object"_a, "body"_a, "Its initial position is that of an orbit about the body.");
    m.def(
        "gravity", [](const AnyInstance &object) { return fields_of(craft_of(object).gravity()); }, "object"_a,
        "(name, mu, radius, J, pole_N, r_PN_N, v_PN_N, naif, field, surface, pole_stays) of each body");

    m.def(
        "strike",
        [](const AnyInstance &object, const std::array<Triple, 6> &parts, const std::optional<Triple> &at) {
            auto &craft = craft_of(object);
            const auto instance = instance_of(object);
            if (running()) {
                throw sim::SetupError(instance->path +
                                      ".impulse: an update writes its own module alone; call it in a " +
                                      "function of an event, or between two runs");
            }
            if (!instance->begun) {
                throw sim::SetupError(instance->path + ".impulse: the run has not begun: set v_BN_N and omega_BN_B, " +
                                      "or call it at a time, as in w.at(5 * minute, function)");
            }
            const auto vec = [](const Triple &a) { return vec3(a[0], a[1], a[2]); };
            craft.strike({vec(parts[0]), vec(parts[1]), vec(parts[2]), vec(parts[3]), vec(parts[4]), vec(parts[5]),
                          at ? std::optional(vec(*at)) : std::nullopt});
        },
        "craft"_a, "parts"_a, "at"_a,
        "Let an impulse act: dv_N, dv_B [m/s], momentum_N, momentum_B [N s], angular_N, angular_B [N m s].");
    m.def(
        "set_body",
        [](const AnyInstance &object, const BodyFields &body) { environment_of(object).set_body(body_from(body)); },
        "object"_a, "body"_a);
    m.def(
        "add_body",
        [](const AnyInstance &object, const BodyFields &body) { environment_of(object).add_body(body_from(body)); },
        "object"_a, "body"_a);
    m.def(
        "bodies", [](const AnyInstance &object) { return fields_of(environment_of(object).bodies()); }, "object"_a,
        "As for gravity.");
    m.def(
        "set_serves",
        [](const AnyInstance &object, const std::string &process) {
            model_of<world::RadioModel>(object, "a radio").set_serves(process);
        },
        "object"_a, "process"_a);
    m.def(
        "serves", [](const AnyInstance &object) { return model_of<world::RadioModel>(object, "a radio").serves(); },
        "object"_a);
    m.def("set_source", set_source, "object"_a, "source"_a, "port"_a);
    m.def(
        "source", [](const AnyInstance &object, const char *port) -> Typed<py::object, "Model | None"> {
            const sim::Model *model = consumer_of(object, port).source();
            for (const py::handle source : sources_of(object)) {
                if (instance_of(source)->model() == model) {
                    return py::reinterpret_borrow<py::object>(source);
                }
            }
            return py::none();
        },
        "object"_a, "port"_a);
    m.def(
        "set_ephemeris",
        [](const AnyInstance &object, const std::string &orbit_file, const std::string &attitude_file,
           const OrbitRows &orbits, const AttitudeRows &attitudes) {
            auto &craft = model_of<world::EphemerisCraftModel>(object, "an EphemerisCraft");
            craft.set_ephemeris(ephemeris_of(orbit_file, attitude_file, orbits, attitudes));
        },
        "object"_a, "orbit_file"_a, "attitude_file"_a, "orbits"_a, "attitudes"_a,
        "Of each orbit (begin, end, degree, t, r, v), of each attitude (begin, end, t, beta, rates), in times of the "
        "run "
        "[ns]; v and rates may be empty.");
    m.def(
        "ephemeris_files",
        [](const AnyInstance &object) {
            const auto &found = model_of<world::EphemerisCraftModel>(object, "an EphemerisCraft").ephemeris();
            return found ? std::pair(found->orbit_file, found->attitude_file) : std::pair(std::string(), std::string());
        },
        "object"_a, "(orbit, attitude)");
    m.def(
        "set_coefficients",
        [](const AnyInstance &object, const std::string &path) {
            model_of<world::MagnetismModel>(object, "a Magnetism").set_coefficients(path);
        },
        "object"_a, "path"_a);
    m.def(
        "coefficients",
        [](const AnyInstance &object) { return model_of<world::MagnetismModel>(object, "a Magnetism").coefficients(); },
        "object"_a);

    m.def("semi_latus_rectum", world::semi_latus_rectum, "a"_a, "e"_a, "p [m] from a [m] and e.");
    m.def(
        "orbit_state",
        [](double mu, double p, double e, double i, double Omega, double omega, double f) {
            const world::OrbitState state = world::orbit_state(mu, {p, e, i, Omega, omega, f});
            return std::make_pair(triple(state.r), triple(state.v));
        },
        "mu"_a, "p"_a, "e"_a, "i"_a, "Omega"_a, "omega"_a, "f"_a,
        "Position [m] and velocity [m/s] from classical elements; SI, radians.");
    m.def(
        "orbit_elements",
        [](double mu, const Triple &r, const Triple &v) {
            const world::OrbitElements o = world::orbit_elements(mu, {vector(r), vector(v)});
            return std::tuple(o.p, o.e, o.i, o.Omega, o.omega, o.f);
        },
        "mu"_a, "r"_a, "v"_a, "(p, e, i, Omega, omega, f) from position [m] and velocity [m/s].");
}

} // namespace fledge::core
