// SPDX-License-Identifier: Apache-2.0
#include "world/environment/earth_atmosphere_model.h"

#include "flight/math/elementary.h"
#include "sim/text.h"
#include "world/environment/air/dtm2000.h"
#include "world/environment/air/jb2008.h"
#include "world/environment/air/met.h"
#include "world/environment/air/nrlmsise00.h"
#include "world/environment/bodies.h"

#include <Eigen/Dense>

#include <cmath>
#include <numbers>

namespace fledge::world {

using Eigen::Vector3d;
using sim::Ns;

namespace {

constexpr double seconds_a_day = 86400.0;

// In the order of EarthAirLaw.
constexpr AirComposition (*laws[])(const AirPlace &, const SolarActivity &) = {nrlmsise00, jb2008, dtm2000, met};

GravityBody body_of(const char *name, int naif, double radius)
{
    GravityBody body;
    body.name = name;
    body.naif = naif;
    body.mu = body_mu(naif);
    body.radius = radius;
    return body;
}

} // namespace

EarthAtmosphereModel::EarthAtmosphereModel(EarthAtmosphere &interface)
    : AirModel(interface.in.truth, interface.out.air), interface_(interface)
{
    set_body(body_of("EARTH", 399, 6378137.0));
    add_body(body_of("SUN", 10, 6.957e8));
}

void EarthAtmosphereModel::prepare(const sim::Setup &setup)
{
    AirModel::prepare(setup);
    if (!sky()) {
        refuse(".sky is missing: it says the date and where the Sun is, as in sky=world.Sky(\"2026-03-20\", "
               "center=world.EARTH)");
    }
}

void EarthAtmosphereModel::refresh()
{
    EnvironmentModel::refresh();
    start_ = -1;
    const auto &par = interface_.par;
    if (weather_) {
        const std::pair<const char *, double> given[] = {{"F107", par.F107},
                                                         {"F107_average", par.F107_average},
                                                         {"ap", par.ap},
                                                         {"S10", par.S10},
                                                         {"M10", par.M10},
                                                         {"Y10", par.Y10},
                                                         {"storm_temperature", par.storm_temperature}};
        for (const auto &[name, value] : given) {
            if (value != 0.0) {
                refuse("." + std::string(name) + ": `weather` has the activity; found " + sim::format_number(value) +
                       " besides: leave one of both out");
            }
        }
        return;
    }
    if (par.F107 == 0.0) {
        refuse(".F107 must be > 0, or weather=world.SpaceWeather(\"SW-All.csv\") has the activity; found 0");
    }
    const auto otherwise = [](double value, double instead) { return value > 0.0 ? value : instead; };
    SolarActivity &a = constant_;
    a = {};
    a.F107 = a.F10_jb = par.F107;
    a.F107_average = otherwise(par.F107_average, par.F107);
    a.ap.fill(par.ap);
    a.ap_before = par.ap;
    a.kp_before = a.kp_average = kp_of_ap(par.ap);
    a.S10 = otherwise(par.S10, par.F107);
    a.S10_average = otherwise(par.S10_average, otherwise(par.S10, a.F107_average));
    a.M10 = otherwise(par.M10, par.F107);
    a.M10_average = otherwise(par.M10_average, otherwise(par.M10, a.F107_average));
    a.Y10 = otherwise(par.Y10, par.F107);
    a.Y10_average = otherwise(par.Y10_average, otherwise(par.Y10, a.F107_average));
    a.storm_temperature = par.storm_temperature;
}

void EarthAtmosphereModel::ensure_data_until(Ns until)
{
    AirModel::ensure_data_until(until);
    if (weather_) {
        try {
            weather_->require(sky()->epoch_at(0), sky()->epoch_at(until), law());
        } catch (const sim::SetupError &error) {
            refuse(std::string(".weather: ") + error.what());
        }
    }
}

/// The date, the activity and the Sun's direction at the beginning of a step: the seconds are added for each stage.
void EarthAtmosphereModel::begin(Ns start) const
{
    const Epoch epoch = sky()->epoch_at(start);
    const CalendarTime utc = sky()->time_system().calendar(epoch, TimeScale::utc);
    const int mjd = *mjd_of(utc.year, utc.month, utc.day);
    date_.year = utc.year;
    date_.day_of_year = mjd - *mjd_of(utc.year, 1, 1) + 1;
    date_.seconds_of_day = 3600.0 * utc.hour + 60.0 * utc.minute + utc.second + 1e-9 * utc.nanosecond;
    date_.mjd = mjd;
    activity_ = weather_ ? weather_->at(epoch, law()) : constant_;
    activity_.history = weather_ != nullptr;
    sun_N_ = (r_PN_N(1, start, 0.0) - r_PN_N(0, start, 0.0)).normalized();
    start_ = start;
}

AirSource::State EarthAtmosphereModel::air(const Place &place) const
{
    if (place.start != start_) {
        begin(place.start);
    }
    AirPlace at = date_;
    at.seconds_of_day += place.tau;
    at.mjd += at.seconds_of_day / seconds_a_day;
    at.altitude = place.altitude;
    const Ellipsoid::Height height = ellipsoid().height(place.r_P);
    at.latitude = fm_atan2(height.sine, height.cosine);
    const double across = std::hypot(place.r_P[0], place.r_P[1]);
    at.geocentric_latitude = fm_atan2(place.r_P[2], across);
    at.longitude = fm_atan2(place.r_P[1], place.r_P[0]);
    const Vector3d sun_P = attitude(place.start, place.tau).dcm_PN * sun_N_;
    at.sun_declination = fm_asin(sun_P[2]);
    at.hour_angle =
        fm_atan2(sun_P[0] * place.r_P[1] - sun_P[1] * place.r_P[0], sun_P[0] * place.r_P[0] + sun_P[1] * place.r_P[1]);
    const AirComposition found = laws[interface_.par.law](at, activity_);
    const double factor = interface_.par.density_factor > 0.0 ? interface_.par.density_factor : 1.0;
    return {factor * found.density, place.altitude, {0, 0, 0}, found.temperature, found.molar_mass};
}

void EarthAtmosphereModel::copy_setup(const sim::Model &original,
                                      const std::function<sim::Model *(const sim::Model *)> &counterpart)
{
    AirModel::copy_setup(original, counterpart);
    weather_ = dynamic_cast<const EarthAtmosphereModel &>(original).weather_;
}

} // namespace fledge::world
