/* SPDX-License-Identifier: Apache-2.0 */
/* fledge.units in C: quantities with the operators of python/fledge/units.py, and the same bits. */
#ifndef TARGETS_MICROPYTHON_UNITS_H
#define TARGETS_MICROPYTHON_UNITS_H

#include "targets/micropython/tables.h"

#include <py/obj.h>

extern const mp_obj_type_t mp_type_UnitError;
extern const mp_obj_module_t script_units_module;

/** A quantity, or NULL. */
const ScriptQuantity *units_quantity(mp_obj_t value);

/** Whether exponents are alike; rad does not count. */
int units_alike(const int8_t *a, const int8_t *b);

/** "N m", "rad/s"; nothing if dimensionless. */
void units_print(const mp_print_t *print, const int8_t *dims);

/** A time, a quantity or a number of seconds, in the nearest whole number of nanoseconds. NULL, or the type of the
 *  error whose text it has printed. */
const mp_obj_type_t *units_time(mp_obj_t value, int64_t *ns, const mp_print_t *error);

/** objfloat.c calls it for mp_obj_get_float_maybe: a quantity without dimension stays a quantity in `2.0 * deg`. */
bool units_plain_number(mp_obj_t value, mp_float_t *number);

#endif
