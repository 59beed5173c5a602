/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_WHEEL_CONVERTER_H
#define WORLD_AVIONICS_WHEEL_CONVERTER_H

#include "flight/msg/avionics.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"

/** The drive electronics of reaction wheels: counts become volts, volts become motor torques, and tachometers count.
 *  With the volts V, the speed Omega, resistance R, and the constants k of the torque and e of the back-EMF, a motor
 *  gives k i, i = (V - e Omega) / R, at most current_max. A tachometer gives, at the end of each window of time, the
 *  marks of the wheel that passed in it.
 *  The channels of its faults: 0 to 7 the torques of the motors, 8 to 15 the tachometers, in counts.
 *  Let it run before the spacecraft in its task: the torque holds over the step that the spacecraft then makes.
 *  Assumptions: no inductance; the speed is that at the beginning of an update. The wheels' own friction is theirs.
 *  Source: thesis section 5.3.2; a direct-current motor's static equation. */
typedef struct WheelConverter {
    struct {
        WheelDrive drive; ///< optional: without it the motors are off
        WheelSpeeds speeds;
        FaultSet injected; ///< optional: faults, besides the planned ones
        LoadSupply power;  ///< optional: without it the converter is on
    } in;
    struct {
        WheelCommand torques;
        WheelTachometers tachometers;
    } out;
    struct {
        uint32_t n;               ///< [-] required, in [1, 8]: number of wheels
        uint32_t bits;            ///< [-] required, in [2, 24]: of a count, with its sign
        double volts;             ///< [V] required, > 0, <= 1e6: of the count 2^(bits - 1), the end of the range
        double torque_constant;   ///< [N m/A] required, > 0, <= 1e6: torque per current
        double resistance;        ///< [ohm] required, >= 1e-6: of a winding
        double back_emf;          ///< [V s] >= 0, <= 1e6, assumed: volts per rad/s; 0: none
        double current_max;       ///< [A] >= 0: of the driver; 0: unlimited
        uint32_t marks;           ///< [-] required, in [1, 1000000]: of a tachometer, in one turn
        uint32_t n_faults;        ///< [-] in [0, 4]: number of planned faults
        int64_t window;           ///< [ns] required, > 0: in which a tachometer counts
        Fault faults[FAULTS_MAX]; ///< count n_faults: planned
        uint32_t load;            ///< [-] in [0, 31]: the converter's load in the power unit
        uint32_t spare;
    } par;
    struct {
        double turned[WHEELS_MAX];  ///< [rad] since the reset
        int64_t passed[WHEELS_MAX]; ///< [-] marks until the last window's end
        uint64_t saturated;         ///< [-] updates in which counts or a current were limited
    } mem;
} WheelConverter;

#endif
