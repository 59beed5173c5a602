/* SPDX-License-Identifier: Apache-2.0 */
/* The composition of a mission's script: `f`, its flight process, and `sim`, of which that process flies here. */
#ifndef TARGETS_MICROPYTHON_PROCESS_H
#define TARGETS_MICROPYTHON_PROCESS_H

#include "targets/micropython/tables.h"

#include <py/obj.h>

/** `f`, once executive_begin has created its tables. */
mp_obj_t process_object(void);

/** The module of a place; MP_OBJ_NULL: none yet. */
mp_obj_t process_instance(uint16_t place);

#endif
