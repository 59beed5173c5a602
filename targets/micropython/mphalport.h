/* SPDX-License-Identifier: Apache-2.0 */
/* The interpreter has no pins, clocks or keys: its time and its data come from the executive. */
#ifndef TARGETS_MICROPYTHON_MPHALPORT_H
#define TARGETS_MICROPYTHON_MPHALPORT_H

#define mp_hal_pin_obj_t int

#endif
