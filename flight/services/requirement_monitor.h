/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SERVICES_REQUIREMENT_MONITOR_H
#define FLIGHT_SERVICES_REQUIREMENT_MONITOR_H

#include "flight/command/command.h"
#include "flight/msg/event.h"
#include "flight/msg/requirement.h"

enum {
    FORMULA_NODES = 128,   ///< of all formulas together
    FORMULA_MEMORY = 4096, ///< numbers that windows remember, of all formulas together
    FORMULA_NUMBERS = 64,  ///< of signals that wait for their operation
    FORMULA_VALUES = 16,   ///< of formulas that wait for theirs
    FORMULA_VECTOR = 16    ///< numbers of one signal
};

/** What a node does: it takes operands from the end of a stack, of numbers or of margins, and leaves its result there.
 *  Samples are counted from the first one, which is 0. */
typedef enum FormulaOperation {
    FORMULA_NOTHING = 0,
    FORMULA_READ = 1,      ///< n numbers of an output; first = 1: none are known while it is stale or was never written
    FORMULA_CONSTANT = 2,  ///< the number
    FORMULA_ELEMENT = 3,   ///< of n numbers that of the place `first`
    FORMULA_NORM = 4,      ///< of n numbers
    FORMULA_MAX_ABS = 5,   ///< of n numbers
    FORMULA_MAGNITUDE = 6, ///< of each of n numbers
    FORMULA_SUM = 7,       ///< of n and n numbers
    FORMULA_DIFFERENCE = 8, ///< of n and n numbers
    FORMULA_SCALED = 9,     ///< n numbers, each times the number
    FORMULA_ANGLE = 10,     ///< [rad] between two vectors
    FORMULA_TURNED = 11,    ///< the second vector, in the frame to which the attitude before it (MRP) turns its own
    FORMULA_COMPARE = 12, ///< of a number, by a relation (`first`: ExecRelation) to `number`; the margin over the scale
    FORMULA_CLOCK = 13,   ///< true from the time on
    FORMULA_NOT = 14,
    FORMULA_AND = 15,
    FORMULA_OR = 16,
    FORMULA_FIRST = 17,         ///< the margin of the first sample
    FORMULA_DELAY = 18,         ///< that of `last` samples before
    FORMULA_ONCE = 19,          ///< at this sample or one before
    FORMULA_BEGINS = 20,        ///< at this sample, and not at the one before
    FORMULA_ALWAYS = 21,        ///< at the `last` samples before this one
    FORMULA_UNTIL = 22,         ///< of these, the second at one, and the first at all of them before that
    FORMULA_ALWAYS_SO_FAR = 23, ///< at all samples from `first` to `last`, by what has come
    FORMULA_UNTIL_SO_FAR = 24,  ///< the same of `until`, up to the sample `last`
    FORMULA_MODE = 25           ///< the place of the mode in force, as a number
} FormulaOperation;

/** An operation of a formula. */
typedef struct FormulaNode {
    double number; ///< [SI] a constant, a factor or a limit
    double scale;  ///< [-]
    int64_t time;  ///< [ns]
    FormulaOperation operation;
    uint32_t output; ///< [-] place in the dictionary
    uint32_t offset; ///< [-] bytes from the output's beginning
    uint32_t type;   ///< [-] in [0, 11]: FledgeType of the numbers
    uint32_t n;      ///< [-] in [0, 16]: numbers in a row
    uint32_t first;  ///< [-] of a window, the first sample
    uint32_t last;   ///< [-] the last, or how many it has
    uint32_t delay;  ///< [-] by how many samples its operands come late
    uint32_t place;  ///< [-] in [0, 4096]: of the numbers that it remembers
    uint32_t spare;
} FormulaNode;

/** A requirement: its formula in postfix order, as `fledge` compiles it from requirements.py. */
typedef struct FlownRequirement {
    char id[16];
    int64_t every;  ///< [ns] >= 0: between two samples, at its multiples
    uint32_t first; ///< [-] in [0, 128]: its first node
    uint32_t n;     ///< [-] in [0, 128]: nodes
    uint32_t on;    ///< [-] in [0, 1]: 1: it is judged
    uint32_t spare;
} FlownRequirement;

/** Its events. ANEW: flight had no instant at a sample. BAD: its formula is none, or names no number of an output. */
typedef enum RequirementMonitorEventId {
    REQUIREMENT_MONITOR_VIOLATED = 1, ///< medium, requirement [-], margin [SI], sampled [s]: it is violated
    REQUIREMENT_MONITOR_HOLDS = 2,    ///< info, requirement [-], margin [SI], sampled [s]: it holds, whatever comes
    REQUIREMENT_MONITOR_ANEW = 3,     ///< low, requirement [-]: a sample is missing, so its judgement begins anew
    REQUIREMENT_MONITOR_BAD = 4       ///< low, requirement [-]: it cannot be evaluated
} RequirementMonitorEventId;

/** Judges requirements of the mission on board, by the formulas that judge its simulations, with the same verdicts.
 *
 *  At each instant, after the commands of the ground, it looks at the outputs as the last instant left them. Where
 *  that was a multiple of a requirement's `every`, they are its sample. A formula has as many nodes and as much memory
 *  as its windows need, fixed when it is compiled; what it says lies in `state`, for rules of the fault protection,
 *  and `event` says what becomes decided. The arithmetic is that of the simulation's judge (sim/temporal.h,
 *  sim/judge.h).
 *
 *  Formulas are parameters. One that is turned off and on begins anew, as after a reset. */
typedef struct RequirementMonitor {
    struct {
        RequirementState state;
        FlightEvent event;
    } out;
    struct {
        FlownRequirement requirements[REQUIREMENTS];
        FormulaNode nodes[FORMULA_NODES];
    } par;
    struct {
        double memory[FORMULA_MEMORY];  ///< [SI] margins
        double low[REQUIREMENTS];       ///< [SI]
        double high[REQUIREMENTS];      ///< [SI]
        int64_t sampled[REQUIREMENTS];  ///< [ns] -1: not yet
        uint32_t samples[REQUIREMENTS]; ///< [-] so far
        int64_t last;                   ///< [ns] the instant before; -1: none
        uint32_t bad;                   ///< [-] bit i: that of requirement i
        uint32_t spare;
    } mem;
} RequirementMonitor;

void requirement_monitor_reset(RequirementMonitor *m);
void requirement_monitor_update(RequirementMonitor *m, Tick t);

/** How flight's executive drives it. */
extern const CommandService requirement_monitor_service;

#endif
