/* SPDX-License-Identifier: Apache-2.0 */
/* A mission in a thread of Zephyr. The board's overlay names the UART of the line, which must not be the console's:
 *
 *     / { chosen { fledge,line = &usart3; }; };
 *
 * and prj.conf has CONFIG_SERIAL=y, CONFIG_UART_INTERRUPT_DRIVEN=y, CONFIG_WATCHDOG=y, CONFIG_REBOOT=y,
 * CONFIG_FPU=y and CONFIG_FPU_SHARING=y. */
#include <zephyr/device.h>
#include <zephyr/devicetree.h>
#include <zephyr/drivers/uart.h>
#include <zephyr/drivers/watchdog.h>
#include <zephyr/kernel.h>
#include <zephyr/sys/reboot.h>

#include "targets/bare/bare.h"
#include "targets/bare/port.h"

enum {
    STACK = 16384,
    PRIORITY = 5,
    PATIENCE_MS = 2000,
    BUFFERED = 5120, /* bytes that come while flight computes */
};

static const struct device *const line = DEVICE_DT_GET(DT_CHOSEN(fledge_line));
static const struct device *const watchdog = DEVICE_DT_GET(DT_ALIAS(watchdog0));

K_MSGQ_DEFINE(received, 1, BUFFERED, 1);

static void line_interrupt(const struct device *uart, void *unused)
{
    uint8_t byte;
    (void)unused;
    (void)uart_irq_update(uart);
    if (uart_irq_rx_ready(uart) > 0) {
        while (uart_fifo_read(uart, &byte, 1) == 1) {
            (void)k_msgq_put(&received, &byte, K_NO_WAIT);
        }
    }
}

void board_send(const void *bytes, size_t n)
{
    for (size_t i = 0u; i < n; i++) {
        uart_poll_out(line, ((const uint8_t *)bytes)[i]);
    }
}

size_t board_receive(void *bytes, size_t room)
{
    size_t n = 0u;
    while (n < room && k_msgq_get(&received, (uint8_t *)bytes + n, n == 0u ? K_MSEC(2) : K_NO_WAIT) == 0) {
        n++;
    }
    return n;
}

int64_t board_time(void)
{
    return (int64_t)k_ticks_to_ns_floor64((uint64_t)k_uptime_ticks());
}

void board_watch(void)
{
    static int channel = -1;
    if (channel < 0) {
        const struct wdt_timeout_cfg patience = {.window = {.min = 0u, .max = PATIENCE_MS},
                                                 .flags = WDT_FLAG_RESET_SOC};
        channel = wdt_install_timeout(watchdog, &patience);
        (void)wdt_setup(watchdog, WDT_OPT_PAUSE_HALTED_BY_DBG);
    }
    (void)wdt_feed(watchdog, channel);
}

void *board_keep(size_t size)
{
    static __noinit uint64_t kept[2560];
    return size <= sizeof kept ? kept : NULL;
}

static void fly(void *unused, void *nor_this, void *nor_that)
{
    (void)unused;
    (void)nor_this;
    (void)nor_that;
    (void)uart_irq_callback_user_data_set(line, line_interrupt, NULL);
    uart_irq_rx_enable(line);
    (void)fledge_fly();
    sys_reboot(SYS_REBOOT_WARM); /* for the next run */
}

K_THREAD_DEFINE(flight, STACK, fly, NULL, NULL, NULL, PRIORITY, K_FP_REGS, 0);
