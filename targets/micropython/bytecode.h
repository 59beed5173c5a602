/* SPDX-License-Identifier: Apache-2.0 */
/* Bytecode from the ground, before it runs. The interpreter trusts its compiler: it checks neither the stack that an
 * instruction needs nor where a jump leads. */
#ifndef TARGETS_MICROPYTHON_BYTECODE_H
#define TARGETS_MICROPYTHON_BYTECODE_H

#include <stddef.h>
#include <stdint.h>

/** Whether a file of bytecode is whole, and runs within its stack on every path: instructions, operands, constants,
 *  jumps, and handlers of exceptions. work: memory for the states at jumps; a function with more of them is refused. */
int bytecode_is_sound(const uint8_t *bytes, uint32_t n, void *work, size_t size);

#endif
