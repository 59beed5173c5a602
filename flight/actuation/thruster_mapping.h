/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_THRUSTER_MAPPING_H
#define FLIGHT_ACTUATION_THRUSTER_MAPPING_H

#include "flight/msg/thrusters.h"
#include "flight/msg/vehicle.h"

/** Map a wanted torque, and a wanted force where one is wired, to forces of the available thrusters, which only push.
 *  With the columns d_i = r_i x f_i of D, or (r_i x f_i, f_i) with a force, the forces are the F >= 0 of least norm
 *  among those for which |D F - wanted| is least; with a force, 1 N counts as much as 1 N m. Without a wired force the
 *  thrusters' net force is what it happens to be; the least norm uses couples where there are such.
 *  Where a thruster would pass its F_max, all are scaled alike, so that torque and force keep their direction.
 *  For engines that burn anyway, `off_pulse` closes them partly: with F = F_max - x, the same is done for
 *  D x = D F_max - wanted; beyond a limit of x, the direction is then not kept.
 *  A torque that the thrusters cannot give is given as nearly as possible, degraded. After `hold` without new data,
 *  which includes a wanted torque that is not good and gets older, the forces are zero, degraded; an old wanted force
 *  alone counts as zero.
 *  Source: Lawson and Hanson 1995, chapter 23, for the problem. */
typedef struct ThrusterMapping {
    struct {
        BodyTorque torque;
        BodyForce force; ///< optional: without it the force is free
        ThrusterSet thrusters;
        ThrusterAvailability availability; ///< optional: without it all thrusters may be used
    } in;
    struct {
        ThrusterForces forces;
        BodyTorque achieved; ///< the mean torque on the body that the forces will give
    } out;
    struct {
        uint32_t off_pulse; ///< [-] in [0, 1]: 1: thrusters are open but for what the torque needs
        uint32_t spare;
        double hold; ///< [s] >= 0: how long the forces go on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest;     ///< [ns] the time of the newest wanted torque that was used
        uint64_t saturated; ///< [-]  updates in which a thruster's limit scaled the forces
        uint32_t pushing;   ///< [-]  thrusters whose force was not zero at the last update, a bit for each
        uint32_t spare;
    } mem;
} ThrusterMapping;

void thruster_mapping_reset(ThrusterMapping *m);
void thruster_mapping_update(ThrusterMapping *m, Tick t);

#endif
