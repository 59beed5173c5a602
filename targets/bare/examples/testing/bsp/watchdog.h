/* SPDX-License-Identifier: Apache-2.0 */
#ifndef BSP_WATCHDOG_H
#define BSP_WATCHDOG_H

void bsp_watchdog_reload(int watchdog, unsigned int microseconds);
void bsp_watchdog_system_reset(void);

#endif
