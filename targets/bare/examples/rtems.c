/* SPDX-License-Identifier: Apache-2.0 */
/* A mission in a task of RTEMS: the application creates a task with RTEMS_FLOATING_POINT and a stack of 16 KiB, which
 * flight_task() begins. bsp/watchdog.h is of the LEON3's board support; other boards have their own. */
#include <bsp/watchdog.h>
#include <fcntl.h>
#include <rtems.h>
#include <rtems/libio.h>
#include <rtems/termiostypes.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "targets/bare/bare.h"
#include "targets/bare/port.h"

#define LINE "/dev/ttyS1" /* not the console's */

enum {
    PATIENCE_US = 2000000,
    BUFFERED = 5120, /* bytes that come while flight computes */
};

#define HAS_COME RTEMS_EVENT_0

static int line;
static rtems_id flight;

static void line_received(struct termios *unused, void *nor_this)
{
    (void)unused;
    (void)nor_this;
    (void)rtems_event_send(flight, HAS_COME);
}

void board_send(const void *bytes, size_t n)
{
    const char *from = bytes;
    while (n > 0u) {
        const ssize_t sent = write(line, from, n);
        if (sent > 0) {
            from += sent;
            n -= (size_t)sent;
        }
    }
}

size_t board_receive(void *bytes, size_t room)
{
    ssize_t n = read(line, bytes, room);
    if (n <= 0) {
        rtems_event_set got;
        (void)rtems_event_receive(HAS_COME, RTEMS_WAIT | RTEMS_EVENT_ANY, 1, &got); /* a tick of the clock at most */
        n = read(line, bytes, room);
    }
    return n > 0 ? (size_t)n : 0u;
}

int64_t board_time(void)
{
    return (int64_t)rtems_clock_get_uptime_nanoseconds();
}

void board_watch(void)
{
    bsp_watchdog_reload(0, PATIENCE_US);
}

void *board_keep(size_t size)
{
    static RTEMS_NOINIT uint64_t kept[2560];
    return size <= sizeof kept ? kept : NULL;
}

rtems_task flight_task(rtems_task_argument unused); /* for the application */

rtems_task flight_task(rtems_task_argument unused)
{
    struct termios raw;
    struct ttywakeup wakeup = {line_received, NULL};
    (void)unused;
    flight = rtems_task_self();
    (void)rtems_termios_bufsize(256, BUFFERED, 256);
    line = open(LINE, O_RDWR);
    if (line < 0 || tcgetattr(line, &raw) != 0) {
        rtems_fatal(RTEMS_FATAL_SOURCE_APPLICATION, 1);
    }
    cfmakeraw(&raw);
    (void)cfsetspeed(&raw, B921600);
    raw.c_cc[VMIN] = 0; /* a read returns the bytes that have arrived */
    raw.c_cc[VTIME] = 0;
    (void)tcsetattr(line, TCSANOW, &raw);
    (void)ioctl(line, RTEMS_IO_RCVWAKEUP, &wakeup);
    (void)fledge_fly();
    bsp_watchdog_system_reset(); /* for the next run */
    rtems_task_exit();
}
