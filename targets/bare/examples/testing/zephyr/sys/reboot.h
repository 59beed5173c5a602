/* SPDX-License-Identifier: Apache-2.0 */
#ifndef ZEPHYR_SYS_REBOOT_H
#define ZEPHYR_SYS_REBOOT_H

#define SYS_REBOOT_WARM 0

void sys_reboot(int type) __attribute__((noreturn));

#endif
