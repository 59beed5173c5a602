// SPDX-License-Identifier: Apache-2.0
// Values of the runs that NASA publishes with JEOD, and what the law MET gives for them:
// models/environment/atmosphere/MET/verif/SIM_MET, RUN_T01_MET_VER, RUN_T02_MET_VER and RUN_T02_GRAM_MET, all with
// F10.7 = 230 and ap = 20.3.
#pragma once

#include "world/environment/air/met.h"

#include <cmath>

namespace fledge::world::published_met {

inline constexpr double degree = M_PI / 180.0;

inline SolarActivity activity(double F107 = 230.0, double mean = 230.0, double ap = 20.3)
{
    SolarActivity sun;
    sun.F107 = F107;
    sun.F107_average = mean;
    sun.ap_before = ap;
    return sun;
}

inline AirPlace at(double km, double latitude, double longitude, double mjd)
{
    AirPlace place;
    place.altitude = 1e3 * km;
    place.latitude = degree * latitude;
    place.longitude = degree * longitude;
    place.mjd = mjd;
    return place; // on the first of January
}

inline const AirPlace cape = at(140.0, 28.45, -80.53, 49718.0 + 1.0 / 86400.0);  // 1995-01-01 00:00:01
inline const AirPlace north = at(400.0, 55.0, 45.0, 51544.0 + 5508.0 / 86400.0); // 2000-01-01 01:31:48

struct Row {
    double km, density, temperature;
};
inline constexpr Row cape_rows[] = {
    {140, 4.304924797903701e-09, 670.3252827814381}, {138, 4.929228072925611e-09, 643.6454929500769},
    {136, 5.687731881254846e-09, 616.24425097367},   {134, 6.618429736701458e-09, 588.1931269420666},
    {132, 7.772498578040231e-09, 559.5796571938923}, {130, 9.219752108162039e-09, 530.506825656962},
    {128, 1.105675998282443e-08, 501.0918248538779}, {126, 1.341916024936682e-08, 471.4641838472012},
    {124, 1.650040764011092e-08, 441.7713284015117}, {122, 2.057293493346911e-08, 412.3350709912647},
    {120, 2.602079708565878e-08, 383.6122474371802}};
inline constexpr Row north_rows[] = {
    {100, 6.571646794438618e-07, 197.2106442078494}, {150, 2.346642711457993e-09, 758.3465218644997},
    {200, 3.646226657847526e-10, 1048.115142534023}, {250, 1.044117128617107e-10, 1153.600848677321},
    {300, 3.761338295527799e-11, 1196.189592386001}, {350, 1.543938293604979e-11, 1214.038201196927},
    {400, 6.900325309508664e-12, 1222.100331166816}, {450, 3.271872289480079e-12, 1226.070217922211},
    {500, 1.641153372616514e-12, 1228.18670378001},  {550, 8.455412661336107e-13, 1229.39443040751},
    {600, 4.497316725905124e-13, 1230.123952416797}, {650, 2.471198821832113e-13, 1230.586091444494},
    {700, 1.408349383153774e-13, 1230.890800925069}, {750, 8.375388308161104e-14, 1231.098646702406},
    {800, 5.231799021000984e-14, 1231.244601175355}, {850, 3.44973484041922e-14, 1231.349699767891},
    {900, 2.404099311310925e-14, 1231.427052594837}, {950, 1.76500326887449e-14, 1231.485088618366},
    {1000, 1.355728039715842e-14, 1231.529377783616}};

inline AirComposition at_height(AirPlace place, double km)
{
    place.altitude = 1e3 * km;
    return met(place, activity());
}

inline AirComposition at_cape(const Row &row)
{
    return at_height(cape, row.km);
}

inline AirComposition at_north(const Row &row)
{
    return at_height(north, row.km);
}

struct LatitudeRow {
    double latitude, density, temperature;
};
/// 650 km over those of `north`.
inline constexpr LatitudeRow latitude_rows[] = {
    {-90, 5.33060862600024e-13, 1440.188672993092},  {-80, 4.748860861718928e-13, 1407.79236172849},
    {-70, 4.203673501645911e-13, 1375.171246796176}, {-60, 3.714256646644871e-13, 1343.544784674019},
    {-50, 3.292665717054848e-13, 1314.038016684814}, {-40, 2.944456739801343e-13, 1287.624323402257},
    {-30, 2.670009049582385e-13, 1265.073650777293}, {-20, 2.466076112804135e-13, 1246.907642432214},
    {-10, 2.327139037115113e-13, 1233.361804558381}, {0, 2.246222482584653e-13, 1224.352066330117},
    {10, 2.214901130976494e-13, 1219.43543998229},   {20, 2.222007365476129e-13, 1217.72016696432},
    {30, 2.251209260287649e-13, 1217.731014010533},  {40, 2.307674698711875e-13, 1220.042208755886},
    {50, 2.404819998970499e-13, 1225.999382849229},  {60, 2.550439987501015e-13, 1236.320030483538},
    {70, 2.749784516401654e-13, 1251.318329084268},  {80, 3.0065566314489e-13, 1270.963454939832},
    {90, 3.323202644034574e-13, 1294.913802828757}};

inline AirComposition of(const LatitudeRow &row)
{
    AirPlace place = north;
    place.latitude = degree * row.latitude;
    return at_height(place, 650.0);
}

} // namespace fledge::world::published_met
