/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_B_DOT_H
#define FLIGHT_CONTROL_B_DOT_H

#include "flight/msg/magnetics.h"
#include "flight/msg/sensors.h"
#include "flight/msg/vehicle.h"

/** Ask of magnetic rods (RodTorques) for the torque that ends a tumble:
 *     L = -gain w,   w = omega - (omega . B) B / B^2
 *  with w the rate across the field. With a gyro, omega is its rate. Without one, the field's change in the body shows
 *  it: a field that rests in N changes by dB = -omega x B, so w = dB x B / B^2, from two readings. RodTorques then
 *  gives the dipole -gain dB / B^2, and a body keeps turning with the field, twice in an orbit.
 *  The rods disturb the magnetometer. So with `act`, cycles alternate: for `measure` there is no torque, then for `act`
 *  there is that of the last readings; readings while the rods act do not count, and RodTorques takes `measured`.
 *  A gain of 4 pi / T (1 + sin i) J_min, with the orbital period T, the inclination i to the magnetic equator and the
 *  least moment of inertia J_min, ends a tumble in few orbits.
 *  Readings below field_min do not count. Where none tells the rate, in this cycle or (without cycles) since `hold`,
 *  there is no torque, degraded.
 *  Source: Avanzini and Giulietti 2012. */
typedef struct BDot {
    struct {
        MeasuredField field;
        GyroRate gyro; ///< optional: without it, the field's change says how the body turns
    } in;
    struct {
        BodyTorque torque;      ///< wanted of the rods
        MeasuredField measured; ///< the field by the last reading that counts
        GyroRate rate;          ///< w, as the torque has it
    } out;
    struct {
        double gain;      ///< [N m s] required, > 0: torque per rate
        double field_min; ///< [T] required, > 0: weakest field that is used
        double measure;   ///< [s] >= 0: how long the rods rest in a cycle
        double act;       ///< [s] >= 0: how long they act in a cycle; 0: always
        double hold;      ///< [s] >= 0: how long a rate counts without cycles; 0: ten updates
    } par;
    struct {
        int64_t begin;     ///< [ns] of the cycle
        int64_t last;      ///< [ns] time of the last reading
        Vec3 B_B;          ///< [T] the last reading
        uint32_t readings; ///< [-] in this cycle, up to 2
        uint32_t known;    ///< [-] 1: they tell the rate
        uint32_t running;  ///< [-] 1: a cycle has begun
        uint32_t spare;
    } mem;
} BDot;

void b_dot_reset(BDot *m);
void b_dot_update(BDot *m, Tick t);

#endif
