/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/sun_on_board.h"

#include <string.h>

#include "flight/navigation/ecliptic.h"

#define SUN_AU 149597870700.0 /* [m] */

void sun_on_board_reset(SunOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* [m] T centuries after J2000, N components. */
static Vec3 sun_place(double T)
{
    /* The perturbations by planets and the Moon: argument [deg], and its change a century; factor of its cosine in the
     * longitude [1e-5 deg], and of its sine in the distance [1e-8 AU]. */
    static const double terms[9][4] = {
        {207.85, 445267.11, 179.7, -3084.0}, {157.23, 32964.47, 200.4, 1628.0}, {253.14, 45036.88, 153.3, 1576.0},
        {351.52, 22518.44, 134.2, 542.0},    {42.54, 65928.94, 75.9, 925.0},    {162.08, 20.19, 195.8, 0.0},
        {116.72, 3034.91, 72.9, 0.0},        {63.58, 9037.51, 68.7, 0.0},       {299.83, 33718.13, 56.7, 0.0}};
    double s1, c1, s2, c2, s, c;
    const double L = 280.46646 + T * (36000.76983 + T * 0.0003032);
    const double M = 357.52911 + T * (35999.05029 - T * 0.0001537);
    const double e = 0.016708634 - T * (0.000042037 + T * 0.0000001267);
    fm_sincos(M * ECLIPTIC_DEG, &s1, &c1);
    fm_sincos(2.0 * M * ECLIPTIC_DEG, &s2, &c2);
    const double s3 = s1 * c2 + c1 * s2;
    const double centre =
        (1.914602 - T * (0.004817 + T * 0.000014)) * s1 + (0.019993 - T * 0.000101) * s2 + 0.000289 * s3;
    double longitude = L + centre;
    double r = 1.000001018 * (1.0 - e * e) / (1.0 + e * fm_cos((M + centre) * ECLIPTIC_DEG));
    for (int k = 0; k < 9; k++) {
        fm_sincos((terms[k][0] + T * terms[k][1]) * ECLIPTIC_DEG, &s, &c);
        longitude += 1e-5 * terms[k][2] * c;
        r += 1e-8 * terms[k][3] * s;
    }
    return ecliptic_to_N(T, longitude * ECLIPTIC_DEG, 0.0, r * SUN_AU);
}

void sun_on_board_update(SunOnBoard *m, Tick t)
{
    Vec3 places[3];
    for (int k = 0; k < 3; k++) {
        places[k] = sun_place(ecliptic_centuries(earth_days(m->in.time.time), k - 1));
    }
    ecliptic_put(&m->out.sun, m->in.time, t, places);
}
