/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_B_DOT_H
#define FLIGHT_ACTUATION_B_DOT_H

#include "flight/msg/magnetics.h"
#include "flight/msg/rods.h"
#include "flight/msg/sensors.h"
#include "flight/msg/vehicle.h"

/** Take out a tumble with magnetic torque rods by the B-dot law. With b = B / |B| the dipole is
 *     m = -k d / |B|,   d = b x omega_BN by a gyro, else the filtered change of b from measurement to measurement,
 *  of which the body gets -k (omega - (omega . b) b): its power m . dB is never above zero. A gain that damps all axes
 *  well, at the mean motion n, an inclination i to the magnetic equator and a least inertia I:
 *     k = 2 n (1 + sin i) I
 *  Unit axes of the rods are the columns of G, and the dipoles G^+ m, scaled alike where a rod would pass its limit;
 *  rods that do not span m still take energy out, but the output is degraded. Where |d|, the rate across the field, is
 *  above `bang_above`, each rod is at its limit, against its part of d: that is fastest, but for slow turns k damps
 *  better, for it leaves the body time to show each axis to the field. Changes are those between measurements of new
 *  times, also if a field is held in between (RodWindow). They are blind for turns of more than half a revolution
 *  between two, and include what the orbit turns the field: in the end the body turns with it, at up to 2 n. With a
 *  gyro it comes to rest. It is detumbled if the rate is below `rate_slow` for `slow_time`. Without a gyro this is
 *  the rate across the field, which shows a turn about the field when the orbit has turned the field: then wait for a
 *  quarter of an orbit or more. A gyro that falls silent is replaced by the changes, degraded. In a field below
 *  field_min, and after `hold` without new data (without a gyro: a new measurement), the dipoles are zero, degraded.
 *  Sources: Avanzini and Giulietti 2012; Stickler and Alfriend 1976. */
typedef struct BDot {
    struct {
        MeasuredField field;
        RodSet rods;
        GyroRate gyro; ///< optional: without it the rate across the field is that of the measurements
    } in;
    struct {
        RodCommand command;
        BodyTorque achieved; ///< the torque on the body that the dipoles will give
        DetumbleState state;
    } out;
    struct {
        double k;          ///< [N m s] required, > 0: gain on the rate across the field
        double field_min;  ///< [T] required, > 0: weakest field that is used
        double bang_above; ///< [rad/s] >= 0: rate across the field above which rods are at their limits; 0: never
        double tau;        ///< [s] >= 0: time constant of the filter of changes; 0: none
        double gap;        ///< [s] >= 0: longest time between measurements that are compared; 0: any
        double rate_slow;  ///< [rad/s] >= 0: below which the body is slow
        double slow_time;  ///< [s] >= 0: how long it is slow until it is detumbled
        double hold;       ///< [s] >= 0: how long the dipoles go on without new data; 0: ten updates
    } par;
    struct {
        Vec3 b_B;           ///< [-]   direction of the last field
        Vec3 db_B;          ///< [1/s] its filtered change, across it
        int64_t measured;   ///< [ns]  time of the last measurement
        int64_t newest;     ///< [ns]  the time of the newest data that were used
        int64_t slow_since; ///< [ns]  since when the body is slow
        uint64_t saturated; ///< [-]   updates in which a rod's limit scaled the command
        uint32_t known;     ///< [-]   1: there is a field, 2: and a change
        uint32_t slow;      ///< [-]   1: the body is slow
    } mem;
} BDot;

void b_dot_reset(BDot *m);
void b_dot_update(BDot *m, Tick t);

#endif
