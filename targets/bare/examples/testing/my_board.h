/* SPDX-License-Identifier: Apache-2.0 */
#ifndef MY_BOARD_H
#define MY_BOARD_H

#include <stddef.h>

void my_uart_write(const void *bytes, size_t n);
void my_watchdog_feed(void);
void my_reset(void);
void line_received(const void *bytes, size_t n);
void start_flight(void);

#endif
