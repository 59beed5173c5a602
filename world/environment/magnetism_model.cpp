// SPDX-License-Identifier: Apache-2.0
#include "world/environment/magnetism_model.h"

#include "sim/text.h"
#include "world/eigen.h"

#include <Eigen/Dense>

#include <cstdio>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr int earth_id = 399;
constexpr double seconds_a_year = 365.2425 * 86400.0;
constexpr Ns least_held = 1'000'000'000; ///< in which the field changes by 1e-5 nT
constexpr double least_tolerance = 1e-14;
constexpr double most_small = 1e-5; ///< [rad^2] of an angle whose sine is a short series

/// Decimal, as the World Magnetic Model counts: the share of the calendar year that has passed.
double decimal_year(const TimeSystem &system, Epoch epoch)
{
    const int year = system.calendar(epoch, TimeScale::utc).year;
    const auto begin_of = [&](int y) { return system.epoch(CalendarTime{y, 1, 1, 0, 0, 0, 0}, TimeScale::utc); };
    const Epoch begin = begin_of(year), end = begin_of(year + 1);
    return year + static_cast<double>(epoch.ns - begin.ns) / static_cast<double>(end.ns - begin.ns);
}

} // namespace

void MagnetismModel::prepare(const sim::Setup &setup)
{
    EnvironmentModel::prepare(setup);
    refresh();
}

void MagnetismModel::refresh()
{
    EnvironmentModel::refresh();
    turned_tau_ = std::numeric_limits<double>::quiet_NaN();
    const auto &par = interface_.par;
    const bool dipole = vec_norm2(par.dipole_P) > 0.0;
    model_.reset();
    if (path_.empty()) {
        if (!dipole) {
            refuse(": give a moment, dipole_P, or a model, coefficients=\"WMM2025\"");
        }
        if (par.tolerance > 0.0) {
            refuse(".tolerance: there is no file of coefficients, and a dipole needs none");
        }
        if (par.degree > 0) {
            refuse(".degree: there is no file of coefficients; found " + std::to_string(par.degree));
        }
        return;
    }
    if (dipole) {
        refuse(".dipole_P: the file " + path_ + " has the dipole already");
    }
    if (bodies()[0].naif != earth_id) {
        refuse(".coefficients: " + path_ + " is the field of EARTH (399); found " + bodies()[0].name);
    }
    if (!sky()) {
        refuse(".sky is missing: the field of " + path_ + " turns with the Earth and changes with the years");
    }
    try {
        model_ = MagneticCoefficients::read(path_, static_cast<int>(par.degree));
        year_ = decimal_year(sky()->time_system(), sky()->epoch_at(0));
    } catch (const sim::SetupError &error) {
        refuse(std::string(".coefficients: ") + error.what());
    }
    require_year(0, "begins");
    held_ = least_held;
    if (par.tolerance > 0.0 && !(par.tolerance >= least_tolerance)) {
        refuse(".tolerance: expected 0, or at least 1e-14 T; found " + sim::format_number(par.tolerance));
    }
    if (par.tolerance > 0.0) { // a half for space, a half for time
        cubes_.set(0.5 * par.tolerance, model_->most_fourth_derivative());
        held_ *= static_cast<Ns>(std::clamp(0.5 * par.tolerance / model_->most_rate() * seconds_a_year, 1.0, 86400.0));
    }
}

double MagnetismModel::year(Ns t) const
{
    return year_ + tick_seconds(t) / seconds_a_year;
}

void MagnetismModel::require_year(Ns t, const char *what) const
{
    if (model_ && !(year(t) >= model_->epoch() && year(t) <= model_->end())) {
        char text[200];
        std::snprintf(text, sizeof text, " holds from %.1f to %.1f; the run %s in %.3f", model_->epoch(), model_->end(),
                      what, year(t));
        refuse(".coefficients: " + model_->name() + text);
    }
}

void MagnetismModel::ensure_data_until(Ns until)
{
    EnvironmentModel::ensure_data_until(until);
    require_year(until, "ends");
}

/// How the body of a file stands. Within a step it turns at a constant rate, since the Earth's changes by less than
/// 1e-15 rad/s in a second.
const Eigen::Matrix3d &MagnetismModel::dcm_PN(Ns start, double tau) const
{
    const BodyAttitude &begin = attitude(start, 0.0);
    if (tau == 0.0) {
        return begin.dcm_PN;
    }
    if (start != turned_start_ || tau != turned_tau_) {
        const double rate = begin.omega_PN_P.norm();
        const Vector3d axis = begin.omega_PN_P / rate;
        double s, c;
        const double angle = rate * tau, a2 = angle * angle;
        if (interface_.par.tolerance > 0.0 && a2 < most_small) { // to 1e-17
            s = angle * (1.0 - a2 / 6.0 * (1.0 - a2 / 20.0));
            c = 1.0 - a2 / 2.0 * (1.0 - a2 / 12.0);
        } else {
            fm_sincos(angle, &s, &c);
        }
        for (int i = 0; i < 3; i++) {
            const Vector3d column = begin.dcm_PN.col(i);
            turned_PN_.col(i) = c * column - s * axis.cross(column) + ((1.0 - c) * axis.dot(column)) * axis;
        }
        turned_start_ = start;
        turned_tau_ = tau;
    }
    return turned_PN_;
}

Vector3d MagnetismModel::at(Ns start, double tau, const Vector3d &r_BN_N) const
{
    const Vector3d r = r_BN_N - r_PN_N(0, start, tau);
    const double r2 = r.squaredNorm();
    if (r2 == 0.0) {
        throw sim::RunError(name() + ": the field is asked for in the centre of " + bodies()[0].name +
                            ", where it has no value; where is the spacecraft?");
    }
    if (model_) {
        const Eigen::Matrix3d &PN = dcm_PN(start, tau);
        const Ns when = start - start % held_;
        const auto exact = [&](const Vector3d &r_P) { return model_->field(r_P, year(when)); };
        const Vector3d r_P = PN * r;
        return PN.transpose() * (interface_.par.tolerance > 0.0 ? cubes_.at(r_P, when, exact) : exact(r_P));
    }
    const Vector3d m = attitude(start, tau).dcm_PN.transpose() * view(interface_.par.dipole_P);
    return 1.0 / (r2 * std::sqrt(r2)) * (3.0 * m.dot(r) / r2 * r - m);
}

void MagnetismModel::publish(Ns t)
{
    const CraftState &truth = interface_.in.truth;
    if (!head_written(truth.head)) {
        return;
    }
    interface_.out.field = {head_next(interface_.out.field.head, t, quality_through(truth.head)),
                            vec(at(t, 0.0, view(truth.r_BN_N)))};
}

void MagnetismModel::copy_setup(const sim::Model &original,
                                const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    EnvironmentModel::copy_setup(original, counterpart);
    path_ = dynamic_cast<const MagnetismModel &>(original).path_;
}

} // namespace fledge::world
