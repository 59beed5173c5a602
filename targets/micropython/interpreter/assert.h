/* SPDX-License-Identifier: Apache-2.0 */
/* What the interpreter asserts is checked in flight, too: a script for which it does not hold ends. But what vm.c
 * asserts of bytecode, bytecode.c has checked. */
#undef assert
#ifdef BYTECODE_IS_SOUND
#define assert(holds) ((void)0)
#else
#define assert(holds) ((holds) ? (void)0 : script_broken())
#endif
