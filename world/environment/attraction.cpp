// SPDX-License-Identifier: Apache-2.0
#include "world/environment/attraction.h"

#include "flight/msg/head.h"
#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/bodies.h"
#include "world/environment/harmonics.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace fledge::world {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using sim::Ns;

namespace {

/// The number of the barycentre of a body's system; the Sun's is its own.
int system_of(int body)
{
    return body >= 100 && body < 1000 ? body / 100 : body;
}

constexpr int tidal_earth = 399, tidal_moon = 301, tidal_sun = 10;
constexpr int tide_raisers[] = {tidal_moon, tidal_sun};

bool is_system(int body)
{
    return body >= 1 && body <= 9;
}

std::string name_of(const GravityBody &body)
{
    return body.name.empty() ? "the gravity body" : body.name;
}

} // namespace

void Attraction::add(const GravityBody &body)
{
    GravityBody good = checked(body);
    // From a boulder of a few metres to far beyond the Sun; km^3/s^2 in the place of m^3/s^2 lie outside.
    const double at_surface = good.mu / (good.radius * good.radius); // [m/s^2]
    if (good.radius > 0.0 && !(at_surface >= 1e-6 && at_surface <= 1e4)) {
        throw sim::SetupError("gravity body " + name_of(good) + ": mu in m^3/s^2 and the radius in m must give a " +
                              "gravity of 1e-6 to 1e4 m/s^2 there; found " + sim::format_number(at_surface));
    }
    for (const GravityBody &other : bodies_) {
        if (!good.name.empty() && other.name == good.name) {
            throw sim::SetupError("spacecraft: the gravity of " + good.name + " is listed twice");
        }
    }
    bodies_.push_back(std::move(good));
}

void Attraction::prepare(const std::string &craft, const Vector3d &r_BN_N)
{
    craft_ = craft;
    sources_.clear();
    last_r_BP_N_.assign(bodies_.size(), Vector3d::Zero());
    covered_ = 0;
    for (auto body = bodies_.begin(); !sky_ && body != bodies_.end(); ++body) {
        const auto same = std::find_if(bodies_.begin(), body, [&](const GravityBody &other) {
            return other.naif && body->naif && other.r_PN_N == body->r_PN_N && other.v_PN_N == body->v_PN_N;
        });
        if (same != body) {
            const std::string both = name_of(*same) + " and " + name_of(*body);
            throw sim::SetupError(craft_ + ".gravity: without a sky, " + both +
                                  " are at one place: give the spacecraft a sky, which has their places, as in " +
                                  "sky=world.Sky(epoch, center=world.EARTH), or give bodies places by at()");
        }
    }
    for (const GravityBody &body : bodies_) {
        if (sky_) {
            sources_.push_back(find(body));
            place(sources_.back(), 0, 0.0);
        } else if (body.field) {
            throw sim::SetupError(craft_ + ".gravity: the field of " + name_of(body) +
                                  " turns with it: give a sky, which holds its orientation");
        }
        const Vector3d &r_PN_N = sky_ ? sources_.back().r_PN_N : body.r_PN_N;
        const double distance = (r_BN_N - r_PN_N).norm();
        if (!(distance > *body.surface)) {
            require_orbit_body(r_BN_N);
            throw sim::SetupError(craft_ + ".r_BN_N: must lie outside " + name_of(body) + ", of radius " +
                                  sim::format_number(*body.surface) + " m; found a distance of " +
                                  sim::format_number(distance) + " m from its centre" +
                                  (distance == 0.0 ? ": give the spacecraft an orbit" : ""));
        }
    }
    require_orbit_body(r_BN_N);
}

void Attraction::require_orbit_body(const Vector3d &r_BN_N) const
{
    if (!orbit_ || orbit_->r_BN_N != r_BN_N) {
        return;
    }
    const GravityBody &about = orbit_->about;
    const std::string what = craft_ + ".orbit: it is about " + name_of(about);
    std::string names;
    for (const GravityBody &body : bodies_) {
        const bool same = about.naif && body.naif ? *about.naif == *body.naif : about.name == body.name;
        // Each file has a mu of its own, which agree to 1e-7, and rounded ones to 1e-6.
        if (same && !(std::abs(body.mu - about.mu) <= 1e-5 * about.mu)) {
            throw sim::SetupError(what + " with mu = " + sim::format_number(about.mu) + " m^3/s^2, and " + craft_ +
                                  ".gravity has " + sim::format_number(body.mu) + ": give both the same body");
        }
        if (same || (about.naif && body.naif && is_system(*body.naif) && system_of(*about.naif) == *body.naif)) {
            return;
        }
        names += (names.empty() ? "" : ", ") + name_of(body);
    }
    throw sim::SetupError(what + ", which does not attract the spacecraft: " + craft_ + ".gravity " +
                          (names.empty() ? "is empty" : "has " + names));
}

Attraction::Source Attraction::find(const GravityBody &body) const
{
    const auto refuse = [&](const std::string &text) { throw sim::SetupError(craft_ + ".gravity: " + text); };
    if (!body.naif) {
        refuse(name_of(body) + " has no NAIF number, by which the sky would find it");
    }
    if (!body.r_PN_N.isZero(0.0) || !body.v_PN_N.isZero(0.0)) {
        refuse(name_of(body) + " was given a position, but the sky holds its position");
    }
    const int id = *body.naif, center = sky_->center();
    for (const GravityBody &other : bodies_) {
        if (is_system(id) && other.naif && *other.naif != id && system_of(*other.naif) == id) {
            refuse(body_name(id) + " holds " + body_name(*other.naif) + ": name the system or its members, not both");
        }
    }
    if (is_system(id) && id != center && system_of(center) == id) {
        refuse(body_name(id) + " is the whole system of the centre, " + body_name(center) +
               ": name the members of the system");
    }

    Source source;
    source.mu = body.mu;
    source.target = id;
    source.point = !body.has_zonals() && !body.field;
    source.pole_N = body.pole_N;
    if (body.field || (body.has_zonals() && !body.pole_stays)) {
        try {
            source.turning.push_back(sky_->orientation(id));
        } catch (const sim::SetupError &error) {
            refuse(error.what());
        }
    }
    if (body.field && body.field->tides) {
        if (id != tidal_earth) {
            refuse("solid tides are those of the Earth, not of " + name_of(body));
        }
        for (const int raiser : tide_raisers) {
            try {
                sky_->require(raiser, 0, 0);
            } catch (const sim::SetupError &error) {
                refuse("tides need the Moon and the Sun in the sky: " + std::string(error.what()));
            }
        }
        source.tide.emplace(Tide{*body.field->tides});
    }
    if (id == center) {
        return source;
    }
    source.moves = true;
    source.pulls_origin = center != 0 && !(is_system(center) && system_of(id) == center);
    source.target = sky_->given_as(id);
    if (source.target != id) {
        if (!source.point) {
            refuse("the shape of " + body_name(id) + " needs its own place; the ephemeris only " + "has that of " +
                   body_name(source.target));
        }
        source.mu = body_mu(source.target);
    }
    require(source.target, 0, 0);
    return source;
}

void Attraction::require(int target, Ns from, Ns to) const
{
    try {
        sky_->require(target, from, to);
    } catch (const sim::SetupError &error) {
        throw sim::SetupError(craft_ + ".gravity: " + error.what());
    }
}

void Attraction::ensure_data_until(Ns until)
{
    if (until <= covered_) {
        return;
    }
    for (const Source &source : sources_) {
        if (source.moves) {
            require(source.target, covered_, until);
        }
        if (source.tide) {
            std::for_each(std::begin(tide_raisers), std::end(tide_raisers),
                          [&](int raiser) { require(raiser, covered_, until); });
        }
        for (const Orientation &orientation : source.turning) {
            try {
                sky_->require(orientation, covered_, until);
            } catch (const sim::SetupError &error) {
                throw sim::SetupError(craft_ + ".gravity: " + error.what());
            }
        }
    }
    covered_ = until;
}

double Attraction::central_mu() const
{
    if (bodies_.size() != 1 || bodies_[0].has_zonals() || bodies_[0].field) {
        return 0.0;
    }
    const GravityBody &body = bodies_[0];
    const bool central = sky_ ? !sources_[0].moves : body.r_PN_N.isZero(0.0) && body.v_PN_N.isZero(0.0);
    return central ? body.mu : 0.0;
}

void Attraction::place(Source &source, Ns start, double tau) const
{
    if (source.start == start && source.tau == tau) {
        return;
    }
    if (source.moves) {
        source.r_PN_N = sky_->position(source.target, start, tau, source.cursor);
    }
    if (!source.turning.empty()) {
        source.dcm_PN = source.turning[0].dcm_PN(sky_->epoch_at(start), tau);
        source.pole_N = source.dcm_PN.row(2);
    }
    if (source.tide) {
        Tide &tide = *source.tide;
        const Vector3d moon_N = sky_->position(tidal_moon, start, tau, tide.moon) - source.r_PN_N;
        const Vector3d sun_N = sky_->position(tidal_sun, start, tau, tide.sun) - source.r_PN_N;
        const Epoch epoch = sky_->epoch_at(start), now{epoch.ns + std::llround(tau * 1e9)};
        tide.now = tide.model.at(epoch, tau, source.dcm_PN, moon_N, sun_N, tide.window);
        if (const auto pole = source.turning[0].pole(now)) {
            tide.model.add_pole(now, *pole, tide.now);
        }
    }
    source.start = start;
    source.tau = tau;
}

Vector3d Attraction::position(std::size_t body, Ns start, double tau)
{
    if (sky_) {
        place(sources_[body], start, tau);
        return sources_[body].r_PN_N;
    }
    return bodies_[body].r_PN_N + (tick_seconds(start) + tau) * bodies_[body].v_PN_N;
}

void Attraction::begin_step(Ns start, const Vector3d &r_BN_N, const Vector3d &v_BN_N)
{
    last_ = {start, 0.0, r_BN_N, v_BN_N};
    for (std::size_t i = 0; i < bodies_.size(); i++) {
        if (*bodies_[i].surface > 0.0) {
            last_r_BP_N_[i] = r_BN_N - position(i, start, 0.0);
        }
    }
}

double Attraction::arc(const GravityBody &body)
{
    return *body.surface > 0.0 ? 0.25 * body.mu / (*body.surface * *body.surface) : 0.0;
}

void Attraction::end_step(Ns start, double tau, const Vector3d &r_BN_N, const Vector3d &v_BN_N)
{
    const Knot end{start, tau, r_BN_N, v_BN_N};
    const double h = tick_seconds(start - last_.start) + (tau - last_.tau);
    for (std::size_t i = 0; i < bodies_.size(); i++) {
        const double surface = *bodies_[i].surface;
        if (surface == 0.0) {
            continue;
        }
        const Vector3d r_BP_N = r_BN_N - position(i, start, tau), &last = last_r_BP_N_[i];
        // Within the step it comes nearer than at its ends by half the chord and the height of the arc over it.
        const double reach = surface + 0.5 * (r_BP_N - last).norm() + arc(bodies_[i]) * (h * h);
        if (!(std::min(r_BP_N.squaredNorm(), last.squaredNorm()) > reach * reach)) {
            look_closer(i, end, r_BP_N, h);
        }
        last_r_BP_N_[i] = r_BP_N;
    }
    last_ = end;
}

void Attraction::look_closer(std::size_t body, const Knot &end, const Vector3d &r_BP_N, double h)
{
    const double surface = *bodies_[body].surface;
    const auto refuse_inside = [&](double distance, double tau) {
        if (distance < surface) {
            const Ns t = end.start + static_cast<Ns>(std::llround(1e9 * tau));
            throw sim::RunError("inside " + name_of(bodies_[body]) + " at " + sim::format_time(t) +
                                ", at an altitude of " + sim::format_number(distance - surface) +
                                " m over its radius of " + sim::format_number(surface) +
                                " m (the body's `surface` can set another radius; 0: none)");
        }
    };
    refuse_inside(r_BP_N.norm(), end.tau);

    const Vector3d a0 = at(last_.start, last_.tau, last_.r_BN_N), a1 = at(end.start, end.tau, end.r_BN_N);
    const auto distance = [&](double s) {
        const double s2 = s * s, s3 = s2 * s, s4 = s3 * s, s5 = s4 * s;
        const double to_end = 10.0 * s3 - 15.0 * s4 + 6.0 * s5;
        const Vector3d r = (1.0 - to_end) * last_.r_BN_N + to_end * end.r_BN_N +
                           h * (s - 6.0 * s3 + 8.0 * s4 - 3.0 * s5) * last_.v_BN_N +
                           h * (-4.0 * s3 + 7.0 * s4 - 3.0 * s5) * end.v_BN_N +
                           0.5 * h * h * (s2 - 3.0 * s3 + 3.0 * s4 - s5) * a0 + 0.5 * h * h * (s3 - 2.0 * s4 + s5) * a1;
        return (r - position(body, last_.start, last_.tau + s * h)).norm();
    };
    // The nearest of these points, then thirds of the interval about it.
    constexpr int points = 16;
    int nearest = 1;
    double least = distance(1.0 / points);
    for (int i = 2; i < points; i++) {
        if (const double d = distance(static_cast<double>(i) / points); d < least) {
            least = d;
            nearest = i;
        }
    }
    double from = static_cast<double>(nearest - 1) / points, to = static_cast<double>(nearest + 1) / points;
    for (int i = 0; i < 40; i++) {
        const double third = (to - from) / 3.0;
        if (distance(from + third) < distance(to - third)) {
            to -= third;
        } else {
            from += third;
        }
    }
    refuse_inside(distance(from), end.tau - (1.0 - from) * h);
}

Vector3d Attraction::pull(const GravityBody &body, const Source &source, const Vector3d &r_BN_N) const
{
    const Vector3d r_BP_N = r_BN_N - source.r_PN_N;
    const auto shaped = [&] {
        if (!body.field) {
            return gravity(body, r_BP_N, source.pole_N);
        }
        Vector3d sum = body.field->gravity_N(source.dcm_PN, r_BP_N);
        if (source.tide) {
            sum += source.dcm_PN.transpose() * source.tide->model.gravity(source.tide->now, source.dcm_PN * r_BP_N);
        }
        return sum;
    };
    if (!source.pulls_origin) {
        return source.point ? point_mass_gravity(source.mu, r_BP_N) : shaped();
    }
    Vector3d sum = third_body_gravity(source.mu, r_BN_N, source.r_PN_N);
    if (!source.point) {
        sum += shaped() - point_mass_gravity(source.mu, r_BP_N);
    }
    return sum;
}

Vector3d Attraction::at(Ns start, double tau, const Vector3d &r_BN_N)
{
    Vector3d sum = Vector3d::Zero();
    for (std::size_t i = 0; i < bodies_.size(); i++) {
        const GravityBody &body = bodies_[i];
        if (sky_) {
            place(sources_[i], start, tau);
            sum += pull(body, sources_[i], r_BN_N);
        } else {
            sum += gravity(body, r_BN_N - position(i, start, tau));
        }
    }
    return sum;
}

Vector3d Attraction::torque(Ns start, double tau, const Vector3d &r_BN_N, const Matrix3d &dcm_BN, const Matrix3d &I_B)
{
    Vector3d sum = Vector3d::Zero();
    for (std::size_t i = 0; i < bodies_.size(); i++) {
        const Vector3d r_B = dcm_BN * (r_BN_N - position(i, start, tau));
        const double r2 = r_B.squaredNorm();
        sum += (3.0 * (sky_ ? sources_[i].mu : bodies_[i].mu) / (r2 * r2 * std::sqrt(r2))) * r_B.cross(I_B * r_B);
    }
    return sum;
}

Matrix3d Attraction::gradient(Ns start, double tau, const Vector3d &r_BN_N)
{
    Matrix3d sum = Matrix3d::Zero();
    for (std::size_t i = 0; i < bodies_.size(); i++) {
        const Vector3d r = r_BN_N - position(i, start, tau);
        const double r2 = r.squaredNorm(), mu = sky_ ? sources_[i].mu : bodies_[i].mu;
        sum += (mu / (r2 * r2 * std::sqrt(r2))) * (3.0 * r * r.transpose() - r2 * Matrix3d::Identity());
    }
    return sum;
}

std::vector<std::string> Attraction::assumptions() const
{
    std::vector<std::string> lines;
    for (const GravityBody &body : bodies_) {
        if (!sky_ || !body.naif || *body.naif == sky_->center()) {
            continue;
        }
        if (const int target = sky_->given_as(*body.naif); target != *body.naif) {
            lines.push_back("gravity: the ephemeris has no " + body_name(*body.naif) + "; " + body_name(target) +
                            " stands for it, with the mass of its moons");
        }
    }
    return lines;
}

} // namespace fledge::world
