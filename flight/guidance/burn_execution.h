/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_GUIDANCE_BURN_EXECUTION_H
#define FLIGHT_GUIDANCE_BURN_EXECUTION_H

#include "flight/msg/attitude.h"
#include "flight/msg/avionics.h"
#include "flight/msg/burn.h"

/** Open the engines at the start of a commanded change of velocity, and close them when it has been gained.
 *  Gained is what the sum of accelerations has added since the engines opened: along dv_N where its direction rests,
 *  else the size. The acceleration carries a sum from its time to now. When the rest is less than the next update's
 *  share, the engines close at now + rest / a, between two updates.
 *  The engines open where the attitude error is at most error_open, and wait for that up to `wait`. Then a burn is
 *  aborted, also one whose start was longer ago when its command came: a reset does not repeat a burn.
 *  They close early, and the burn is aborted, after `longest`, where the error exceeds error_max or is unknown, where
 *  the sum is older than `hold`, or where the acceleration stays below a_min for `settle`. Each update opens them for
 *  two updates only, so that they close without the module too. A burn that runs goes on without its command; another
 *  command counts from its end. A command of no length is none.
 *  A burn that BurnMemory says was cut off, by its start, is resumed: what was gained before counts, and for `longest`
 *  so does the time since it first began; within that it waits for the attitude. One that is complete or aborted there
 *  is so here. Until BurnMemory knows, no command is taken.
 *  Source: the rule of constant acceleration for what is left. */
typedef struct BurnExecution {
    struct {
        DeltaVCommand command;
        DeltaVSum sum;
        AttError error; ///< optional: needed for error_max
        BurnState kept; ///< optional: of BurnMemory, where the last burn stood before this module's reset
    } in;
    struct {
        ThrusterTimes engines;
        BurnState state;
    } out;
    struct {
        uint32_t engines_used; ///< [-] required, in [1, 255]: the engines that burn, a bit for each
        uint32_t spare;
        double longest;    ///< [s] required, in [1e-3, 1e6]: longest burn
        double wait;       ///< [s] in [0, 1e6]: how long the start waits for the attitude; 0: an update
        double error_max;  ///< [rad] in [0, 3.2]: largest attitude error; 0: not checked
        double error_open; ///< [rad] in [0, 3.2]: largest at which the engines open, where they may; 0: error_max
        double a_min;      ///< [m/s^2] >= 0: acceleration below which the engines count as failed; 0: not checked
        double settle;     ///< [s] in [0, 1e6]: for how long
        double hold;       ///< [s] in [0, 1e6]: how long an old sum counts; 0: ten updates
    } par;
    struct {
        DeltaVCommand taken; ///< the command that is executed
        Vec3 dv_N;           ///< [m/s] of the sum when the engines opened
        double path;         ///< [m/s] of the sum when the engines opened
        int64_t thrust;      ///< [ns] when the acceleration was last large enough
        double before;       ///< [m/s] gained before a reset
    } mem;
} BurnExecution;

void burn_execution_reset(BurnExecution *m);
void burn_execution_update(BurnExecution *m, Tick t);

#endif
