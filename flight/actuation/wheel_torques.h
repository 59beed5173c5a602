/* SPDX-License-Identifier: Apache-2.0 */
/* Example:
 *
 *     void drive_motors(const double *u, uint32_t n); // [N m]
 *
 *     static void allocate(WheelTorques *m, const BodyTorque *wanted, const WheelSet *wheels, Tick t)
 *     {
 *         m->in.torque = *wanted;
 *         m->in.wheels = *wheels;
 *         wheel_torques_update(m, t);
 *         drive_motors(m->out.command.u, m->in.wheels.n);
 *     }
 */
#ifndef FLIGHT_ACTUATION_WHEEL_TORQUES_H
#define FLIGHT_ACTUATION_WHEEL_TORQUES_H

#include "flight/msg/vehicle.h"
#include "flight/msg/wheels.h"

/** Map a wanted body torque to motor torques of the available wheels, with minimum norm.
 *  Where a motor would saturate, all are scaled alike, so the torque keeps its direction.
 *  Where the wheels cannot span the controlled axes, the nearest torque is given, degraded.
 *  Where no command can be computed, the last one is held, degraded: the wheels go on with it. After `hold` without
 *  new data, which includes a wanted torque that is not good and gets older, the command is zero, degraded.
 *  With unit spin axes the columns of G, unit controlled axes the rows of C, and ^+ the pseudo-inverse,
 *     u = -(C G)^+ C torque,   achieved = -G u
 *  A motor's u drives its wheel, and the body gets the opposite.
 *  Source: thesis, appendix A; the pseudo-inverse is the minimum-norm least-squares solution. */
typedef struct WheelTorques {
    struct {
        BodyTorque torque;
        WheelSet wheels;
        WheelAvailability availability; ///< optional: without it all wheels may be used
    } in;
    struct {
        WheelCommand command;
        BodyTorque achieved; ///< the torque on the body that the command will give
    } out;
    struct {
        uint32_t n_axes; ///< [-] in [0, 3]: number of controlled axes; 0: all three
        uint32_t spare;
        Vec3 axes_B[3]; ///< [-] count n_axes: controlled axes, linearly independent
        double hold;    ///< [s] >= 0: how long the command goes on without new data; 0: ten updates
    } par;
    struct {
        int64_t newest;     ///< [ns] the time of the newest wanted torque that was used
        uint64_t saturated; ///< [-]  updates in which a motor's limit scaled the command
    } mem;
} WheelTorques;

void wheel_torques_reset(WheelTorques *m);
void wheel_torques_update(WheelTorques *m, Tick t);

#endif
