// SPDX-License-Identifier: Apache-2.0
// Densities that CNES and Orekit publish of DTM2000, and what the law gives for them.
// Source: Bruinsma, Thuillier and Barlier 2003 (docs/references.md).
#pragma once

#include "world/environment/air/dtm2000.h"

#include <cmath>

namespace fledge::world::published_dtm2000 {

inline AirPlace at(double km, double latitude, int day, double longitude = 0.0)
{
    AirPlace place;
    place.altitude = 1e3 * km;
    place.latitude = M_PI / 180.0 * latitude;
    place.longitude = M_PI / 180.0 * longitude;
    place.day_of_year = day;
    place.hour_angle = M_PI / 3.0; // 16 h
    return place;
}

inline SolarActivity activity(double F107, double mean, double kp = 0.0, double kp_day = 0.0)
{
    SolarActivity sun;
    sun.F107 = F107;
    sun.F107_average = mean;
    sun.kp_before = kp;
    sun.kp_average = kp_day;
    return sun;
}

struct Row {
    double km, latitude;
    int day;
    double flux, density;
};
/// In the comments of CNES's program. The last two are what it gives in double precision, by Orekit, whose tests note
/// that its comments on these are not of this version.
inline constexpr Row rows[] = {
    {800, 40, 185, 150, 1.8710001353820e-14},   {800, 40, 275, 150, 2.8524195214905e-14},
    {800, 40, 355, 150, 1.7343324462212e-14},   {800, 40, 85, 150, 2.9983740796297e-14},
    {500, -70, 15, 70, 1.5699108952425600e-13}, {800, -70, 15, 70, 2.4123751406975562e-15},
};

inline AirComposition of(const Row &row)
{
    return dtm2000(at(row.km, row.latitude, row.day), activity(row.flux, row.flux));
}

struct OrekitRow {
    int day;
    double km, longitude, latitude, local_time, F107, mean, kp, kp_day, density; ///< angles and local time in rad
};
/// Of Orekit's program, which has CNES's test cases; here all terms count.
inline constexpr OrekitRow orekit_rows[] = {
    {122, 130, -2.3, 1.3, 3.0, 172, 161, 8.2, 3.8, 1.88726044425327e-08},
    {283, 373, 3.1, -0.1, 5.3, 153, 166, 1.4, 5.1, 7.55907398040105e-12},
    {268, 541, -3.0, 0.9, 1.0, 242, 76, 7.0, 6.6, 6.35587117096978e-13},
    {20, 245, 1.4, 0.6, 4.5, 67, 70, 0.3, 0.7, 4.07410316585099e-11},
    {69, 1069, -2.5, -1.1, 1.4, 244, 135, 5.6, 2.4, 7.50202470833295e-15},
    {350, 180, 0.5, -1.5, 2.6, 108, 121, 2.3, 0.2, 6.19671911126791e-10},
};

inline AirComposition of(const OrekitRow &row)
{
    AirPlace place = at(row.km, 180.0 / M_PI * row.latitude, row.day, 180.0 / M_PI * row.longitude);
    place.hour_angle = row.local_time - M_PI;
    return dtm2000(place, activity(row.F107, row.mean, row.kp, row.kp_day));
}

} // namespace fledge::world::published_dtm2000
