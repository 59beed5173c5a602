/* SPDX-License-Identifier: Apache-2.0 */
/* Fields of words: counts of a converter and what they mean. */
#ifndef REGISTERS_FIELD_H
#define REGISTERS_FIELD_H

#include "registers/board.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The field's count in a word, sign extended. */
int64_t register_field_count(const RegisterField *field, uint32_t word);

/** The word with the field set to a count. Bits beyond the field's are dropped. */
uint32_t register_field_place(const RegisterField *field, uint32_t word, int64_t count);

/** offset + scale * count, in the field's unit. */
double register_field_value(const RegisterField *field, int64_t count);

/** The count nearest to a value, halves away from zero; beyond the field's ends, the end. A NaN gives
 *  the lower end. *saturated, unless NULL, is then 1, else 0. */
int64_t register_field_quantise(const RegisterField *field, double value, int *saturated);

#ifdef __cplusplus
}
#endif

#endif
