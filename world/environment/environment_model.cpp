// SPDX-License-Identifier: Apache-2.0
#include "world/environment/environment_model.h"

#include "sim/text.h"
#include "world/environment/bodies.h"

#include <Eigen/Dense>

#include <cmath>

namespace fledge::world {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr int earth = 399;

} // namespace

Ellipsoid Ellipsoid::of(const GravityBody &body)
{
    if (body.naif == earth) {
        return {6378137.0, 6378137.0 * (1.0 - 1.0 / 298.257223563)};
    }
    double ratio = 1.0;
    if (body.naif) {
        try {
            const BodyRadii radii = body_radii(*body.naif);
            ratio = radii.polar / radii.equatorial;
        } catch (const sim::SetupError &) { // a body of which the report has no radii is a sphere
        }
    }
    return {body.radius, body.radius * ratio};
}

Ellipsoid::Height Ellipsoid::height(const Vector3d &r_P) const
{
    // Bowring's formula for the geodetic latitude, with tangents in the place of angles, twice.
    const double p = std::sqrt(r_P[0] * r_P[0] + r_P[1] * r_P[1]), z = std::abs(r_P[2]);
    const double e2 = (a - b) * (a + b) / (a * a), ep2 = (a - b) * (a + b) / (b * b);
    double up = a * z, out = b * p; // the tangent of the reduced latitude is up / out
    double sine = 0.0, cosine = 1.0;
    for (int i = 0; i < 2; i++) {
        const double length = std::sqrt(up * up + out * out);
        const double s = length > 0.0 ? up / length : 0.0, c = length > 0.0 ? out / length : 1.0;
        const double rise = z + ep2 * b * s * s * s, run = p - e2 * a * c * c * c;
        const double slope = std::sqrt(rise * rise + run * run);
        sine = rise / slope;
        cosine = run / slope;
        up = b * sine;
        out = a * cosine;
    }
    return {p * cosine + z * sine - a * std::sqrt(1.0 - e2 * sine * sine), std::copysign(sine, r_P[2]), cosine};
}

Vector3d Ellipsoid::point(double latitude, double longitude, double altitude) const
{
    double sine, cosine, east, along;
    fm_sincos(latitude, &sine, &cosine);
    fm_sincos(longitude, &east, &along);
    const double e2 = (a - b) * (a + b) / (a * a), N = a / std::sqrt(1.0 - e2 * sine * sine);
    const double p = (N + altitude) * cosine;
    return {p * along, p * east, (N * (1.0 - e2) + altitude) * sine};
}

void EnvironmentModel::refuse(const std::string &text) const
{
    throw sim::SetupError(name_ + text);
}

void EnvironmentModel::set_body(const GravityBody &body)
{
    if (bodies_.empty()) {
        bodies_.emplace_back();
    }
    bodies_[0] = checked(body);
}

void EnvironmentModel::add_body(const GravityBody &body)
{
    if (bodies_.empty()) {
        bodies_.emplace_back();
    }
    bodies_.push_back(checked(body));
}

void EnvironmentModel::refresh()
{
    tau_ = turned_ = std::numeric_limits<double>::quiet_NaN();
    version_++;
}

void EnvironmentModel::prepare(const sim::Setup &setup)
{
    name_ = setup.name;
    places_.clear();
    covered_ = 0;
    EnvironmentModel::refresh();
    if (!has_body() && required_) {
        refuse("." + std::string(what_) + " is missing: give it a body, as in " + what_ + "=world." +
               (turns_ ? "EARTH" : "SUN"));
    }
    for (const GravityBody &body : bodies_) {
        if (&body == bodies_.data() && !has_body()) {
            places_.emplace_back();
            continue;
        }
        if (!(body.radius > 0.0)) {
            refuse(": " + body.name + " has no radius");
        }
        if (!sky_) {
            continue;
        }
        if (!body.naif) {
            refuse(": " + body.name + " has no NAIF number, by which the sky would find it");
        }
        if (!body.r_PN_N.isZero(0.0) || !body.v_PN_N.isZero(0.0)) {
            refuse(": " + body.name + " was given a position, but the sky holds its position");
        }
        Place place;
        place.moves = *body.naif != sky_->center();
        place.target = place.moves ? sky_->given_as(*body.naif) : *body.naif;
        require(place, 0, 0);
        places_.push_back(place);
    }
    orientation_.reset();
    if (!has_body()) {
        return;
    }
    if (sky_ && turns_) {
        try {
            orientation_ = sky_->orientation(*bodies_[0].naif);
        } catch (const sim::SetupError &error) {
            refuse(std::string(": ") + error.what());
        }
    }
    if (sky_ && spin() != 0.0) {
        refuse(".spin: the sky says how " + bodies_[0].name + " turns; found " + sim::format_number(spin()) + " rad/s");
    }
    const Vector3d pole = bodies_[0].pole_N, node = Vector3d::UnitZ().cross(pole);
    const Vector3d x = node.norm() < 1e-12 ? Vector3d::UnitX() : node.normalized();
    dcm_QN_ << x.transpose(), pole.cross(x).transpose(), pole.transpose();
}

void EnvironmentModel::require(const Place &place, Ns from, Ns to) const
{
    if (!place.moves) {
        return;
    }
    try {
        sky_->require(place.target, from, to);
    } catch (const sim::SetupError &error) {
        refuse(std::string(": ") + error.what());
    }
}

void EnvironmentModel::ensure_data_until(Ns until)
{
    if (until <= covered_) {
        return;
    }
    for (const Place &place : places_) {
        require(place, covered_, until);
    }
    if (orientation_) {
        try {
            sky_->require(*orientation_, covered_, until);
        } catch (const sim::SetupError &error) {
            refuse(std::string(": ") + error.what());
        }
    }
    covered_ = until;
}

Vector3d EnvironmentModel::r_PN_N(std::size_t body, Ns start, double tau) const
{
    if (!sky_) {
        return bodies_[body].r_PN_N + (tick_seconds(start) + tau) * bodies_[body].v_PN_N;
    }
    Place &place = places_[body];
    return place.moves ? sky_->position(place.target, start, tau, place.cursor) : Vector3d::Zero();
}

Vector3d EnvironmentModel::v_PN_N(std::size_t body, Ns start, double tau) const
{
    if (!sky_) {
        return bodies_[body].v_PN_N;
    }
    Place &place = places_[body];
    if (!place.moves) {
        return Vector3d::Zero();
    }
    // To the nanosecond is enough: a planet's velocity changes by 1e-11 m/s in that time.
    return sky_->state(place.target, start + static_cast<Ns>(std::llround(1e9 * tau)), place.cursor).v;
}

const BodyAttitude &EnvironmentModel::attitude(Ns start, double tau) const
{
    if (!orientation_) {
        const double rate = spin(), angle = rate * (tick_seconds(start) + tau);
        if (angle != turned_) {
            double s, c;
            fm_sincos(angle, &s, &c);
            attitude_.dcm_PN << c * dcm_QN_.row(0) + s * dcm_QN_.row(1), c * dcm_QN_.row(1) - s * dcm_QN_.row(0),
                dcm_QN_.row(2);
            attitude_.omega_PN_P = Vector3d(0.0, 0.0, rate);
            turned_ = angle;
        }
    } else if (start != start_ || tau != tau_) {
        attitude_ = orientation_->at(sky_->epoch_at(start), tau);
        start_ = start;
        tau_ = tau;
    }
    return attitude_;
}

std::vector<std::string> EnvironmentModel::assumptions() const
{
    std::vector<std::string> lines;
    for (const GravityBody &body : bodies_) {
        if (sky_ && body.naif && sky_->given_as(*body.naif) != *body.naif) {
            lines.push_back(std::string(what_) + ": the ephemeris has no " + body_name(*body.naif) + "; " +
                            body_name(sky_->given_as(*body.naif)) + " stands for its position");
        }
    }
    return lines;
}

void EnvironmentModel::copy_setup(const sim::Model &original, const std::function<sim::Model *(const sim::Model *)> &)
{
    const auto &other = dynamic_cast<const EnvironmentModel &>(original);
    sky_ = other.sky_;
    bodies_ = other.bodies_;
}

} // namespace fledge::world
