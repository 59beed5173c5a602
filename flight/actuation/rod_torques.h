/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_ROD_TORQUES_H
#define FLIGHT_ACTUATION_ROD_TORQUES_H

#include "flight/msg/magnetics.h"
#include "flight/msg/vehicle.h"

/** Map a wanted torque to the dipoles of magnetic torque rods by the cross-product law:
 *     m = B x L / B^2,   of which the body gets m x B = L - (L . B) B / B^2
 *  and, with unit axes of the rods the columns of G, the dipoles G^+ m. A field gives no torque along itself: what lies
 *  along it waits until the field has turned. Where a rod would pass its limit, all are scaled alike.
 *  Rods that do not span the dipole give the nearest one, degraded. In a field below field_min, and after `hold`
 *  without new data of torque or field, the dipoles are zero, degraded.
 *  Source: Wie 2008, section 7.3; Wertz 1978, section 19.1. */
typedef struct RodTorques {
    struct {
        BodyTorque torque;
        MeasuredField field;
        RodSet rods;
    } in;
    struct {
        RodCommand command;
        BodyTorque achieved; ///< the torque on the body that the dipoles will give
    } out;
    struct {
        double field_min; ///< [T] required, > 0: weakest field that is used
        double hold;      ///< [s] >= 0: how long the dipoles go on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest;     ///< [ns] the time of the newest data that were used
        uint64_t saturated; ///< [-]  updates in which a rod's limit scaled the command
    } mem;
} RodTorques;

void rod_torques_reset(RodTorques *m);
void rod_torques_update(RodTorques *m, Tick t);

#endif
