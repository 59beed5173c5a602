/* SPDX-License-Identifier: Apache-2.0 */
#ifndef ZEPHYR_DRIVERS_WATCHDOG_H
#define ZEPHYR_DRIVERS_WATCHDOG_H

#include <stdint.h>
#include <zephyr/device.h>

#define WDT_OPT_PAUSE_HALTED_BY_DBG (1u << 1)
#define WDT_FLAG_RESET_SOC 2u

struct wdt_window {
    uint32_t min;
    uint32_t max;
};
struct wdt_timeout_cfg {
    struct wdt_window window;
    void (*callback)(const struct device *watchdog, int channel);
    uint8_t flags;
};

int wdt_install_timeout(const struct device *watchdog, const struct wdt_timeout_cfg *timeout);
int wdt_setup(const struct device *watchdog, uint8_t options);
int wdt_feed(const struct device *watchdog, int channel);

#endif
