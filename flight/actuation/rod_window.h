/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_ACTUATION_ROD_WINDOW_H
#define FLIGHT_ACTUATION_ROD_WINDOW_H

#include "flight/msg/magnetics.h"
#include "flight/msg/rods.h"

/** Let torque rods and the magnetometer, which rods nearby disturb, take turns. In the first part of each period the
 *  rods act as wanted, in the rest they are off:
 *     on while t mod period < on,   off from the first update after that
 *  A measurement counts if its head says that it was taken in an off part, `settle` or more after the rods went off. It
 *  may arrive later, until the next off part begins. Until then the output holds the last one that counted, with its
 *  time: a module that compares times sees no new one. It stays good for one period, and is degraded after that.
 *  A command acts until the next update, so periods and parts are best multiples of the task's period. Dipoles are not
 *  scaled up: the mean torque is `share` of what RodTorques' `achieved` says, and gains may be divided by that.
 *  If the module runs before the law of control, it gets the law's command of the update before; if it runs after the
 *  law, the law has the field of the update before. Without usable commands it holds the last one until the on part
 *  ends; after `hold` without new ones the dipoles are zero, degraded. In off parts they are zero whatever comes in.
 *  Source: Wertz 1978, section 19.1. */
typedef struct RodWindow {
    struct {
        RodCommand wanted;
        MeasuredField measured;
    } in;
    struct {
        RodCommand command;  ///< as wanted in the on part, zero in the rest
        MeasuredField field; ///< the last measurement that the rods did not disturb
        RodWindowState state;
    } out;
    struct {
        int64_t period; ///< [ns] required, > 0: of the turns
        int64_t on;     ///< [ns] >= 0: how long in each period the rods may act; the whole period: always
        int64_t settle; ///< [ns] >= 0: from when the rods go off to the first measurement that counts
        double hold;    ///< [s] >= 0: how long old commands count; 0: ten updates
    } par;
    struct {
        int64_t went_off;  ///< [ns] when the rods went off last
        int64_t went_on;   ///< [ns] when they went on again, if they are on
        int64_t newest;    ///< [ns] the time of the newest command that was used
        int64_t start;     ///< [ns] nominal start of this period
        int64_t begun;     ///< [ns] its first update
        double on_time;    ///< [s] how long the rods were on in it
        uint32_t running;  ///< [-] 1 after the first update
        uint32_t rods_on;  ///< [-] 1: they act since the last update
        uint32_t were_off; ///< [-] 1: there was an off part
        uint32_t spare;
    } mem;
} RodWindow;

void rod_window_reset(RodWindow *m);
void rod_window_update(RodWindow *m, Tick t);

#endif
