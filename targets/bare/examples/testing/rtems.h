/* SPDX-License-Identifier: Apache-2.0 */
/* RTEMS 6 as far as rtems.c uses it, by its manual; the rest is POSIX'. */
#ifndef RTEMS_H
#define RTEMS_H

#include <stddef.h>
#include <stdint.h>

typedef uint32_t rtems_id, rtems_event_set, rtems_option, rtems_interval, rtems_fatal_code;
typedef uintptr_t rtems_task_argument;
typedef void rtems_task;
typedef enum { RTEMS_SUCCESSFUL = 0 } rtems_status_code;
typedef enum { RTEMS_FATAL_SOURCE_APPLICATION = 9 } rtems_fatal_source;

#define RTEMS_NOINIT __attribute__((section(".noinit")))
#define RTEMS_WAIT 0x0u
#define RTEMS_EVENT_ANY 0x2u
#define RTEMS_EVENT_0 0x1u

rtems_status_code rtems_event_send(rtems_id task, rtems_event_set events);
rtems_status_code rtems_event_receive(rtems_event_set events, rtems_option options, rtems_interval ticks,
                                      rtems_event_set *got);
rtems_id rtems_task_self(void);
void rtems_task_exit(void) __attribute__((noreturn));
uint64_t rtems_clock_get_uptime_nanoseconds(void);
void rtems_fatal(rtems_fatal_source source, rtems_fatal_code code) __attribute__((noreturn));

#endif
