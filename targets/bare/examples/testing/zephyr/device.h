/* SPDX-License-Identifier: Apache-2.0 */
#ifndef ZEPHYR_DEVICE_H
#define ZEPHYR_DEVICE_H

#include <zephyr/devicetree.h>

struct device {
    const char *name;
};
extern const struct device device_of_fledge_line, device_of_watchdog0;
#define DEVICE_OF(node) (&device_of_##node)
#define DEVICE_DT_GET(node) DEVICE_OF(node)

#endif
