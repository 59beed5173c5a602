/* SPDX-License-Identifier: Apache-2.0 */
/* The five functions by which a board flies missions in the loop with a simulation, over a serial line. They need no
 * operating system below them; under one, a task runs fledge_fly().
 *
 * Example:
 *
 *     void uart_put(uint8_t byte);
 *     static uint64_t kept[512];
 *
 *     void *board_keep(size_t size)
 *     {
 *         return size <= sizeof kept ? kept : NULL;
 *     }
 *
 *     void board_send(const void *bytes, size_t n)
 *     {
 *         for (size_t i = 0; i < n; i++) {
 *             uart_put(((const uint8_t *)bytes)[i]);
 *         }
 *     }
 */
#ifndef TARGETS_BARE_PORT_H
#define TARGETS_BARE_PORT_H

#include <stddef.h>
#include <stdint.h>

/** Send bytes through the line; returns when they are sent, or lie in a buffer of the driver. */
void board_send(const void *bytes, size_t n);

/** Take the bytes that have come through the line, at most `room`; returns how many, 0 if there are none. It may sleep
 *  until one comes, but not longer than some milliseconds. A board need not report lost bytes. */
size_t board_receive(void *bytes, size_t room);

/** [ns] of a monotonic clock. */
int64_t board_time(void);

/** Keep the watchdog quiet. Flight calls it between two ticks and while it waits, many times a second. */
void board_watch(void);

/** `size` bytes, aligned to 8 and at the same address at each start, for pointers point into them: a reset of the board
 *  leaves them as they are, after power-on they are zero, or anything. Called once, at the start. A board without such
 *  memory returns memory that is zero at each start. */
void *board_keep(size_t size);

#endif
