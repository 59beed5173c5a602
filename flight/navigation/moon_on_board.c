/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/moon_on_board.h"

#include <string.h>

#include "flight/navigation/ecliptic.h"

enum { MOON_TERMS = 25, MOON_LATITUDES = 13 };

void moon_on_board_reset(MoonOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* Sine and cosine of the sum of four angles, each so many times as the multiples say. */
static void moon_sincos(const double *multiples, const double *angles, double *s, double *c)
{
    double x = 0.0;
    for (int i = 0; i < 4; i++) {
        x += multiples[i] * angles[i];
    }
    fm_sincos(x * ECLIPTIC_DEG, s, c);
}

/* [m] T centuries after J2000, N components. */
static Vec3 moon_place(double T)
{
    /* Multiples of D, M, M', F; sine in the longitude [1e-6 deg]; cosine in the distance [m]. */
    static const double terms[MOON_TERMS][6] = {
        {0.0, 0.0, 1.0, 0.0, 6288774.0, -20905355.0}, {2.0, 0.0, -1.0, 0.0, 1274027.0, -3699111.0},
        {2.0, 0.0, 0.0, 0.0, 658314.0, -2955968.0},   {0.0, 0.0, 2.0, 0.0, 213618.0, -569925.0},
        {0.0, 1.0, 0.0, 0.0, -185116.0, 48888.0},     {0.0, 0.0, 0.0, 2.0, -114332.0, -3149.0},
        {2.0, 0.0, -2.0, 0.0, 58793.0, 246158.0},     {2.0, -1.0, -1.0, 0.0, 57066.0, -152138.0},
        {2.0, 0.0, 1.0, 0.0, 53322.0, -170733.0},     {2.0, -1.0, 0.0, 0.0, 45758.0, -204586.0},
        {0.0, 1.0, -1.0, 0.0, -40923.0, -129620.0},   {1.0, 0.0, 0.0, 0.0, -34720.0, 108743.0},
        {0.0, 1.0, 1.0, 0.0, -30383.0, 104755.0},     {2.0, 0.0, 0.0, -2.0, 15327.0, 10321.0},
        {0.0, 0.0, 1.0, 2.0, -12528.0, 0.0},          {0.0, 0.0, 1.0, -2.0, 10980.0, 79661.0},
        {4.0, 0.0, -1.0, 0.0, 10675.0, -34782.0},     {0.0, 0.0, 3.0, 0.0, 10034.0, -23210.0},
        {4.0, 0.0, -2.0, 0.0, 8548.0, -21636.0},      {2.0, 1.0, -1.0, 0.0, -7888.0, 24208.0},
        {2.0, 1.0, 0.0, 0.0, -6766.0, 30824.0},       {1.0, 0.0, -1.0, 0.0, -5163.0, -8379.0},
        {1.0, 1.0, 0.0, 0.0, 4987.0, -16675.0},       {2.0, -1.0, 1.0, 0.0, 4036.0, -12831.0},
        {2.0, 0.0, 2.0, 0.0, 3994.0, -10445.0}};
    /* Multiples of D, M, M', F; sine in the latitude [1e-6 deg]. */
    static const double latitudes[MOON_LATITUDES][5] = {
        {0.0, 0.0, 0.0, 1.0, 5128122.0}, {0.0, 0.0, 1.0, 1.0, 280602.0}, {0.0, 0.0, 1.0, -1.0, 277693.0},
        {2.0, 0.0, 0.0, -1.0, 173237.0}, {2.0, 0.0, -1.0, 1.0, 55413.0}, {2.0, 0.0, -1.0, -1.0, 46271.0},
        {2.0, 0.0, 0.0, 1.0, 32573.0},   {0.0, 0.0, 2.0, 1.0, 17198.0},  {2.0, 0.0, 1.0, -1.0, 9266.0},
        {0.0, 0.0, 2.0, -1.0, 8822.0},   {2.0, -1.0, 0.0, -1.0, 8216.0}, {2.0, 0.0, -2.0, -1.0, 4324.0},
        {2.0, 0.0, 1.0, 1.0, 4200.0}};
    const double angles[4] = {
        297.8501921 + T * (445267.1114034 - T * 0.0018819), 357.5291092 + T * (35999.0502909 - T * 0.0001536),
        134.9633964 + T * (477198.8675055 + T * 0.0087414), 93.2720950 + T * (483202.0175233 - T * 0.0036539)};
    const double L = 218.3164477 + T * (481267.88123421 - T * 0.0015786);
    double longitude = 0.0, latitude = 0.0, r = 385000560.0, s, c;
    for (int k = 0; k < MOON_TERMS; k++) {
        moon_sincos(terms[k], angles, &s, &c);
        longitude += terms[k][4] * s;
        r += terms[k][5] * c;
    }
    for (int k = 0; k < MOON_LATITUDES; k++) {
        moon_sincos(latitudes[k], angles, &s, &c);
        latitude += latitudes[k][4] * s;
    }
    return ecliptic_to_N(T, (L + 1e-6 * longitude) * ECLIPTIC_DEG, 1e-6 * latitude * ECLIPTIC_DEG, r);
}

void moon_on_board_update(MoonOnBoard *m, Tick t)
{
    Vec3 places[3];
    for (int k = 0; k < 3; k++) {
        places[k] = moon_place(ecliptic_centuries(earth_days(m->in.time.time), k - 1));
    }
    ecliptic_put(&m->out.moon, m->in.time, t, places);
}
