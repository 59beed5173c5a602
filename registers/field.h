/* SPDX-License-Identifier: Apache-2.0 */
/* Fields of words and packets: counts of a converter and what they mean. */
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

/** The i-th number of a field in a packet. */
double register_field_read(const RegisterField *field, const void *packet, uint32_t i);

/** Write the i-th number of a field into a packet. 1: it is limited to the ends of the field's range. */
int register_field_write(const RegisterField *field, void *packet, uint32_t i, double value);

#ifdef __cplusplus
}
#endif

#endif
