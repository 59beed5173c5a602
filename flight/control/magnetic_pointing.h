/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_MAGNETIC_POINTING_H
#define FLIGHT_CONTROL_MAGNETIC_POINTING_H

#include "flight/msg/attitude.h"
#include "flight/msg/vehicle.h"
#include "flight/msg/wheels.h"

/** Point at a frame R that turns with the orbit, by torque rods alone, or by rods and wheels with a momentum bias. a is
 *  the pitch axis, in B and as well in R, where it lies along the orbit's angular momentum; RodTorques gives what it
 *  can of the torque. Without wheels
 *     L_rods = -(K sigma_BR + P omega_BR)
 *  With wheels, whose momentum is h = sum J_i Omega_i g_i, they turn the body about the pitch axis; rods damp the rest,
 *  and bring h to h_bias along the orbit's normal, both its size and its direction:
 *     L_wheels = -(K_pitch sigma_BR . a + P_pitch omega_BR . a) a
 *     L_rods = -(1 - a a^T) (K sigma_BR + P omega_BR + gain (h - h_bias [BR] a)) - gain (h . a - h_bias) a
 *  so that a body upside down turns over. Nothing of the reference's motion is fed forward: gyroscopic and
 *  gravity-gradient torques hold the body by themselves where its largest inertia is about a, its least about the
 *  radius, and h_bias is along a, not against it. Rods give no torque along the field, which turns twice per orbit,
 *  so gains must be small. At the mean motion n and an inertia I: without wheels K / 4 up to about 2 n^2 I, and P = 2
 *  K / (3 n), for below K / (3 n) it is unstable; with wheels K may be 0, gain is about n / 2, and P above gain I, or
 *  the nutation grows. Steady errors are, with wheels, |disturbance| / (n h_bias) in roll and yaw; without,
 *  |disturbance| / (K / 4), more than ten degrees for most small spacecraft, as rods hardly hold the yaw.
 *  Wheels whose speeds are unknown stand still, degraded. Where no torque can be computed, the last ones are held,
 *  degraded; after `hold` without new data they are zero, degraded.
 *  Sources: Lovera and Astolfi 2004; Psiaki 2001; Sidi 1997, chapter 8. */
typedef struct MagneticPointing {
    struct {
        AttError error;
        WheelSet wheels;    ///< optional: without it the rods do all
        WheelSpeeds speeds; ///< optional: without it the wheels do nothing
    } in;
    struct {
        BodyTorque torque;        ///< wanted of rods (RodTorques)
        BodyTorque wheels_torque; ///< wanted of wheels (WheelTorques), along the pitch axis
    } out;
    struct {
        double K;       ///< [N m] >= 0: rods' gain on the MRP error
        Mat3 P;         ///< [N m s] required: rods' gain on the rate error
        Vec3 pitch_B;   ///< [-] non-zero, assumed: the pitch axis, along the orbit's angular momentum
        double K_pitch; ///< [N m] >= 0: wheels' gain on the MRP error about the pitch axis
        double P_pitch; ///< [N m s] >= 0: wheels' gain on the rate error about it
        double h_bias;  ///< [N m s] >= 0: momentum that the wheels shall have along the orbit's normal
        double gain;    ///< [1/s] >= 0: part of their momentum error that the rods take out per second
        double hold;    ///< [s] >= 0: how long the torques go on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest; ///< [ns] the time of the newest data that were used
    } mem;
} MagneticPointing;

void magnetic_pointing_reset(MagneticPointing *m);
void magnetic_pointing_update(MagneticPointing *m, Tick t);

#endif
