/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_NAVIGATION_ORBIT_FILTER_H
#define FLIGHT_NAVIGATION_ORBIT_FILTER_H

#include "flight/msg/navigation.h"
#include "flight/msg/orbit.h"
#include "flight/navigation/orbit_motion.h"

/** A position, a velocity and an acceleration along it, of a time. */
typedef struct OrbitEstimate {
    int64_t t;         ///< [ns]    of which it is
    OrbitPoint x;      ///< position and velocity
    double along;      ///< [m/s^2] acceleration along the velocity
    double root[7][7]; ///< [-]     root U of the covariance U^T U of all three
} OrbitEstimate;

/** The orbit from the fixes of a receiver of navigation satellites, by an extended Kalman filter in square-root form.
 *  It estimates position, velocity and an acceleration along the velocity, which drag and small thrusters make and
 *  which decays with the time along_time:
 *     dv/dt = g(r) + w v / |v| + white noise,   dw/dt = -w / along_time + white noise.
 *  A fix counts at the time in its head, if that is not older than `latency`; so the estimate that is kept stays up to
 *  `latency` and a step behind, and each update predicts from there. A fix of a time to come waits, an older one is
 *  counted as late. One whose normalised innovation exceeds the gate is rejected. If `persistence` rejected fixes in a
 *  row agree with each other by the motion between them, the filter begins anew with the last. A fix that repeats the
 *  one before to the last digit is that of a stuck receiver, and rejected. A degraded fix counts, and degrades.
 *  Without fixes the filter goes on by the field. The result is good once `persistence` fixes were used, the first
 *  among them, while the standard deviation of the position is not above `good`; where that exceeds 20 km, the next
 *  fix begins anew. An error of the receiver that wanders slowly does not average out: its standard deviation `wander`
 *  adds to that of each fix, and to what the filter says of its own. After a gap of more than `steps` steps it catches
 *  up over several updates, degraded and with the time that it has reached; if the clock goes back, it begins anew.
 *  Sources: Montenbruck and Gill, chapter 8; orbit_motion.h and flight/math/qr.h have the equations. */
typedef struct OrbitFilter {
    struct {
        NavOrbit fix;
        PlanetAttitude planet; ///< optional: its pole; without it, that is the third axis of N
    } in;
    struct {
        NavOrbit orbit;
        OrbitFilterState state;
    } out;
    struct {
        double mu;            ///< [m^3/s^2] required, > 0: of the planet
        double radius;        ///< [m] >= 0: to which the zonal harmonics belong
        double J2;            ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double J3;            ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double J4;            ///< [-] in [-1, 1]: zonal harmonic; 0: none
        double step;          ///< [s] required, in [0.001, 3600]: longest step of the motion
        double accel_noise;   ///< [m^2/s^3] required, > 0: the square of the noise density of the acceleration
        double along_std;     ///< [m/s^2] >= 0: standard deviation of the acceleration along the velocity; 0: none
        double along_time;    ///< [s] >= 0: its correlation time; 0: it is constant
        double position_std;  ///< [m] required, > 0: white error of each position, about each axis
        double velocity_std;  ///< [m/s] required, > 0: white error of each velocity, about each axis
        double wander;        ///< [m] >= 0: error of the positions that wanders, about each axis
        double gate;          ///< [-] required, > 0: normalised innovation above which a fix does not fit
        double good;          ///< [m] required, > 0: standard deviation, all axes together, for a good result
        double latency;       ///< [s] in [0, 3600]: oldest fix that can be used
        uint32_t steps;       ///< [-] required, in [1, 1000]: most steps of an update, for each of three predictions
        uint32_t persistence; ///< [-] required, > 0: fixes that agree until it begins anew, or until it is good
    } par;
    struct {
        OrbitEstimate at;        ///< the estimate that is kept
        int64_t now;             ///< [ns] of the last update
        int64_t seen;            ///< [ns] time of the last fix that was looked at
        int64_t used;            ///< [ns] time of the last fix that was used
        int64_t rejected_at;     ///< [ns] time of the last rejected fix
        OrbitPoint rejected;     ///< the last rejected fix
        OrbitPoint last;         ///< the last fix that was looked at
        double misfit;           ///< [-] as OrbitFilterState has it, and what follows
        uint32_t used_count;     ///< [-] used
        uint32_t rejected_count; ///< [-] rejected
        uint32_t late_count;     ///< [-] late
        uint32_t restarts;       ///< [-] restarts
        uint32_t sequence;       ///< [-] of the last fix that was looked at
        uint32_t any;            ///< [-] 1 once a fix was looked at
        uint32_t agree;          ///< [-] rejected fixes in a row that agree with each other
        uint32_t running;        ///< [-] fixes that were used since it began, up to `persistence`; 0: there is none
        Quality quality;         ///< [-] of the last fix that was used
        uint32_t spare;
    } mem;
} OrbitFilter;

void orbit_filter_reset(OrbitFilter *m);
void orbit_filter_update(OrbitFilter *m, Tick t);

#endif
