/* SPDX-License-Identifier: Apache-2.0 */
#ifndef RTEMS_TERMIOSTYPES_H
#define RTEMS_TERMIOSTYPES_H

#include <rtems/libio.h>
#include <sys/ioctl.h>
#include <termios.h>

struct ttywakeup {
    void (*sw_pfn)(struct termios *tty, void *argument);
    void *sw_arg;
};
#define RTEMS_IO_RCVWAKEUP _IOW('t', 12, struct ttywakeup)

#endif
