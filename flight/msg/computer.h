/* SPDX-License-Identifier: Apache-2.0 */
/* The flight computer as a piece of hardware. */
#ifndef FLIGHT_MSG_COMPUTER_H
#define FLIGHT_MSG_COMPUTER_H

#include "flight/msg/head.h"

/** Resets of a flight computer: each new count is a reset. A mission names the input of flight by whose message its
 *  computer is reset: `f.reset_by(f.boot.computer, down=2 * s)`. */
typedef struct ComputerReset {
    Head head;
    uint32_t count; ///< [-] of resets
    uint32_t spare;
} ComputerReset;

#endif
