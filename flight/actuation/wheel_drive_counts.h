/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_WHEEL_DRIVE_COUNTS_H
#define FLIGHT_ACTUATION_WHEEL_DRIVE_COUNTS_H

#include "flight/msg/avionics.h"

/** Turn motor torques into counts of the wheels' converter, as the volts that give them:
 *  V = R u / k + e Omega, where Omega is known, else without the back-EMF. Counts end at those of the converter.
 *  Where no counts can be computed, the output is held, degraded. After `hold` without new commands, which includes one
 *  that is not good and gets older, the counts are zero, degraded.
 *  Source: a direct-current motor's static equation. */
typedef struct WheelDriveCounts {
    struct {
        WheelCommand command;
        WheelSpeeds speeds; ///< optional: without it no back-EMF is made up for
    } in;
    struct {
        WheelDrive drive;
    } out;
    struct {
        uint32_t bits; ///< [-] required, in [2, 24]: of a count, with its sign
        uint32_t spare;
        double volts;           ///< [V] required, > 0: of the count 2^(bits - 1)
        double torque_constant; ///< [N m/A] required, > 0: k
        double resistance;      ///< [ohm] required, > 0: R
        double back_emf;        ///< [V s] >= 0: e, volts per rad/s
        double hold;            ///< [s] >= 0: how long the counts go on without new commands; 0: ten updates
    } par;
    struct {
        uint64_t saturated; ///< [-] updates in which a count was limited
        int64_t newest;     ///< [ns] the time of the newest commands that were used
    } mem;
} WheelDriveCounts;

void wheel_drive_counts_reset(WheelDriveCounts *m);
void wheel_drive_counts_update(WheelDriveCounts *m, Tick t);

#endif
