/* SPDX-License-Identifier: Apache-2.0 */
/* In the names, w is the argument of perigee, O the node, L the mean longitude. Arrays of five elements hold e, i, M, w
 * and O. */
#include "flight/navigation/sgp4.h"

#include <string.h>

#include "flight/navigation/earth_orientation.h"

#define TURN 6.283185307179586
#define STEP 43200.0                         /* [s] of the resonance */
#define SPIN (4.37526908801129966e-3 / 60.0) /* [rad/s] the Earth's, as the theory has it */

/* Sun and Moon: rates of their mean anomalies [rad/s], eccentricities, and the strengths of their pulls [rad/s]. */
static const double rates[2] = {1.19459e-5 / 60.0, 1.5835218e-4 / 60.0};
static const double eccentricities[2] = {0.01675, 0.05490};
static const double strengths[2] = {2.9864797e-6 / 60.0, 4.7968065e-7 / 60.0};

/* Angles of the resonance, k angle + j w - phase: three of a day, then ten of half a day. */
static const double angles[13][3] = {{1.0, 0.0, 0.13130908},  {2.0, 0.0, 5.7686396},  {3.0, 0.0, 1.12344261},
                                     {1.0, 2.0, 5.7686396},   {1.0, 0.0, 5.7686396},  {1.0, 1.0, 0.95240898},
                                     {1.0, -1.0, 0.95240898}, {2.0, 2.0, 1.8014998},  {2.0, 0.0, 1.8014998},
                                     {1.0, 1.0, 1.0508330},   {1.0, -1.0, 1.0508330}, {2.0, 1.0, 4.4108898},
                                     {2.0, -1.0, 4.4108898}};

/* [rad/s] The mean motion at a distance of an Earth radius. */
static double surface_motion(void)
{
    return fm_sqrt(SGP4_MU / (SGP4_RADIUS * SGP4_RADIUS * SGP4_RADIUS));
}

static double semi_major_axis(double n)
{
    return fm_exp(fm_log(surface_motion() / n) * (2.0 / 3.0));
}

/* An angle without its whole turns, of the same sign. */
static double wrapped(double x)
{
    const double turns = x / TURN;
    return isfinite(turns) && turns > -1e15 && turns < 1e15 ? x - TURN * (double)(int64_t)turns : NAN;
}

static double cubic(double x, double c0, double c1, double c2, double c3)
{
    return c0 + x * (c1 + x * (c2 + x * c3));
}

/* The inclination below which, also from the other pole, Sun and Moon do not move the node. */
static int flat(double i)
{
    return i < 5.2359877e-2 || i > 0.5 * TURN - 5.2359877e-2;
}

/* The pull of body k, 0 the Sun, 1 the Moon, in whose orbit g is the argument of perigee, i the inclination, and h the
 * node from the satellite's: g[0] is the sine, g[1] the cosine. */
static void third_body(Sgp4 *s, int k, const double g[2], const double i[2], const double h[2])
{
    const Sgp4Elements *el = &s->elements;
    double si, ci, sw, cw;
    fm_sincos(el->i, &si, &ci);
    fm_sincos(el->periapsis, &sw, &cw);
    /* The directions to the body's perigee, a, and 90 degrees ahead, b: along the satellite's node, ahead in its plane,
     * and along its normal. */
    const Vec3 p = vec3(g[1] * h[1] + g[0] * i[1] * h[0], g[0] * i[1] * h[1] - g[1] * h[0], g[0] * i[0]);
    const Vec3 q = vec3(g[1] * i[1] * h[0] - g[0] * h[1], g[0] * h[0] + g[1] * i[1] * h[1], g[1] * i[0]);
    const double a[3] = {p.v[0], ci * p.v[1] + si * p.v[2], ci * p.v[2] - si * p.v[1]};
    const double b[3] = {q.v[0], ci * q.v[1] + si * q.v[2], ci * q.v[2] - si * q.v[1]};
    /* The same from the satellite's perigee. */
    const double x1 = a[0] * cw + a[1] * sw, x3 = a[1] * cw - a[0] * sw, x5 = a[2] * sw, x7 = a[2] * cw;
    const double x2 = b[0] * cw + b[1] * sw, x4 = b[1] * cw - b[0] * sw, x6 = b[2] * sw, x8 = b[2] * cw;

    const double e2 = el->e * el->e, b2 = 1.0 - e2;
    const double z31 = 12.0 * x1 * x1 - 3.0 * x3 * x3, z32 = 24.0 * x1 * x2 - 6.0 * x3 * x4;
    const double z33 = 12.0 * x2 * x2 - 3.0 * x4 * x4;
    const double z1 = 6.0 * (a[0] * a[0] + a[1] * a[1]) + (1.0 + e2) * z31;
    const double z2 = 12.0 * (a[0] * b[0] + a[1] * b[1]) + (1.0 + e2) * z32;
    const double z3 = 6.0 * (b[0] * b[0] + b[1] * b[1]) + (1.0 + e2) * z33;
    const double z11 = -6.0 * a[0] * a[2] - e2 * (24.0 * x1 * x7 + 6.0 * x3 * x5);
    const double z12 =
        -6.0 * (a[0] * b[2] + b[0] * a[2]) - e2 * (24.0 * (x2 * x7 + x1 * x8) + 6.0 * (x3 * x6 + x4 * x5));
    const double z13 = -6.0 * b[0] * b[2] - e2 * (24.0 * x2 * x8 + 6.0 * x4 * x6);
    const double z21 = 6.0 * a[1] * a[2] + e2 * (24.0 * x1 * x5 - 6.0 * x3 * x7);
    const double z22 =
        6.0 * (b[1] * a[2] + a[1] * b[2]) + e2 * (24.0 * (x2 * x5 + x1 * x6) - 6.0 * (x4 * x7 + x3 * x8));
    const double z23 = 6.0 * b[1] * b[2] + e2 * (24.0 * x2 * x6 - 6.0 * x4 * x8);

    const double s3 = strengths[k] / s->n, s2 = -0.5 * s3 / fm_sqrt(b2), s4 = s3 * fm_sqrt(b2), s1 = -15.0 * el->e * s4;
    const double s5 = x1 * x3 + x2 * x4, s6 = x2 * x3 + x1 * x4, s7 = x2 * x4 - x1 * x3;
    const double ecc = eccentricities[k];
    const double periodic[5][3] = {
        {2.0 * s1 * s6, 2.0 * s1 * s7, 0.0},
        {2.0 * s2 * z12, 2.0 * s2 * (z13 - z11), 0.0},
        {-2.0 * s3 * z2, -2.0 * s3 * (z3 - z1), 2.0 * s3 * (21.0 + 9.0 * e2) * ecc},
        {2.0 * s4 * z32, 2.0 * s4 * (z33 - z31), -18.0 * s4 * ecc},
        {-2.0 * s2 * z22, -2.0 * s2 * (z23 - z21), 0.0},
    };
    memcpy(s->periodic[k], periodic, sizeof periodic);

    const double node = flat(el->i) ? 0.0 : -s2 * (z21 + z23) / si;
    s->secular[0] += rates[k] * s1 * s5;
    s->secular[1] += rates[k] * s2 * (z11 + z13);
    s->secular[2] -= rates[k] * s3 * (z1 + z3 - 14.0 - 6.0 * e2);
    s->secular[3] += rates[k] * (s4 * (z31 + z33 - 6.0) - ci * node);
    s->secular[4] += rates[k] * node;
}

/* The orbits of Sun and Moon at the epoch, `day` days after 1900 January 0.5. */
static void sun_and_moon(Sgp4 *s, double day)
{
    double node[2], moon[2], c, g[2], i[2], h[2];
    fm_sincos(s->elements.node, &node[0], &node[1]);
    const double sun_g[2] = {-0.98088458, 0.1945905}, sun_i[2] = {0.39785416, 0.91744867};
    third_body(s, 0, sun_g, sun_i, node);
    s->phase[0] = wrapped(6.2565837 + 0.017201977 * day);

    const double ascending = wrapped(4.5236020 - 9.2422029e-4 * day);
    fm_sincos(ascending, &moon[0], &moon[1]);
    i[1] = 0.91375164 - 0.03568096 * moon[1];
    i[0] = fm_sqrt(1.0 - i[1] * i[1]);
    const double sine = 0.089683511 * moon[0] / i[0];
    c = fm_sqrt(1.0 - sine * sine);
    const double perigee = 5.8351514 + 0.0019443680 * day;
    const double along = 0.39785416 * moon[0] / i[0], across = c * moon[1] + 0.91744867 * sine * moon[0];
    fm_sincos(perigee + fm_atan2(along, across) - ascending, &g[0], &g[1]);
    h[1] = c * node[1] + sine * node[0];
    h[0] = c * node[0] - sine * node[1];
    third_body(s, 1, g, i, h);
    s->phase[1] = wrapped(4.7199672 + 0.22997150 * day - perigee);
}

/* The functions G of the eccentricity for the resonance of half a day: 211, 310, 322, 410, 422, 520, 533, 521, 532. */
static void eccentricity_functions(double e, double G[9])
{
    if (e <= 0.65) {
        G[0] = cubic(e, 3.616, -13.2470, 16.2900, 0.0);
        G[1] = cubic(e, -19.302, 117.3900, -228.4190, 156.5910);
        G[2] = cubic(e, -18.9068, 109.7927, -214.6334, 146.5816);
        G[3] = cubic(e, -41.122, 242.6940, -471.0940, 313.9530);
        G[4] = cubic(e, -146.407, 841.8800, -1629.014, 1083.4350);
        G[5] = cubic(e, -532.114, 3017.977, -5740.032, 3708.2760);
    } else {
        G[0] = cubic(e, -72.099, 331.819, -508.738, 266.724);
        G[1] = cubic(e, -346.844, 1582.851, -2415.925, 1246.113);
        G[2] = cubic(e, -342.585, 1554.908, -2366.899, 1215.972);
        G[3] = cubic(e, -1052.797, 4758.686, -7193.992, 3651.957);
        G[4] = cubic(e, -3581.690, 16178.110, -24462.770, 12422.520);
        G[5] =
            e > 0.715 ? cubic(e, -5149.66, 29936.92, -54087.36, 31324.56) : cubic(e, 1464.74, -4664.75, 3763.64, 0.0);
    }
    if (e < 0.7) {
        G[6] = cubic(e, -919.22770, 4988.6100, -9064.7700, 5542.21);
        G[7] = cubic(e, -822.71072, 4568.6173, -8491.4146, 5337.524);
        G[8] = cubic(e, -853.66600, 4690.2500, -8624.7700, 5341.4);
    } else {
        G[6] = cubic(e, -37995.780, 161616.52, -229838.20, 109377.94);
        G[7] = cubic(e, -51752.104, 218913.95, -309468.16, 146349.42);
        G[8] = cubic(e, -40023.880, 170470.89, -242699.48, 115605.82);
    }
}

/* The tesseral harmonics with which the orbit's period resonates, if any. */
static void tesseral(Sgp4 *s)
{
    const Sgp4Elements *el = &s->elements;
    const double e = el->e, e2 = e * e, ia = 1.0 / semi_major_axis(s->n);
    double si, c;
    fm_sincos(el->i, &si, &c);
    const double c2 = c * c, s2 = si * si, k = 3.0 * s->n * s->n * ia * ia;
    double *A = s->tesseral;
    if (s->n > 0.0034906585 / 60.0 && s->n < 0.0052359877 / 60.0) {
        s->resonance = 1u;
        const double F311 = 0.9375 * s2 * (1.0 + 3.0 * c) - 0.75 * (1.0 + c);
        A[0] = k * ia * F311 * (1.0 + 2.0 * e2) * 2.1460748e-6;
        A[1] = 2.0 * k * 0.75 * (1.0 + c) * (1.0 + c) * (1.0 + e2 * (-2.5 + 0.8125 * e2)) * 1.7891679e-6;
        A[2] = 3.0 * k * ia * 1.875 * (1.0 + c) * (1.0 + c) * (1.0 + c) * (1.0 + e2 * (-6.0 + 6.60937 * e2)) *
               2.2123015e-7;
        s->angle0 = el->M + el->node + el->periapsis - s->theta;
        s->dangle = s->dM + s->dperiapsis + s->dnode - SPIN + s->secular[2] + s->secular[3] + s->secular[4] - s->n;
    } else if (s->n >= 8.26e-3 / 60.0 && s->n <= 9.24e-3 / 60.0 && e >= 0.5) {
        s->resonance = 2u;
        double G[9];
        eccentricity_functions(e, G);
        const double F220 = 0.75 * (1.0 + 2.0 * c + c2);
        const double F522 = 9.84375 * si * (s2 * (1.0 - 2.0 * c - 5.0 * c2) + 0.33333333 * (-2.0 + 4.0 * c + 6.0 * c2));
        const double F523 =
            si * (4.92187512 * s2 * (-2.0 - 4.0 * c + 10.0 * c2) + 6.56250012 * (1.0 + 2.0 * c - 3.0 * c2));
        const double F542 = 29.53125 * si * (2.0 - 8.0 * c + c2 * (-12.0 + 8.0 * c + 10.0 * c2));
        const double F543 = 29.53125 * si * (-2.0 - 8.0 * c + c2 * (12.0 + 8.0 * c - 10.0 * c2));
        const double k22 = k * 1.7891679e-6, k32 = k * ia * 3.7393792e-7, k44 = 2.0 * k * ia * ia * 7.3636953e-9;
        const double k52 = k * ia * ia * ia * 1.1428639e-7, k54 = 2.0 * k * ia * ia * ia * 2.1765803e-9;
        A[0] = k22 * F220 * (-0.306 - (e - 0.64) * 0.440);
        A[1] = k22 * 1.5 * s2 * G[0];
        A[2] = k32 * 1.875 * si * (1.0 - 2.0 * c - 3.0 * c2) * G[1];
        A[3] = -k32 * 1.875 * si * (1.0 + 2.0 * c - 3.0 * c2) * G[2];
        A[4] = k44 * 35.0 * s2 * F220 * G[3];
        A[5] = k44 * 39.3750 * s2 * s2 * G[4];
        A[6] = k52 * F522 * G[5];
        A[7] = k52 * F523 * G[8];
        A[8] = k54 * F542 * G[7];
        A[9] = k54 * F543 * G[6];
        s->angle0 = el->M + 2.0 * (el->node - s->theta);
        s->dangle = s->dM + s->secular[2] + 2.0 * (s->dnode + s->secular[4] - SPIN) - s->n;
    }
}

/* The rates by the zonal harmonics, and the drag. */
static void near_earth(Sgp4 *s, double a)
{
    const Sgp4Elements *el = &s->elements;
    const double e = el->e, e2 = e * e, b2 = 1.0 - e2, b = fm_sqrt(b2), n = s->n;
    double si, c, sw, cw, cM;
    fm_sincos(el->i, &si, &c);
    fm_sincos(el->periapsis, &sw, &cw);
    fm_sincos(el->M, &s->sine, &cM);
    const double c2 = c * c, c4 = c2 * c2, p = a * b2, J3J2 = SGP4_J3 / SGP4_J2;

    /* Below 156 km, the air is another. */
    const double perigee = a * (1.0 - e), height = (perigee - 1.0) * SGP4_RADIUS;
    double base = 78e3;
    if (height < 156e3) {
        base = height < 98e3 ? 20e3 : height - 78e3;
    }
    const double scale = (120e3 - base) / SGP4_RADIUS, bottom = base / SGP4_RADIUS + 1.0;

    const double xi = 1.0 / (a - bottom), eta = a * e * xi, eta2 = eta * eta, eeta = e * eta;
    const double psi2 = fm_abs(1.0 - eta2), psi7 = psi2 * psi2 * psi2 * fm_sqrt(psi2);
    const double q4 = scale * scale * scale * scale, q = q4 * xi * xi * xi * xi, k = q / psi7;
    const double C2 = k * n *
                      (a * (1.0 + 1.5 * eta2 + eeta * (4.0 + eta2)) +
                       0.375 * SGP4_J2 * xi / psi2 * (3.0 * c2 - 1.0) * (8.0 + 3.0 * eta2 * (8.0 + eta2)));
    const double C1 = el->bstar * C2;
    const double C3 = e > 1e-4 ? -2.0 * q * xi * J3J2 * n * si / e : 0.0;
    const double C4 = 2.0 * n * k * a * b2 *
                      (eta * (2.0 + 0.5 * eta2) + e * (0.5 + 2.0 * eta2) -
                       SGP4_J2 * xi / (a * psi2) *
                           (-3.0 * (3.0 * c2 - 1.0) * (1.0 - 2.0 * eeta + eta2 * (1.5 - 0.5 * eeta)) +
                            0.75 * (1.0 - c2) * (2.0 * eta2 - eeta * (1.0 + eta2)) * (cw * cw - sw * sw)));

    const double h1 = 1.5 * SGP4_J2 * n / (p * p), h2 = 0.5 * h1 * SGP4_J2 / (p * p);
    const double h4 = -0.46875 * SGP4_J4 * n / (p * p * p * p);
    s->dM = n + 0.5 * h1 * b * (3.0 * c2 - 1.0) + 0.0625 * h2 * b * (13.0 - 78.0 * c2 + 137.0 * c4);
    s->dperiapsis = -0.5 * h1 * (1.0 - 5.0 * c2) + 0.0625 * h2 * (7.0 - 114.0 * c2 + 395.0 * c4) +
                    h4 * (3.0 - 36.0 * c2 + 49.0 * c4);
    s->dnode = c * (-h1 + 0.5 * h2 * (4.0 - 19.0 * c2) + 2.0 * h4 * (3.0 - 7.0 * c2));
    s->ddnode = -3.5 * b2 * h1 * c * C1;
    s->A[0] = C1;
    s->L[0] = 1.5 * C1;
    s->e1 = el->bstar * C4;
    s->eta = eta;
    const double bulge = 1.0 + eta * cM;
    s->cube = bulge * bulge * bulge;
    if (s->deep != 0u || perigee < 220e3 / SGP4_RADIUS + 1.0) {
        return; /* the other terms of the drag are left out */
    }
    const double D2 = 4.0 * a * xi * C1 * C1, d = D2 * xi * C1 / 3.0, D3 = (17.0 * a + bottom) * d;
    const double D4 = 0.5 * d * a * xi * (221.0 * a + 31.0 * bottom) * C1;
    s->A[1] = D2;
    s->A[2] = D3;
    s->A[3] = D4;
    s->L[1] = D2 + 2.0 * C1 * C1;
    s->L[2] = 0.25 * (3.0 * D3 + C1 * (12.0 * D2 + 10.0 * C1 * C1));
    s->L[3] = 0.2 * (3.0 * D4 + 12.0 * C1 * D3 + 6.0 * D2 * D2 + 15.0 * C1 * C1 * (2.0 * D2 + C1 * C1));
    s->e2 = el->bstar * 2.0 * k * a * b2 * (1.0 + 2.75 * (eta2 + eeta) + eeta * eta2);
    s->w1 = el->bstar * C3 * cw;
    s->w2 = e > 1e-4 ? -2.0 / 3.0 * q * el->bstar / eeta : 0.0;
}

OrbitElementsCode sgp4_init(Sgp4 *s, Sgp4Elements elements)
{
    memset(s, 0, sizeof *s);
    s->elements = elements;
    if (!(elements.n > 0.0)) {
        return ORBIT_ELEMENTS_MOTION;
    }
    if (!(elements.e >= 0.0 && elements.e < 1.0)) {
        return ORBIT_ELEMENTS_ECCENTRICITY;
    }
    /* Brouwer's mean motion, of Kozai's. */
    const double c = fm_cos(elements.i), b2 = 1.0 - elements.e * elements.e;
    const double a1 = semi_major_axis(elements.n);
    const double k = 0.75 * SGP4_J2 * (3.0 * c * c - 1.0) / (b2 * fm_sqrt(b2)), d1 = k / (a1 * a1);
    const double a0 = a1 * (1.0 - d1 * d1 - d1 * (1.0 / 3.0 + 134.0 * d1 * d1 / 81.0));
    s->n = elements.n / (1.0 + k / (a0 * a0));
    s->deep = TURN / s->n >= 225.0 * 60.0;
    near_earth(s, semi_major_axis(s->n));
    if (s->deep != 0u) {
        const double days = earth_days(elements.epoch);
        s->theta = wrapped(earth_sidereal_time(days));
        sun_and_moon(s, days + 36525.0);
        tesseral(s);
        s->angle = s->angle0;
        s->motion = s->n;
    }
    return ORBIT_ELEMENTS_GOOD;
}

/* The second derivative of the resonant angle, and its derivative in the angle. */
static void resonant_pull(const Sgp4 *s, double *pull, double *slope)
{
    const uint32_t first = s->resonance == 1u ? 0u : 3u, terms = s->resonance == 1u ? 3u : 10u;
    const double w = s->elements.periapsis + s->dperiapsis * s->time;
    *pull = 0.0;
    *slope = 0.0;
    for (uint32_t j = 0u; j < terms; j++) {
        const double *c = angles[first + j];
        double sine, cosine;
        fm_sincos(c[0] * s->angle + c[1] * w - c[2], &sine, &cosine);
        *pull += s->tesseral[j] * sine;
        *slope += s->tesseral[j] * c[0] * cosine;
    }
}

/* Integrate the resonant angle and the mean motion to t, by Taylor's series over steps that begin at the epoch. */
static OrbitElementsCode integrate(Sgp4 *s, double t, double *angle, double *n)
{
    if (!(fm_abs(t) < SGP4_STEPS * STEP)) {
        return ORBIT_ELEMENTS_FAR;
    }
    if (s->time * t <= 0.0 || fm_abs(t) < fm_abs(s->time)) {
        s->time = 0.0;
        s->angle = s->angle0;
        s->motion = s->n;
    }
    /* undecided: the steps of the loop are bounded by the time that is checked before */
    for (int k = 0; k <= SGP4_STEPS; k++) {
        const double left = t - s->time, rate = s->motion + s->dangle;
        double pull, slope;
        resonant_pull(s, &pull, &slope);
        const int last = fm_abs(left) < STEP;
        const double h = last ? left : (left < 0.0 ? -STEP : STEP);
        *angle = s->angle + h * (rate + 0.5 * h * pull);
        *n = s->motion + h * (pull + 0.5 * h * slope * rate);
        if (last) {
            break;
        }
        s->time += h;
        s->angle = *angle;
        s->motion = *n;
    }
    return ORBIT_ELEMENTS_GOOD;
}

/* Add the periodic pull of Sun and Moon at t to e, i, M, w, O, whose order theirs is. Orbits that lie nearly in the
 * equator take it on sin i sin O and sin i cos O, as Lyddane has it. */
static void add_periodic(const Sgp4 *s, double t, double el[5])
{
    double sum[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 2; k++) {
        const double phase = s->phase[k] + rates[k] * t;
        double sf, cf;
        fm_sincos(phase + 2.0 * eccentricities[k] * fm_sin(phase), &sf, &cf);
        for (int j = 0; j < 5; j++) {
            const double *c = s->periodic[k][j];
            sum[j] += c[0] * (0.5 * sf * sf - 0.25) - c[1] * 0.5 * sf * cf + c[2] * sf;
        }
    }
    double si, ci, sO, cO;
    el[0] += sum[0];
    el[1] += sum[1];
    fm_sincos(el[1], &si, &ci);
    if (el[1] >= 0.2) {
        el[2] += sum[2];
        el[3] += sum[3] - ci / si * sum[4];
        el[4] += sum[4] / si;
        return;
    }
    const double node = wrapped(el[4]);
    fm_sincos(node, &sO, &cO);
    const double x = si * sO + sum[4] * cO + sum[1] * ci * sO, y = si * cO - sum[4] * sO + sum[1] * ci * cO;
    const double L = el[2] + el[3] + ci * node + sum[2] + sum[3] - sum[1] * node * si;
    el[4] = fm_atan2(x, y);
    if (fm_abs(node - el[4]) > 0.5 * TURN) {
        el[4] += el[4] < node ? TURN : -TURN;
    }
    el[2] += sum[2];
    el[3] = L - el[2] - ci * el[4];
}

/* Position and velocity of the mean elements at an instant, with the periodic parts by the zonal harmonics: a in Earth
 * radii, n [rad/s], and e, i, M, w, O. */
static OrbitElementsCode osculate(double a, double n, const double el[5], Vec3 *r, Vec3 *v)
{
    const double e = el[0], M = el[2], J3J2 = SGP4_J3 / SGP4_J2;
    double si, c, sw, cw;
    fm_sincos(el[1], &si, &c);
    fm_sincos(el[3], &sw, &cw);
    const double p0 = a * (1.0 - e * e), above = fm_abs(1.0 + c) > 1.5e-12 ? 1.0 + c : 1.5e-12;
    const double axN = e * cw, ayN = e * sw - 0.5 * J3J2 * si / p0;
    const double u0 = wrapped(M + el[3] - 0.25 * J3J2 * si * (3.0 + 5.0 * c) / above * axN / p0);

    double E = u0, sE = 0.0, cE = 1.0;
    for (int k = 0; k < 10; k++) {
        fm_sincos(E, &sE, &cE);
        const double step = (u0 - ayN * cE + axN * sE - E) / (1.0 - cE * axN - sE * ayN);
        E += step > 0.95 ? 0.95 : (step < -0.95 ? -0.95 : step);
        if (fm_abs(step) < 1e-12) {
            break;
        }
    }
    const double ecosE = axN * cE + ayN * sE, esinE = axN * sE - ayN * cE;
    const double eL2 = axN * axN + ayN * ayN, p = a * (1.0 - eL2);
    if (p < 0.0) {
        return ORBIT_ELEMENTS_LATUS;
    }
    const double radius = a * (1.0 - ecosE), b = fm_sqrt(1.0 - eL2), part = esinE / (1.0 + b);
    const double su = a / radius * (sE - ayN - axN * part), cu = a / radius * (cE - axN + ayN * part);
    const double s2u = 2.0 * su * cu, c2u = 1.0 - 2.0 * su * su, c2 = c * c;
    const double k1 = 0.5 * SGP4_J2 / p, k2 = k1 / p, motion = surface_motion();

    const double rk = radius * (1.0 - 1.5 * k2 * b * (3.0 * c2 - 1.0)) + 0.5 * k1 * (1.0 - c2) * c2u;
    const double uk = fm_atan2(su, cu) - 0.25 * k2 * (7.0 * c2 - 1.0) * s2u;
    const double Ok = el[4] + 1.5 * k2 * c * s2u, ik = el[1] + 1.5 * k2 * c * si * c2u;
    const double dr = motion * fm_sqrt(a) * esinE / radius - n * k1 * (1.0 - c2) * s2u;
    const double rdu = motion * fm_sqrt(p) / radius + n * k1 * ((1.0 - c2) * c2u + 1.5 * (3.0 * c2 - 1.0));

    double suk, cuk, sO, cO, sik, cik;
    fm_sincos(uk, &suk, &cuk);
    fm_sincos(Ok, &sO, &cO);
    fm_sincos(ik, &sik, &cik);
    const Vec3 node = vec3(cO, sO, 0.0), ahead = vec3(-sO * cik, cO * cik, sik);
    const Vec3 out = vec_add(vec_scale(cuk, node), vec_scale(suk, ahead));
    const Vec3 along = vec_sub(vec_scale(cuk, ahead), vec_scale(suk, node));
    *r = vec_scale(SGP4_RADIUS * rk, out);
    *v = vec_scale(SGP4_RADIUS, vec_add(vec_scale(dr, out), vec_scale(rdu, along)));
    return rk < 1.0 ? ORBIT_ELEMENTS_DECAYED : ORBIT_ELEMENTS_GOOD;
}

OrbitElementsCode sgp4_state(Sgp4 *s, double t, Vec3 *r, Vec3 *v)
{
    const Sgp4Elements *el = &s->elements;
    const double M0 = el->M + s->dM * t, bulge = 1.0 + s->eta * fm_cos(M0);
    const double moved = s->w1 * t + s->w2 * (bulge * bulge * bulge - s->cube); /* of the perigee, by drag */
    const double M = M0 + moved;
    double now[5] = {el->e, el->i, M, el->periapsis + s->dperiapsis * t - moved,
                     el->node + t * (s->dnode + t * s->ddnode)};
    double n = s->n;
    *r = *v = vec3(0.0, 0.0, 0.0);
    if (s->deep != 0u) {
        for (int j = 0; j < 5; j++) {
            now[j] += s->secular[j] * t;
        }
        if (s->resonance != 0u) {
            double angle = 0.0;
            const OrbitElementsCode code = integrate(s, t, &angle, &n);
            if (code != ORBIT_ELEMENTS_GOOD) {
                return code;
            }
            const double theta = wrapped(s->theta + SPIN * t);
            now[2] = s->resonance == 1u ? angle - now[4] - now[3] + theta : angle - 2.0 * (now[4] - theta);
        }
    }
    if (!(n > 0.0)) {
        return ORBIT_ELEMENTS_MOTION;
    }
    const double drag = 1.0 - t * (s->A[0] + t * (s->A[1] + t * (s->A[2] + t * s->A[3])));
    const double a = semi_major_axis(n) * drag * drag;
    now[0] -= s->e1 * t + s->e2 * (fm_sin(M) - s->sine);
    if (now[0] >= 1.0 || now[0] < -0.001) {
        return ORBIT_ELEMENTS_ECCENTRICITY;
    }
    now[0] = now[0] < 1e-6 ? 1e-6 : now[0];
    now[2] += s->n * t * t * (s->L[0] + t * (s->L[1] + t * (s->L[2] + t * s->L[3])));
    if (s->deep != 0u) {
        now[4] = wrapped(now[4]);
        add_periodic(s, t, now);
        if (now[1] < 0.0) {
            now[1] = -now[1];
            now[4] += 0.5 * TURN;
            now[3] -= 0.5 * TURN;
        }
        if (now[0] < 0.0 || now[0] > 1.0) {
            return ORBIT_ELEMENTS_PERTURBED;
        }
    }
    const OrbitElementsCode code = osculate(a, surface_motion() / (a * fm_sqrt(a)), now, r, v);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    return vec_finite(*r) && vec_finite(*v) ? code : ORBIT_ELEMENTS_UNSOUND;
}
