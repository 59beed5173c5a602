/* SPDX-License-Identifier: Apache-2.0 */
/* From Python's values to a field's bytes: convert, check, and undo if a check fails. */
#ifndef TARGETS_MICROPYTHON_ASSIGN_H
#define TARGETS_MICROPYTHON_ASSIGN_H

#include "targets/micropython/objects.h"

/** Assign from keywords or a dict, in the order of the fields, so that the array that sets a count comes before a
 *  number that fills it. apart: three keywords that are no fields, or MP_QSTRnull. Returns the first name that is no
 *  field, or MP_QSTRnull. */
qstr assign_all(ScriptNode *node, mp_map_t *values, const qstr *apart);

/** Assign to one number of an array, `at` bytes from the start of the node. */
void assign_element(ScriptNode *node, const ScriptField *field, uint32_t at, mp_obj_t value);

/** The item k of a value that stands for n: of a number, the number itself. */
mp_obj_t assign_item(mp_obj_t value, uint32_t k, uint32_t n);

#endif
