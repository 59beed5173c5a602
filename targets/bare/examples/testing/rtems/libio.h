/* SPDX-License-Identifier: Apache-2.0 */
#ifndef RTEMS_LIBIO_H
#define RTEMS_LIBIO_H

#include <rtems.h>

rtems_status_code rtems_termios_bufsize(size_t cooked, size_t raw_input, size_t raw_output);

#endif
