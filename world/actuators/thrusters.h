/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_ACTUATORS_THRUSTERS_H
#define WORLD_ACTUATORS_THRUSTERS_H

#include "flight/msg/avionics.h"
#include "flight/msg/valves.h"
#include "world/msg/fault.h"
#include "world/msg/power.h"
#include "world/msg/propulsion.h"

/** How the propellant in a tank lies. */
typedef enum TankShape {
    TANK_FILLED = 0,  ///< a ball of constant radius: it fills the tank
    TANK_SHRINKS = 1, ///< a ball of constant density about the tank's centre
    TANK_SETTLES = 2  ///< a liquid that fills a part of a spherical tank, on one side of it
} TankShape;

/** Thrusters with the tanks that feed them, a part of a spacecraft. A thruster is open in its window of `times`, or as
 *  `valves` says. A valve that has opened stays open for min_on at least. Thrust rises and falls linearly. A burn whose
 *  beginning has already passed opens at once and keeps its duration.
 *  The spacecraft's mass, center_B and I_B are those without propellant. All tanks feed all thrusters and become empty
 *  together; then thrust ends at once. Without tanks the mass is constant, and isp only says how much would flow.
 *  One that is mounted on a panel of the attribute `panels`, counted from 1, turns with it; r_TB_B and axes_B are for
 *  theta = 0. Its propellant crosses the hinge at hinge_B.
 *  A latch valve without power shuts them all, those too whose own valve is stuck.
 *  The channels of its faults are the thrusts for which the valves are open, from 0 to F.
 *  Assumptions: isp does not depend on the thrust; propellant flows straight from its tank to its thruster, without a
 *  momentum of its own where valves open and close; it does not slosh. */
typedef struct Thrusters {
    struct {
        ThrusterTimes times;   ///< optional: when each is open
        ThrusterValves valves; ///< optional: which are open
        FaultSet injected;     ///< optional: faults, besides the planned ones
        LoadSupply power;      ///< optional: of the latch valve in front of them all; without it that is open
    } in;
    struct {
        ThrusterOutput output;
        TankLevels tanks;
    } out;
    struct {
        uint32_t n;                   ///< [-] in [1, 8]: number of thrusters
        uint32_t n_tanks;             ///< [-] in [0, 4]: number of tanks
        Vec3 r_TB_B[THRUSTERS_MAX];   ///< [m]  count n, in [-1e3, 1e3]: where each acts, relative to the body's origin
        Vec3 axes_B[THRUSTERS_MAX];   ///< [-]  required, count n, non-zero: direction of its force on the body
        double F[THRUSTERS_MAX];      ///< [N]  required, count n, in [1e-9, 1e9]: its force once it has risen
        double isp[THRUSTERS_MAX];    ///< [s]  count n, >= 0, <= 1e6: specific impulse; 0: no mass flows
        int64_t rise[THRUSTERS_MAX];  ///< [ns] count n, >= 0: from no force to its full force
        int64_t fall[THRUSTERS_MAX];  ///< [ns] count n, >= 0: from its full force to none
        int64_t min_on;               ///< [ns] >= 0: shortest time for which a valve is open
        Vec3 r_KB_B[TANKS_MAX];       ///< [m]  count n_tanks, in [-1e3, 1e3]: centre of each tank, as r_TB_B
        double propellant[TANKS_MAX]; ///< [kg] count n_tanks, in [1e-9, 1e9], initial: in each tank
        double radius[TANKS_MAX];   ///< [m]  count n_tanks, in [0, 1e3]: of a ball of propellant, of a tank; 0: a point
        TankShape shape[TANKS_MAX]; ///< [-]  count n_tanks: what becomes of the propellant's shape
        double fill[TANKS_MAX];     ///< [-]  count n_tanks, in [0, 1]: for TANK_SETTLES, part of the tank at the start
        Vec3 down_B[TANKS_MAX];     ///< [-]  count n_tanks: for TANK_SETTLES, where the propellant settles
        uint32_t n_faults;          ///< [-]  in [0, 4]: number of planned faults
        uint32_t load;              ///< [-]  in [0, 31]: the latch valve's load in the power unit
        Fault faults[FAULTS_MAX];   ///< count n_faults: planned
        uint32_t panel[THRUSTERS_MAX]; ///< [-] count n, in [0, 8], initial: of `panels`, that it is mounted on; 0: none
    } par;
    struct {
        uint64_t burns[THRUSTERS_MAX]; ///< [-] how often each valve has opened
    } mem;
} Thrusters;

#endif
