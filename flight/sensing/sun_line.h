/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_SUN_LINE_H
#define FLIGHT_SENSING_SUN_LINE_H

#include "flight/msg/navigation.h"
#include "flight/msg/sensors.h"
#include "flight/msg/sun.h"

/** The direction to the Sun, filtered: by the cosines of as many coarse sun sensors as are lit, one is enough, and by
 *  the rate. The states are a vector d to the Sun and a rate b, which is added to the gyro's: it removes the gyro's
 *  bias, or is the rate itself where no gyro is wired. In a Kalman filter in square-root form,
 *      dd = d x (omega_gyro + b),   cosine_i = n_i . d.
 *  A part of b along d cannot be seen and stays as it was.
 *  Two lit sensors alone have two directions that fit, one a cone of them. So the filter begins at each update anew,
 *  degraded, until lit sensors that do not lie in a plane give one direction, whose d has the length 1; where `guess`
 *  is newer than the hold, it begins with that direction, which may know what dark sensors say. After long
 *  times in the dark, when the square of the standard deviation exceeds `noise`, it does so again and keeps b.
 *  A lit sensor whose cosine is beyond `gate` standard deviations is left out. Where fewer than three are left, the
 *  result is degraded. Where most are left out, where all are too dark together, as in a half-shadow, or where d would
 *  lose its length, none is used, and the result is degraded; `persistence` times in a row, and the filter begins anew.
 *  The result is good while the error's standard deviation is up to `good`. In the dark the rates carry it on; beyond
 *  1 rad, and `hold` after the last rate, the output is held, degraded; but while the gyro speaks, there is a rate.
 *  Source: Kailath, Sayed and Hassibi, chapter 12, for the reduction. */
typedef struct SunLine {
    struct {
        SunCosines cosines;
        GyroRate gyro;    ///< optional: without it, the filter estimates the rate across the direction itself
        SunHeading guess; ///< optional: a direction by other means
    } in;
    struct {
        SunHeading heading;
        GyroRate rate; ///< without the gyro's bias; without a gyro, that across the direction
        SunLineState state;
    } out;
    struct {
        double noise;         ///< [-] required, > 0: standard deviation of a cosine of the weight 1
        double length;        ///< [-] required, > 0: standard deviation of the Sun's brightness, |d|, from 1
        double rate_noise;    ///< [rad^2/s]   required, > 0: variance that the angle gains per second
        double walk;          ///< [rad^2/s^3] required, > 0: variance that b gains per second
        double rate_std;      ///< [rad/s] required, > 0: standard deviation of b at the start, about each axis
        double gate;          ///< [-] required, > 0: standard deviations from which on a cosine does not fit
        double good;          ///< [rad] required, > 0: standard deviation up to which the direction is good
        double hold;          ///< [s] required, > 0: longest time between updates or rates that can be bridged
        uint32_t persistence; ///< [-] required, > 0: updates in which the sensors do not fit until it begins anew
        uint32_t spare;
    } par;
    struct {
        int64_t t;         ///< [ns] of the estimate
        int64_t seen;      ///< [ns] time of the last cosines
        int64_t turned;    ///< [ns] time of the last rate
        Vec3 d_B;          ///< [-] the vector to the Sun
        Vec3 b_B;          ///< [rad/s] what is added to the gyro's rate
        Vec3 gyro_B;       ///< [rad/s] the last rate of the gyro; zero without one
        double root[6][6]; ///< [-] root of the covariance of d and b
        uint32_t running;  ///< [-] 1 once there is a direction
        uint32_t misfits;  ///< [-] updates in a row in which the sensors did not fit
        uint32_t used;     ///< [-] sensors in the last update
        uint32_t rejected; ///< [-] sensors since the reset
        uint32_t restarts; ///< [-] since the reset
        uint32_t any_gyro; ///< [-] 1 once there was a rate
        uint32_t young;    ///< [-] updates with sensors in which the brightness may still change
        uint32_t spare;
    } mem;
} SunLine;

void sun_line_reset(SunLine *m);
void sun_line_update(SunLine *m, Tick t);

#endif
