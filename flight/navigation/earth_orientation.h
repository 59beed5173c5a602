/* SPDX-License-Identifier: Apache-2.0 */
/* How the Earth is turned relative to N, the mean equator and equinox of J2000, by the theories of 1976 to 1982:
 *     [TEME N] = R3(dpsi cos eps) R1(-eps - deps) R3(-dpsi) R1(eps) R3(-z) R2(theta) R3(-zeta)
 *     [PN] = R3(GMST) [TEME N]
 * with the precession IAU 1976 (zeta, theta, z), the obliquity eps, 13 of the 106 terms of the nutation IAU 1980 (dpsi,
 * deps), and the mean sidereal time of 1982, of UT1. TEME, true equator and mean equinox, is the frame of SGP4.
 *
 * Time is `days`, UTC since 2000-01-01T12:00:00, of 86,400 s. TT - UTC is taken as 69.184 s, as from 2017 on: 40 s more
 * or less turn the axes by 6e-5 arcsec.
 *
 * Against the whole theories: the nutation's other terms, 0.03 arcsec, and two small ones of the equation of the
 * equinoxes, 0.003 arcsec. Against the Earth itself, besides: the measured offsets of the pole from IAU 1980 (0.1
 * arcsec) and of GCRF from J2000 (0.02 arcsec), the polar motion (0.5 arcsec), and UT1 - UTC, 15 arcsec a second.
 * On the ground an arcsecond is 31 m.
 * Source: Lieske and others 1977; Seidelmann 1982; Aoki and others 1982; Vallado, section 3.7. */
#ifndef FLIGHT_NAVIGATION_EARTH_ORIENTATION_H
#define FLIGHT_NAVIGATION_EARTH_ORIENTATION_H

#include <stdint.h>

#include "flight/math/vec.h"

#define EARTH_RATE 7.292115146706979e-5 /* [rad/s] about the pole, relative to N */
#define EARTH_ARCSEC 4.848136811095360e-6
#define EARTH_TT_UTC 69.184 /* [s] */

/** [d] The days of a time in nanoseconds. */
static inline double earth_days(int64_t ns)
{
    return (double)ns / 86400e9;
}

/** Whether theories of the Earth, the Sun and the Moon on board are as good as they say: from 2000 to 2050. */
static inline int earth_known(double days)
{
    return days >= -0.5 && days < 18262.5;
}

/** [-] Julian centuries of TT since J2000. */
static inline double earth_centuries(double days)
{
    return (days + EARTH_TT_UTC / 86400.0) / 36525.0;
}

/** A turn of the axes about the first one. */
static inline Mat3 earth_R1(double angle)
{
    double s, c;
    fm_sincos(angle, &s, &c);
    return (Mat3){{{1.0, 0.0, 0.0}, {0.0, c, s}, {0.0, -s, c}}};
}

/** A turn of the axes about the second one. */
static inline Mat3 earth_R2(double angle)
{
    double s, c;
    fm_sincos(angle, &s, &c);
    return (Mat3){{{c, 0.0, -s}, {0.0, 1.0, 0.0}, {s, 0.0, c}}};
}

/** A turn of the axes about the third one. */
static inline Mat3 earth_R3(double angle)
{
    double s, c;
    fm_sincos(angle, &s, &c);
    return (Mat3){{{c, s, 0.0}, {-s, c, 0.0}, {0.0, 0.0, 1.0}}};
}

/** From N to the mean equator and equinox of date, T centuries after J2000. */
static inline Mat3 earth_precession(double T)
{
    const double zeta = T * (2306.2181 + T * (0.30188 + T * 0.017998));
    const double theta = T * (2004.3109 - T * (0.42665 + T * 0.041833));
    const double z = T * (2306.2181 + T * (1.09468 + T * 0.018203));
    return mat_mul(earth_R3(-z * EARTH_ARCSEC),
                   mat_mul(earth_R2(theta * EARTH_ARCSEC), earth_R3(-zeta * EARTH_ARCSEC)));
}

/** [rad] The mean obliquity of the ecliptic of date. */
static inline double earth_obliquity(double T)
{
    return (84381.448 - T * (46.8150 + T * (0.00059 - T * 0.001813))) * EARTH_ARCSEC;
}

/** [rad] The nutation in longitude, dpsi, and in obliquity, deps. */
static inline void earth_nutation(double T, double *dpsi, double *deps)
{
    /* Multiples of l, l', F, D and the node; sine [0.1 mas], and a century; cosine [0.1 mas], and a century. */
    static const double terms[13][9] = {{0.0, 0.0, 0.0, 0.0, 1.0, -171996.0, -174.2, 92025.0, 8.9},
                                        {0.0, 0.0, 0.0, 0.0, 2.0, 2062.0, 0.2, -895.0, 0.5},
                                        {0.0, 0.0, 2.0, -2.0, 2.0, -13187.0, -1.6, 5736.0, -3.1},
                                        {0.0, 1.0, 0.0, 0.0, 0.0, 1426.0, -3.4, 54.0, -0.1},
                                        {0.0, 1.0, 2.0, -2.0, 2.0, -517.0, 1.2, 224.0, -0.6},
                                        {0.0, -1.0, 2.0, -2.0, 2.0, 217.0, -0.5, -95.0, 0.3},
                                        {0.0, 0.0, 2.0, -2.0, 1.0, 129.0, 0.1, -70.0, 0.0},
                                        {0.0, 0.0, 2.0, 0.0, 2.0, -2274.0, -0.2, 977.0, -0.5},
                                        {1.0, 0.0, 0.0, 0.0, 0.0, 712.0, 0.1, -7.0, 0.0},
                                        {0.0, 0.0, 2.0, 0.0, 1.0, -386.0, -0.4, 200.0, 0.0},
                                        {1.0, 0.0, 2.0, 0.0, 2.0, -301.0, 0.0, 129.0, -0.1},
                                        {1.0, 0.0, 0.0, -2.0, 0.0, -158.0, 0.0, -1.0, 0.0},
                                        {-1.0, 0.0, 2.0, 0.0, 2.0, 123.0, 0.0, -53.0, 0.0}};
    /* The anomalies of Moon and Sun, the Moon's argument of latitude, its elongation, its node [arcsec]. */
    const double arguments[5] = {
        485866.733 + T * (1717915922.633 + T * 31.310), 1287099.804 + T * (129596581.224 - T * 0.577),
        335778.877 + T * (1739527263.137 - T * 13.257), 1072261.307 + T * (1602961601.328 - T * 6.891),
        450160.280 - T * (6962890.539 - T * 7.455)};
    *dpsi = 0.0;
    *deps = 0.0;
    for (int k = 0; k < 13; k++) {
        const double *term = terms[k];
        double angle = 0.0, s, c;
        for (int i = 0; i < 5; i++) {
            angle += term[i] * arguments[i];
        }
        fm_sincos(angle * EARTH_ARCSEC, &s, &c);
        *dpsi += (term[5] + T * term[6]) * s;
        *deps += (term[7] + T * term[8]) * c;
    }
    *dpsi *= 1e-4 * EARTH_ARCSEC;
    *deps *= 1e-4 * EARTH_ARCSEC;
}

/** [rad] The mean sidereal time of Greenwich, of days of UT1. */
static inline double earth_sidereal_time(double days)
{
    const double T = days / 36525.0;
    const double seconds = 67310.54841 + T * (8640184.812866 + T * (0.093104 - T * 6.2e-6));
    return 6.283185307179586 * (days + seconds / 86400.0);
}

/** [TEME N] From N to the true equator and mean equinox of date. */
static inline Mat3 earth_teme(double days)
{
    double dpsi, deps;
    const double T = earth_centuries(days), eps = earth_obliquity(T);
    earth_nutation(T, &dpsi, &deps);
    const Mat3 ecliptic = mat_mul(earth_R3(-dpsi), mat_mul(earth_R1(eps), earth_precession(T)));
    return mat_mul(earth_R3(dpsi * fm_cos(eps)), mat_mul(earth_R1(-eps - deps), ecliptic));
}

/** [PN] From N to axes that are fixed in the Earth, where UT1 is UTC + dut1 [s]. */
static inline Mat3 earth_dcm_PN_ut1(double days, double dut1)
{
    return mat_mul(earth_R3(earth_sidereal_time(days + dut1 / 86400.0)), earth_teme(days));
}

/** [PN] From N to axes that are fixed in the Earth, where UT1 is UTC. */
static inline Mat3 earth_dcm_PN(double days)
{
    return earth_dcm_PN_ut1(days, 0.0);
}

/** [rad/s] The rate of axes fixed in the Earth relative to N, N components: about the pole. */
static inline Vec3 earth_omega_PN_N(Mat3 dcm_PN)
{
    return vec_scale(EARTH_RATE, vec3(dcm_PN.m[2][0], dcm_PN.m[2][1], dcm_PN.m[2][2]));
}

#endif
