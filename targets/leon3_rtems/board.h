/* SPDX-License-Identifier: Apache-2.0 */
/* The board of targets/leon3/leon3.h under RTEMS. Flight is the thread that waits in bare_idle. */
#ifndef TARGETS_LEON3_RTEMS_BOARD_H
#define TARGETS_LEON3_RTEMS_BOARD_H

#include "targets/leon3/leon3.h"

#include <rtems.h>

/** The calling thread becomes flight, which the interrupt of a tick wakes up. Ends the program if the board has no
 *  register space. */
void leon3_begin_flight(void);

/** An extension of RTEMS, for the beginning of each thread: the nonstandard mode of a GRFPU, as on the bare board,
 *  because it would trap at a subnormal number. */
void leon3_begin_thread(rtems_tcb *thread);

/** Stops RTEMS with a status that is no success. */
void leon3_expect(rtems_status_code status);

/** Wait for one of these events, for at most so many ticks of RTEMS' clock. */
void leon3_wait_for(rtems_event_set events, rtems_interval ticks);

#endif
