/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_FAULT_PROTECTION_H
#define FLIGHT_SERVICES_FAULT_PROTECTION_H

#include "flight/msg/avionics.h"
#include "flight/msg/event.h"
#include "flight/msg/protection.h"
#include "flight/services/monitor.h"

enum { FAULT_RULES = 32, FAULT_LIMIT = 15, FAULT_PATIENCE = 10 };

/** A unit of the spacecraft. */
typedef struct FaultUnit {
    char name[16];   ///< by which the ground names it
    UnitState start; ///< [-] its state before anything has happened; UNIT_ABSENT: there is no such unit
    uint32_t kind;   ///< [-] in [0, 31]: units of one kind stand in for one another
    uint32_t loads;  ///< [-] the loads of the power unit behind it, a bit for each
    uint32_t warm;   ///< [-] in [0, 1]: 1: while it is redundant it has power, and rules look at it
} FaultUnit;

/** A check, and what follows where it stays wrong. */
typedef struct FaultRule {
    Monitor check;     ///< as of a monitor, with the sequence that it starts
    uint32_t unit;     ///< [-] in [0, 32]: place + 1 of the unit that it accuses; 0: none
    UnitState becomes; ///< [-] what the unit becomes; UNIT_ABSENT: it stays
    uint32_t mode;     ///< [-] place + 1 of the mode that it requests; 0: none
    uint32_t limit;    ///< [-] in [0, 15]: responses after which it only says that it fired; 0: none
} FaultRule;

/** Its events. Units and rules are given by their places; -1: none. */
typedef enum FaultProtectionEventId {
    FAULT_PROTECTION_FIRED = 1, ///< medium, rule [-], value [SI], unit [-], successor [-]: a rule has responded
    FAULT_PROTECTION_LOST = 2,  ///< high, rule [-], value [SI], unit [-], kind [-]: and none of the kind is in use now
    FAULT_PROTECTION_STOPPED = 3, ///< low, rule [-], value [SI]: it fired, but has responded as often as it may
    FAULT_PROTECTION_BAD = 4,     ///< low, rule [-]: it names no number of an output
    FAULT_PROTECTION_SET = 5,     ///< info, unit [-], state [-], successor [-]: by command; unit -1: all faults cleared
    FAULT_PROTECTION_RESTORED = 6, ///< info, used [-], faulted [-]: the states are those of the non-volatile memory
    FAULT_PROTECTION_DAMAGED = 7,  ///< medium, slot [-]: what that memory has does not keep its checksum
    FAULT_PROTECTION_GUARDED = 8   ///< medium, rule [-], mode [-]: the mode it asks for may not be entered now
} FaultProtectionEventId;

/** Holds the state of each unit of the spacecraft, isolates units by rules, lets others take over, and asks for a mode.
 *
 *  Units of one kind stand in for one another; as many of a kind are needed as are primary at the start. Where fewer
 *  are in use, because one has become anything else, the first redundant one of the kind becomes primary. Units without
 *  a spare are a kind each.
 *
 *  At each instant, after the commands of the ground, each rule looks at its output as monitors do. One that fires
 *  changes the unit that it accuses, requests its mode, and starts its sequence of stored commands, by commands that
 *  are checked and reported as any; of several modes at one instant that of the last rule stays, and one whose
 *  condition does not hold is refused: let safe mode have none. Rules have their turn
 *  in their order, and see the units as those before left them. A rule rests, and forgets, while its unit is absent or
 *  faulted or already is what the rule makes it, and one that marks it as faulted also while that has no power; so its
 *  persistence begins anew where a unit takes over. What follows the loss of a kind is a rule about the number `lost`
 *  of this module's own table.
 *
 *  Units and rules are parameters. The states and how often rules have responded are memory, which stays over a reset
 *  of flight. Over one of the computer they stay in a slot of the non-volatile memory: after each change they are
 *  stored, and after each start retrieved, for the units that have not changed since. Until then, 10 updates at most,
 *  the table says that it waits: loads stay as they are, and selectors take no unit; rules do not wait. A unit that is
 *  new in the parameters begins in its state of the start.
 *
 *  The table is written at each update, and at the instant of each change before the tasks run. The command 27 sets the
 *  state of a unit: refused where it would leave none of the kind in use, unless it says so; or it clears faults and
 *  what counts against rules: a cleared unit becomes primary where its kind needs it, else redundant. */
typedef struct FaultProtection {
    struct {
        NvmPacket reply; ///< optional: of the non-volatile memory
    } in;
    struct {
        UnitTable table;
        NvmPacket request;
        FlightEvent event;
    } out;
    struct {
        FaultUnit units[UNITS_MAX];
        FaultRule rules[FAULT_RULES];
        uint32_t slot; ///< [-] place + 1 in the non-volatile memory; 0: none
        uint32_t spare;
    } par;
    struct {
        MonitorMemory watched[FAULT_RULES];
        UnitState state[UNITS_MAX];
        uint8_t responded[FAULT_RULES]; ///< [-] how often, up to 15
        int64_t evaluated;              ///< [ns] at the last instant
        int64_t fired_at;               ///< [ns] when a rule responded last
        uint32_t begun;                 ///< [-] 1: there was an instant since the reset
        uint32_t fired;                 ///< [-] place + 1 of the rule that responded last
        uint32_t responses;             ///< [-] since the reset
        uint32_t modes;                 ///< [-] bit i: the mode of rule i is to be requested
        uint32_t lists;                 ///< [-] bit i: the sequence of rule i is to be started
        uint32_t bad;                   ///< [-] bit i: rule i names no number
        uint32_t touched;               ///< [-] bit i: unit i was changed since the computer began
        uint32_t changed;               ///< [-] 1: there is something to be stored
        uint32_t kept;                  ///< [-] 1: and nothing since
        uint32_t restored;              ///< [-] 1: the memory has answered since the computer began
        uint32_t waited;                ///< [-] updates since then, up to 10
        uint32_t spare;
    } mem;
} FaultProtection;

void fault_protection_reset(FaultProtection *m);
void fault_protection_update(FaultProtection *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService fault_protection_service;

#endif
