/* SPDX-License-Identifier: Apache-2.0 */
/* Four of the five functions of targets/bare/port.h for a process of Linux, whose line is two descriptors. The process
 * ends with status 3 when the line does. */
#ifndef TARGETS_LINUX_LINE_IO_H
#define TARGETS_LINUX_LINE_IO_H

#include "targets/bare/port.h"

extern int line_in, line_out; ///< standard input and output, unless the program chooses others

#endif
