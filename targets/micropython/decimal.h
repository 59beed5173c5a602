/* SPDX-License-Identifier: Apache-2.0 */
/* Doubles as decimal text, exactly: what is read is the nearest double, ties to even; what is written is rounded once.
 * MicroPython's own conversions are off by a unit now and then, so that a parameter would have other bits than on the
 * desktop. Here and in the cross-compiler these take their place. */
#ifndef TARGETS_MICROPYTHON_DECIMAL_H
#define TARGETS_MICROPYTHON_DECIMAL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A precision: as few digits as read back exactly, as Python's repr(). */
enum { DECIMAL_SHORTEST = 127 };

/** The double of n characters: digits, a point, more digits, an exponent: "1_234.5e-6". They may end after each of
 *  these. */
double decimal_read(const char *text, size_t n);

/** The double nearest to a double rounded to digits behind the point, or before it if digits < 0; a tie to even. */
double decimal_round(double value, int64_t digits);

/** Write a double with its ending 0 and return its length. format: e, f, g, E, F or G, as of printf; precision: of
 *  printf, < 0: 6; sign: what a number without a minus begins with, 0: nothing. What does not fit in format f takes
 *  format e, with fewer digits if it must. A size of less than 10 is too small for any number: the text is empty. */
int decimal_format(double value, char *text, size_t size, char format, int precision, char sign);

#ifdef __cplusplus
}
#endif

#endif
