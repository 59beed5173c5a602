// SPDX-License-Identifier: Apache-2.0
// The 17 test cases that NRL publishes with NRLMSISE-00, and what the law gives for them.
// Source: Picone et al. 2002, NRL's package (docs/references.md).
#pragma once

#include "world/environment/air/nrlmsise00.h"

#include <algorithm>
#include <cmath>

namespace fledge::world::published_nrlmsise00 {

inline constexpr double degree = M_PI / 180.0, unit = 1.66e-27;

inline AirPlace place_at(double km, double latitude, double longitude, int day, double seconds, double local_hours)
{
    AirPlace place;
    place.altitude = 1e3 * km;
    place.latitude = latitude * degree;
    place.longitude = longitude * degree;
    place.day_of_year = day;
    place.seconds_of_day = seconds;
    place.hour_angle = (local_hours - 12.0) * M_PI / 12.0;
    return place;
}

inline SolarActivity activity_of(double F107, double F107_average, double ap)
{
    SolarActivity sun;
    sun.F107 = F107;
    sun.F107_average = F107_average;
    sun.ap[0] = ap;
    return sun;
}

/// [kg/m^3] without anomalous oxygen.
inline double plain_density(const AirComposition &air)
{
    return air.density - 16.0 * unit * air.species.anomalous_O;
}

struct Published {
    int day;
    double seconds, km, latitude, longitude, hours, F107_average, F107, ap;
    bool history; ///< ap of 100 for 57 h
    // 1/cm^3, g/cm^3 without anomalous oxygen, K
    double He, O, N2, O2, Ar, density, H, N, anomalous_O, exosphere, temperature;
};

inline constexpr Published published[] = {
    {172,        29000,      400,        60,         -70,        16,         150,        150,
     4,          false,      6.665177e5, 1.138806e8, 1.998211e7, 4.022764e5, 3.557465e3, 4.074714e-15,
     3.475312e4, 4.095913e6, 2.667273e4, 1250.540,   1241.416},
    {81,         29000,      400,        60,         -70,        16,         150,        150,
     4,          false,      3.407293e6, 1.586333e8, 1.391117e7, 3.262560e5, 1.559618e3, 5.001846e-15,
     4.854208e4, 4.380967e6, 6.956682e3, 1166.754,   1161.710},
    {172,        75000,      1000,       60,         -70,        16,          150,         150,
     4,          false,      1.123767e5, 6.934130e4, 4.247105e1, 1.322750e-1, 2.618848e-5, 2.756772e-18,
     2.016750e4, 5.741256e3, 2.374394e4, 1239.892,   1239.891},
    {172,        29000,      100,          60,          -70,         16,          150,         150,
     4,          false,      5.411554e7,   1.918893e11, 6.115826e12, 1.225201e12, 6.023212e10, 3.584426e-10,
     1.059880e7, 2.615737e5, 2.819879e-42, 1027.318,    206.8878},
    {172,        29000,      400,        0,          -70,        16,         150,        150,
     4,          false,      1.851122e6, 1.476555e8, 1.579356e7, 2.633795e5, 1.588781e3, 4.809630e-15,
     5.816167e4, 5.478984e6, 1.264446e3, 1212.396,   1208.135},
    {172,        29000,      400,        60,         0,          16,         150,        150,
     4,          false,      8.673095e5, 1.278862e8, 1.822577e7, 2.922214e5, 2.402962e3, 4.355866e-15,
     3.686389e4, 3.897276e6, 2.667273e4, 1220.146,   1212.712},
    {172,        29000,      400,        60,         -70,        4,          150,        150,
     4,          false,      5.776251e5, 6.979139e7, 1.236814e7, 2.492868e5, 1.405739e3, 2.470651e-15,
     5.291986e4, 1.069814e6, 2.667273e4, 1116.385,   1112.999},
    {172,        29000,      400,        60,         -70,        16,         70,         150,
     4,          false,      3.740304e5, 4.782720e7, 5.240380e6, 1.759875e5, 5.501649e2, 1.571889e-15,
     8.896776e4, 1.979741e6, 9.121815e3, 1031.247,   1024.848},
    {172,        29000,      400,        60,         -70,        16,         150,        180,
     4,          false,      6.748339e5, 1.245315e8, 2.369010e7, 4.911583e5, 4.578781e3, 4.564420e-15,
     3.244595e4, 5.370833e6, 2.667273e4, 1306.052,   1293.374},
    {172,        29000,        400,        60,         -70,        16,         150,
     150,        40,           false,      5.528601e5, 1.198041e8, 3.495798e7, 9.339618e5,
     1.096255e4, 4.974543e-15, 2.686428e4, 4.889974e6, 2.805445e4, 1361.868,   1347.389},
    {172, 29000,       0,           60,          -70,         16,  150, 150, 4,        false,   1.375488e14,
     0.0, 2.049687e19, 5.498695e18, 2.451733e17, 1.261066e-3, 0.0, 0.0, 0.0, 1027.318, 281.4648},
    {172, 29000,       10,          60,          -70,         16,  150, 150, 4,        false,   4.427443e13,
     0.0, 6.597567e18, 1.769929e18, 7.891680e16, 4.059139e-4, 0.0, 0.0, 0.0, 1027.318, 227.4180},
    {172, 29000,       30,          60,          -70,         16,  150, 150, 4,        false,   2.127829e12,
     0.0, 3.170791e17, 8.506280e16, 3.792741e15, 1.950822e-5, 0.0, 0.0, 0.0, 1027.318, 237.4389},
    {172, 29000,       50,          60,          -70,         16,  150, 150, 4,        false,   1.412184e11,
     0.0, 2.104370e16, 5.645392e15, 2.517142e14, 1.294709e-6, 0.0, 0.0, 0.0, 1027.318, 279.5551},
    {172, 29000,       70,          60,          -70,         16,  150, 150, 4,        false,   1.254884e10,
     0.0, 1.874533e15, 4.923051e14, 2.239685e13, 1.147668e-7, 0.0, 0.0, 0.0, 1027.318, 219.0732},
    {172,        29000,      400,        60,         -70,        16,         150,        150,
     4,          true,       5.196477e5, 1.274494e8, 4.850450e7, 1.720838e6, 2.354487e4, 5.881940e-15,
     2.500078e4, 6.279210e6, 2.667273e4, 1426.412,   1408.608},
    {172,        29000,      100,          60,          -70,         16,          150,         150,
     4,          true,       4.260860e7,   1.241342e11, 4.929562e12, 1.048407e12, 4.993465e10, 2.914304e-10,
     8.831229e6, 2.252516e5, 2.415246e-42, 1027.318,    193.4071}};

inline AirComposition of(const Published &row)
{
    SolarActivity sun = activity_of(row.F107, row.F107_average, row.ap);
    if (row.history) {
        std::fill(sun.ap.begin() + 1, sun.ap.end(), 100.0);
        sun.history = true;
    }
    return nrlmsise00(place_at(row.km, row.latitude, row.longitude, row.day, row.seconds, row.hours), sun);
}

} // namespace fledge::world::published_nrlmsise00
