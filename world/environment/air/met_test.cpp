// SPDX-License-Identifier: Apache-2.0
// Against the runs that NASA publishes with JEOD: models/environment/atmosphere/MET/verif/SIM_MET, RUN_T01_MET_VER,
// RUN_T02_MET_VER and RUN_T02_GRAM_MET, all with F10.7 = 230 and ap = 20.3.
#include "world/environment/air/met.h"

#include "world/environment/air/jacchia.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fledge::world {
namespace met_test {

constexpr double degree = M_PI / 180.0;

SolarActivity activity(double F107 = 230.0, double mean = 230.0, double ap = 20.3)
{
    SolarActivity sun;
    sun.F107 = F107;
    sun.F107_average = mean;
    sun.ap_before = ap;
    return sun;
}

AirPlace at(double km, double latitude, double longitude, double mjd)
{
    AirPlace place;
    place.altitude = 1e3 * km;
    place.latitude = degree * latitude;
    place.longitude = degree * longitude;
    place.mjd = mjd;
    return place; // on the first of January
}

const AirPlace cape = at(140.0, 28.45, -80.53, 49718.0 + 1.0 / 86400.0);  // 1995-01-01 00:00:01
const AirPlace north = at(400.0, 55.0, 45.0, 51544.0 + 5508.0 / 86400.0); // 2000-01-01 01:31:48

struct Row {
    double km, density, temperature;
};

template <int rows> void expect_rows(AirPlace place, double exosphere, const Row (&table)[rows])
{
    for (const Row &row : table) {
        place.altitude = 1e3 * row.km;
        const AirComposition air = met(place, activity());
        EXPECT_NEAR(air.exosphere, exosphere, 1e-7 * exosphere);
        EXPECT_NEAR(air.temperature, row.temperature, 1e-7 * row.temperature) << row.km;
        // JEOD's weights of integration have 7 digits; up to 105 km it takes the density that the sum rounds.
        EXPECT_NEAR(air.density, row.density, (row.km < 105.0 ? 1e-5 : 3e-7) * row.density) << row.km;
    }
}

TEST(MET, HasThePublishedDensitiesAndTemperatures)
{
    expect_rows(cape, 1379.074105237556,
                {{140, 4.304924797903701e-09, 670.3252827814381},
                 {138, 4.929228072925611e-09, 643.6454929500769},
                 {136, 5.687731881254846e-09, 616.24425097367},
                 {134, 6.618429736701458e-09, 588.1931269420666},
                 {132, 7.772498578040231e-09, 559.5796571938923},
                 {130, 9.219752108162039e-09, 530.506825656962},
                 {128, 1.105675998282443e-08, 501.0918248538779},
                 {126, 1.341916024936682e-08, 471.4641838472012},
                 {124, 1.650040764011092e-08, 441.7713284015117},
                 {122, 2.057293493346911e-08, 412.3350709912647},
                 {120, 2.602079708565878e-08, 383.6122474371802}});
    expect_rows(north, 1231.724662723262,
                {{100, 6.571646794438618e-07, 197.2106442078494},
                 {150, 2.346642711457993e-09, 758.3465218644997},
                 {200, 3.646226657847526e-10, 1048.115142534023},
                 {250, 1.044117128617107e-10, 1153.600848677321},
                 {300, 3.761338295527799e-11, 1196.189592386001},
                 {350, 1.543938293604979e-11, 1214.038201196927},
                 {400, 6.900325309508664e-12, 1222.100331166816},
                 {450, 3.271872289480079e-12, 1226.070217922211},
                 {500, 1.641153372616514e-12, 1228.18670378001},
                 {550, 8.455412661336107e-13, 1229.39443040751},
                 {600, 4.497316725905124e-13, 1230.123952416797},
                 {650, 2.471198821832113e-13, 1230.586091444494},
                 {700, 1.408349383153774e-13, 1230.890800925069},
                 {750, 8.375388308161104e-14, 1231.098646702406},
                 {800, 5.231799021000984e-14, 1231.244601175355},
                 {850, 3.44973484041922e-14, 1231.349699767891},
                 {900, 2.404099311310925e-14, 1231.427052594837},
                 {950, 1.76500326887449e-14, 1231.485088618366},
                 {1000, 1.355728039715842e-14, 1231.529377783616}});
}

TEST(MET, HasThePublishedValuesOfAllLatitudes)
{
    const struct {
        double latitude, density, temperature;
    } table[] = {{-90, 5.33060862600024e-13, 1440.188672993092},  {-80, 4.748860861718928e-13, 1407.79236172849},
                 {-70, 4.203673501645911e-13, 1375.171246796176}, {-60, 3.714256646644871e-13, 1343.544784674019},
                 {-50, 3.292665717054848e-13, 1314.038016684814}, {-40, 2.944456739801343e-13, 1287.624323402257},
                 {-30, 2.670009049582385e-13, 1265.073650777293}, {-20, 2.466076112804135e-13, 1246.907642432214},
                 {-10, 2.327139037115113e-13, 1233.361804558381}, {0, 2.246222482584653e-13, 1224.352066330117},
                 {10, 2.214901130976494e-13, 1219.43543998229},   {20, 2.222007365476129e-13, 1217.72016696432},
                 {30, 2.251209260287649e-13, 1217.731014010533},  {40, 2.307674698711875e-13, 1220.042208755886},
                 {50, 2.404819998970499e-13, 1225.999382849229},  {60, 2.550439987501015e-13, 1236.320030483538},
                 {70, 2.749784516401654e-13, 1251.318329084268},  {80, 3.0065566314489e-13, 1270.963454939832},
                 {90, 3.323202644034574e-13, 1294.913802828757}};
    AirPlace place = north;
    place.altitude = 650e3;
    for (const auto &row : table) {
        place.latitude = degree * row.latitude;
        const AirComposition air = met(place, activity());
        EXPECT_NEAR(air.temperature, row.temperature, 1e-7 * row.temperature) << row.latitude;
        EXPECT_NEAR(air.density, row.density, 3e-7 * row.density) << row.latitude;
    }
}

TEST(MET, HasThePublishedSpecies)
{
    const struct {
        double km;
        AirSpecies species; // He, O, N2, O2, Ar, H
    } table[] = {
        {150, {17030677509583.68, 1.710457620646976e16, 3.477688567239032e16, 4523878254126167.0, 97325671676129.27}},
        {400, {4777496281352.013, 215210767316364.1, 23429144945270.24, 1154126536031.834, 3579390722.311786}},
        {450, {4234283672817.626, 108988521004858.9, 7135945749288.819, 296958276854.1871, 657872824.0755343}},
        {500, {7256388361374.8, 55916251559669.77, 2220892243729.351, 78299513643.78349, 124615261.2176263}},
        {1000,
         {1558579820123.181, 119992172029.7776, 47351078.9756294, 361550.6766713494, 27.21433032310129,
          5411492165.409597}}};
    constexpr double AirSpecies::*all[] = {&AirSpecies::He, &AirSpecies::O,  &AirSpecies::N2,
                                           &AirSpecies::O2, &AirSpecies::Ar, &AirSpecies::H};
    AirPlace place = north;
    for (const auto &row : table) {
        place.altitude = 1e3 * row.km;
        const AirComposition air = met(place, activity());
        for (const auto n : all) {
            EXPECT_NEAR(air.species.*n, row.species.*n, 5e-7 * row.species.*n) << row.km;
        }
    }
    place.altitude = 400e3; // where the law changes no density after their sum
    EXPECT_NEAR(met(place, activity()).molar_mass, 16.99179096343797e-3, 1e-9);
}

TEST(MET, FollowsFluxAndStorms)
{
    // Jacchia 1970, equations 14 and 20. Between two places of one instant differs what is in proportion to the minimum
    // of the night.
    const auto exosphere = [](const AirPlace &place, double F107, double mean, double ap) {
        return met(place, activity(F107, mean, ap)).exosphere;
    };
    const auto spread = [&](double F107, double mean) {
        return exosphere(at(400.0, -60.0, 180.0, north.mjd), F107, mean, 4.0) - exosphere(north, F107, mean, 4.0);
    };
    const auto night = [](double F107, double mean) { return 383.0 + 3.32 * mean + 1.80 * (F107 - mean); };
    EXPECT_NEAR(spread(90.0, 100.0) / spread(230.0, 200.0), night(90.0, 100.0) / night(230.0, 200.0), 1e-9);
    EXPECT_NEAR(exosphere(north, 150.0, 150.0, 30.0) - exosphere(north, 150.0, 150.0, 0.0),
                30.0 + 100.0 * (1.0 - std::exp(-2.4)), 1e-9);
}

TEST(MET, MovesHeliumToTheWinter)
{
    // Jacchia 1971, equation 25, at the solstices.
    const struct {
        double mjd;
        int day;
        double latitude, logarithm;
    } table[] = {{55002.5, 172, 90.0, -0.35355},
                 {55002.5, 172, 30.0, 0.125 - 0.35355},

                 {55002.5, 172, -90.0, 1.0 - 0.35355},
                 {55185.5, 355, 90.0, 1.0 - 0.35355},
                 {55185.5, 355, -90.0, -0.35355}};
    for (const auto &row : table) {
        AirPlace place = at(700.0, row.latitude, 0.0, row.mjd);
        place.day_of_year = row.day;
        const AirComposition air = met(place, activity());
        const double uniform = JacchiaAir(air.exosphere).species(700.0, 2.1926e-5, 0.0093432).He;
        EXPECT_NEAR(std::log10(air.species.He / uniform), 0.65 * row.logarithm, 1e-3) << row.mjd << row.latitude;
    }
}

TEST(MET, IsInHydrostaticEquilibrium)
{
    // Between the seasons' changes below 170 km and above 440 km; helium has thermal diffusion, 1e-3 of all.
    AirPlace place = north;
    const auto air = [&](double km) {
        place.altitude = 1e3 * km;
        return met(place, activity());
    };
    const auto pressure = [&](double km) {
        const AirComposition here = air(km);
        return here.density / here.molar_mass * 8.31432 * here.temperature;
    };
    for (double km = 171.0; km < 439.0; km += 3.7) {
        const double h = 0.05, r = 1.0 + km / 6356.766;
        const double slope = (pressure(km + h) - pressure(km - h)) / (2e3 * h);
        EXPECT_NEAR(slope / (air(km).density * 9.80665 / (r * r)), -1.0, 1e-3) << km;
    }
}

TEST(MET, FallsAndJoins)
{
    AirPlace place = cape;
    place.altitude = 90e3;
    double last = met(place, activity()).density;
    for (double km = 90.01; km < 2500.0; km += 0.01 + 1e-4 * km) {
        place.altitude = 1e3 * km;
        const double density = met(place, activity()).density;
        ASSERT_LT(density, last) << km;
        ASSERT_GT(density, 0.98 * last) << km;
        last = density;
    }
    place.altitude = 0.0;
    const double below = met(place, activity()).density;
    place.altitude = 90e3;
    EXPECT_EQ(below, met(place, activity()).density);
}

} // namespace met_test
} // namespace fledge::world
