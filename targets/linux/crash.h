/* SPDX-License-Identifier: Apache-2.0 */
/* The report of a program that a trap ends: the signal, the time, and the command of a debugger. */
#ifndef TARGETS_LINUX_CRASH_H
#define TARGETS_LINUX_CRASH_H

#include <stdint.h>

/** From now on. The texts must stay; t: [ns] the time of the present exchange, < 0 before the first. */
void crash_report(const char *name, char **words, const volatile int64_t *t);

#endif
