// SPDX-License-Identifier: Apache-2.0
// Outputs of the authors' program for JB2008, and what the law gives for them: rows of two runs over all heights and
// latitudes that come with SatelliteToolboxAtmosphericModels.jl, and those of its own test, which come with Orekit.
// Source: Bowman et al. 2008 (docs/references.md).
#pragma once

#include "world/environment/air/jb2008.h"

#include <cmath>

namespace fledge::world::published_jb2008 {

inline constexpr double degree = M_PI / 180.0;

/// [rad] right ascension of Greenwich, by the program's formula.
inline double greenwich(double mjd)
{
    const double days = mjd - 33281.0 - 7305.0, whole = std::floor(days), daily = 1.720279169407e-2;
    return 1.73213438565 + daily * whole + (daily + 2.0 * M_PI) * (days - whole) + 5.0755141943e-15 * days * days;
}

/// longitude and latitude in deg, the Sun's in rad; day: of the year.
inline AirPlace at(double km, double longitude, double latitude, double mjd, int day, double sun_ascension,
                   double declination)
{
    AirPlace place;
    place.altitude = 1e3 * km;
    place.geocentric_latitude = degree * latitude;
    place.mjd = mjd;
    place.day_of_year = day;
    place.seconds_of_day = 86400.0 * (mjd - std::floor(mjd));
    place.sun_declination = declination;
    place.hour_angle = greenwich(mjd) + degree * longitude - sun_ascension;
    return place;
}

/// F10, S10, M10, Y10, each with its mean, and DTC.
inline SolarActivity activity(double F, double F_mean, double S, double S_mean, double M, double M_mean, double Y,
                              double Y_mean, double DTC)
{
    SolarActivity sun;
    sun.F10_jb = F;
    sun.F107_average = F_mean;
    sun.S10 = S;
    sun.S10_average = S_mean;
    sun.M10 = M;
    sun.M10_average = M_mean;
    sun.Y10 = Y;
    sun.Y10_average = Y_mean;
    sun.storm_temperature = DTC;
    return sun;
}

struct Row {
    double km, longitude, latitude, exosphere, temperature, density;
};
/// 2017, day 196, 19:06:19.5: indices from the authors' SOLFSMY and DTCFILE, as of 2009.
inline constexpr Row rows_2017[] = {
    {120, 30, 10, 730.0, 326.8, 2.0238e-8},     {170, 120, 60, 737.9, 650.8, 5.1092e-10},
    {220, 0, -90, 716.9, 687.7, 6.7842e-11},    {270, 90, 80, 775.1, 756.1, 1.5973e-11},
    {320, 180, -80, 707.4, 698.4, 2.8198e-12},  {370, 60, -20, 685.7, 686.8, 6.7689e-13},
    {420, 150, 20, 688.2, 688.2, 1.9427e-13},   {470, 30, -10, 720.6, 718.4, 8.1133e-14},
    {570, 120, 40, 706.5, 701.0, 1.0307e-14},   {620, 0, 90, 793.3, 788.5, 1.0391e-14},
    {670, 90, -60, 682.9, 678.5, 2.9573e-15},   {770, 180, -40, 692.2, 691.4, 1.6805e-15},
    {870, 60, 30, 710.9, 710.8, 1.1322e-15},    {970, 150, 10, 681.1, 681.1, 7.5077e-16},
    {1020, 30, 60, 767.1, 767.1, 8.0026e-16},   {1170, 120, -90, 716.9, 716.9, 5.3296e-16},
    {1370, 0, 80, 794.3, 794.3, 5.0267e-16},    {1520, 90, -80, 703.1, 703.1, 3.6067e-16},
    {1670, 180, -20, 695.4, 695.4, 3.0862e-16}, {1970, 60, 20, 702.1, 702.1, 2.2396e-16},
    {2020, 150, -10, 673.9, 673.9, 2.6822e-16}, {2520, 30, 40, 750.2, 750.2, 1.1271e-16},
    {2970, 120, 90, 793.3, 793.3, 6.9210e-17}};
/// 2009, day 138, 07:19:56.5
inline constexpr Row rows_2009[] = {
    {120, 60, -40, 753.7, 330.2, 2.5057e-8},    {170, 150, 30, 793.0, 666.1, 6.3104e-10},
    {220, 30, 10, 741.5, 701.3, 8.3468e-11},    {270, 120, 60, 803.5, 773.8, 2.1329e-11},
    {320, 0, -90, 693.4, 683.0, 3.2918e-12},    {370, 90, 80, 777.2, 765.4, 1.5629e-12},
    {420, 180, -80, 693.9, 689.3, 2.6772e-13},  {470, 60, -20, 777.4, 774.7, 1.8538e-13},
    {570, 150, 20, 792.3, 799.6, 3.5308e-14},   {620, 30, -10, 731.8, 727.1, 9.2648e-15},
    {670, 120, 40, 821.8, 828.5, 1.0803e-14},   {770, 0, 90, 760.4, 759.9, 3.1104e-15},
    {870, 90, -60, 742.8, 742.7, 1.7415e-15},   {970, 180, -40, 711.4, 711.3, 1.0456e-15},
    {1020, 60, 30, 801.8, 801.7, 1.1675e-15},   {1170, 150, 10, 789.4, 789.4, 7.4245e-16},
    {1370, 30, 60, 757.1, 757.1, 4.6390e-16},   {1520, 120, -90, 693.4, 693.4, 3.8333e-16},
    {1670, 0, 80, 749.4, 749.4, 2.5984e-16},    {1970, 90, -80, 708.8, 708.8, 2.1836e-16},
    {2020, 180, -20, 724.6, 724.6, 1.8995e-16}, {2520, 60, 20, 801.6, 801.6, 8.8419e-17},
    {2970, 150, -10, 777.6, 777.6, 7.6906e-17}};

/// From the authors' program, compiled with gfortran: a strong Sun, and each band of altitudes.
inline constexpr Row rows_2001[] = {
    {91, 20, 30, 1545.8689, 183.0793, 2.877936e-06},      {104, 140, -50, 1753.2668, 219.3033, 2.705485e-07},
    {110, -100, 60, 1563.6670, 266.3012, 9.269240e-08},   {135, 30, 10, 1569.2687, 620.6550, 6.114263e-09},
    {160, 75, -20, 1744.2124, 975.2184, 1.479243e-09},    {195, -60, 45, 1507.9402, 1203.9266, 3.294603e-10},
    {215, -110, -5, 1512.3453, 1283.6012, 1.670774e-10},  {235, 120, -70, 1689.2178, 1483.4431, 9.927699e-11},
    {265, 55, 25, 1671.4603, 1554.7633, 4.464451e-11},    {290, -30, 0, 1461.8892, 1393.5626, 1.997522e-11},
    {400, 90, 15, 1812.1069, 1808.5761, 2.936290e-12},    {700, 60, -35, 1668.1488, 1672.1229, 2.073129e-14},
    {1200, -150, 50, 1632.8734, 1632.6839, 1.230960e-16}, {2010, 10, -60, 1543.5903, 1543.5670, 9.605493e-16}};

inline AirComposition of_2017(const Row &row)
{
    return jb2008(at(row.km, row.longitude, row.latitude, 57949.0 + 68779.5 / 86400.0, 196, 2.0129, 0.3734),
                  activity(93.9, 76.2, 67.7, 64.7, 86.3, 76.3, 89.8, 84.1, 24.0));
}

inline AirComposition of_2009(const Row &row)
{
    return jb2008(at(row.km, row.longitude, row.latitude, 54969.0 + 26396.5 / 86400.0, 138, 0.9637, 0.3421),
                  activity(74.0, 69.7, 57.2, 54.0, 70.8, 65.3, 60.0, 58.2, 31.0));
}

inline AirComposition of_2001(const Row &row)
{
    return jb2008(at(row.km, row.longitude, row.latitude, 52000.25, 91, 0.1925, 0.0834),
                  activity(280.0, 250.0, 230.0, 190.0, 220.0, 195.0, 210.0, 185.0, 150.0));
}

struct Storm {
    double day; ///< since 1949-12-31
    double ascension, declination, longitude, latitude, km, F, F_mean, S, S_mean, M, M_mean, Y, Y_mean, DTC, density;
};
/// 7 to 12 November 2004
inline constexpr Storm storms[] = {{20035.00454861111, 3.8826, -0.2847, 73.46, -85.24, 398.91, 128.8, 105.6, 103.5,
                                    103.8, 110.9, 106.9, 127.9, 112.9, 3, 1.8730056e-12},
                                   {20035.50362, 3.8914, -0.2873, 218.68, -18.65, 376.75, 128.8, 105.6, 103.5, 103.8,
                                    110.9, 106.9, 127.9, 112.9, 80, 2.5650339e-12},
                                   {20036.00468, 3.9001, -0.2898, 34.55, 37.71, 373.45, 129.6, 105.6, 110.2, 103.8,
                                    115.6, 106.9, 125.9, 112.9, 240, 5.7428913e-12},
                                   {20036.50375, 3.9089, -0.2923, 46.25, 74.36, 380.61, 129.6, 105.6, 110.2, 103.8,
                                    115.6, 106.9, 125.9, 112.9, 307, 8.3266893e-12},
                                   {20037, 3.9176, -0.2948, 216.56, -8.85, 374.03, 124.1, 105.6, 109.4, 103.8, 110,
                                    106.9, 127.7, 113, 132, 8.2238726e-12},
                                   {20037.50556, 3.9265, -0.2973, 32, -39.64, 385.05, 124.1, 105.6, 109.4, 103.8, 110,
                                    106.9, 127.7, 113, 40, 4.8686457e-12},
                                   {20038.00088, 3.9352, -0.2998, 38.83, -51.93, 389.83, 140.9, 105.6, 108.6, 103.7,
                                    110, 107, 125.6, 113.2, 327, 6.7210914e-12},
                                   {20038.50644, 3.9441, -0.3022, 213.67, -21.25, 376.98, 140.9, 105.6, 108.6, 103.7,
                                    110, 107, 125.6, 113.2, 327, 7.4215571e-12},
                                   {20039.00543, 3.9529, -0.3046, 29.37, 46.43, 374.56, 104.6, 105.7, 107.4, 103.7,
                                    106.9, 107.1, 126.6, 113.2, 118, 3.1821075e-12},
                                   {20039.5045, 3.9618, -0.307, 38.12, 65.97, 378.97, 104.6, 105.7, 107.4, 103.7, 106.9,
                                    107.1, 126.6, 113.2, 25, 2.9553578e-12},
                                   {20040, 3.9706, -0.3094, 211.78, -21.31, 377.76, 94.9, 105.9, 110.9, 103.7, 102.2,
                                    107.1, 126.8, 113.3, 85, 6.4122627e-12},
                                   {20040.50556, 3.9795, -0.3117, 26.64, -51.87, 390.09, 94.9, 105.9, 110.9, 103.7,
                                    102.2, 107.1, 126.8, 113.3, 251, 7.9559727e-12}};

inline AirComposition of(const Storm &row)
{
    return jb2008(at(row.km, row.longitude, row.latitude, 33281.0 + row.day, static_cast<int>(row.day) - 19723,
                     row.ascension, row.declination),
                  activity(row.F, row.F_mean, row.S, row.S_mean, row.M, row.M_mean, row.Y, row.Y_mean, row.DTC));
}

} // namespace fledge::world::published_jb2008
