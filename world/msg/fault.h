/* SPDX-License-Identifier: Apache-2.0 */
/* What may be wrong with the channels of a sensor or an actuator (world/faults.h has the effects). */
#ifndef WORLD_MSG_FAULT_H
#define WORLD_MSG_FAULT_H

#include "flight/msg/head.h"

#define FAULTS_MAX 4

/** What a fault does to a channel. */
typedef enum FaultKind {
    FAULT_NONE = 0,
    FAULT_HIGH = 1,    ///< it stays at its upper limit; where it has none, at `size`
    FAULT_LOW = 2,     ///< it stays at its lower limit; where it has none, at -`size`
    FAULT_BABBLE = 3,  ///< it gives anything between these two
    FAULT_BIAS = 4,    ///< it gives `size` too much
    FAULT_DRIFT = 5,   ///< it gives `size` too much per second since `begin`
    FAULT_DROPOUT = 6, ///< it keeps its last value, in a share `size` of the updates; 0: in all
    FAULT_DELAY = 7,   ///< it gives what it would have given `size` seconds ago
    FAULT_DEAD = 8     ///< it gives 0
} FaultKind;

/** One fault, of some channels, for some time. */
typedef struct Fault {
    FaultKind kind;
    uint32_t channels; ///< [-]  a bit for each channel; 0: all
    double size;       ///< [SI] how large, as `kind` needs it
    int64_t begin;     ///< [ns] >= 0: when it begins
    int64_t lasts;     ///< [ns] >= 0: for how long; 0: for ever
} Fault;

/** Faults that a program injects during the run. Those of the last message count, besides the planned ones. */
typedef struct FaultSet {
    Head head;
    uint32_t n; ///< [-] in [0, 4]: number of faults
    uint32_t spare;
    Fault list[FAULTS_MAX]; ///< count n: the faults
} FaultSet;

#endif
