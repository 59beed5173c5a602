/* SPDX-License-Identifier: Apache-2.0 */
/* Prints a 64-bit FNV-1a hash of the results of each elementary function over a fixed sequence of
 * arguments. Equal hashes on two machines mean equal bits; cross_hash_test.py compares them.
 *
 * With FREESTANDING defined it needs no C library: Debian has none for 32-bit SPARC. */
#include <stdint.h>

#include "flight/math/elementary.h"
#include "flight/math/ieee.h"

enum { ARGUMENTS = 200000 };

/* ---- output ---------------------------------------------------------------------------- */

static int run(void);

#if defined(FREESTANDING) && defined(__sparc__)

/* System calls of 32-bit SPARC Linux: number in g1, trap 0x10. */
static long system_call(long number, long a, long b, long c)
{
    register long g1 __asm__("g1") = number;
    register long o0 __asm__("o0") = a;
    register long o1 __asm__("o1") = b;
    register long o2 __asm__("o2") = c;
    __asm__ volatile("ta 0x10" : "+r"(o0) : "r"(g1), "r"(o1), "r"(o2) : "memory", "cc");
    return o0;
}

static int print(const char *text, uint32_t length)
{
    enum { STANDARD_OUTPUT = 1, WRITE = 4 };
    return system_call(WRITE, STANDARD_OUTPUT, (long)text, (long)length) == (long)length;
}

void _start(void);
void _start(void)
{
    enum { EXIT = 1 };
    (void)system_call(EXIT, run(), 0, 0);
    for (;;) {
    }
}

#else

#include <stdio.h>

static int print(const char *text, uint32_t length)
{
    return fwrite(text, 1, length, stdout) == length;
}

int main(void)
{
    return run();
}

#endif

/* ---- arguments ------------------------------------------------------------------------- */

/* splitmix64 (Steele, Lea and Flood, 2014). */
static uint64_t random_bits(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* In turn: any double at all, NaN and infinities included; a size that occurs in practice; a ratio
 * in [-1, 1]; and a number of the size of an angle or an exponent. */
static double argument(uint64_t *state, uint32_t i)
{
    const uint64_t bits = random_bits(state);
    const double ratio = (double)(int32_t)(uint32_t)(bits >> 32) * 0x1p-31 + (double)(uint32_t)bits * 0x1p-63;
    switch (i % 4) {
    case 0: return fm_from_bits(bits);
    case 1: return fm_from_bits((bits & ~((uint64_t)0x7c0 << 52)) | (uint64_t)0x3e0 << 52);
    case 2: return ratio;
    default: return ratio * 750.0;
    }
}

/* ---- hashes ---------------------------------------------------------------------------- */

/* Byte by byte from the least significant on, whatever the byte order; all NaN count as one. */
static uint64_t hash_double(uint64_t hash, double x)
{
    uint64_t bits = x == x ? fm_bits(x) : 0x7ff8000000000000u;
    for (int i = 0; i < 8; ++i) {
        hash = (hash ^ (bits & 0xff)) * 0x100000001b3u;
        bits >>= 8;
    }
    return hash;
}

typedef enum Function { SIN, COS, SINCOS, TAN, ASIN, ACOS, ATAN, ATAN2, EXP, LOG, POW, SQRT } Function;

static const char NAMES[][8] = {
    "sin", "cos", "sincos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "sqrt",
};

static uint64_t hash_of(Function function)
{
    uint64_t state = 20240229;
    uint64_t hash = 0xcbf29ce484222325u;
    for (uint32_t i = 0; i < ARGUMENTS; ++i) {
        const double x = argument(&state, i);
        double y, second = 0.0;
        switch (function) {
        case SIN: y = fm_sin(x); break;
        case COS: y = fm_cos(x); break;
        case SINCOS: fm_sincos(x, &y, &second); break;
        case TAN: y = fm_tan(x); break;
        case ASIN: y = fm_asin(x); break;
        case ACOS: y = fm_acos(x); break;
        case ATAN: y = fm_atan(x); break;
        case ATAN2: y = fm_atan2(x, argument(&state, i / 4)); break;
        case EXP: y = fm_exp(x); break;
        case LOG: y = fm_log(x); break;
        case POW: y = fm_pow(i % 2 ? x : fm_abs(x), argument(&state, i / 4)); break;
        default: y = fm_sqrt(x); break;
        }
        hash = hash_double(hash_double(hash, y), second);
    }
    return hash;
}

/* One line per function: its name and its hash in hexadecimal. */
static int run(void)
{
    int printed = 1;
    for (uint32_t f = 0; f < sizeof NAMES / sizeof NAMES[0]; ++f) {
        const uint64_t hash = hash_of((Function)f);
        char line[32];
        uint32_t length = 0;
        while (NAMES[f][length] != '\0') {
            line[length] = NAMES[f][length];
            ++length;
        }
        line[length++] = ' ';
        for (int shift = 60; shift >= 0; shift -= 4) {
            line[length++] = "0123456789abcdef"[hash >> shift & 15];
        }
        line[length++] = '\n';
        printed &= print(line, length);
    }
    return printed ? 0 : 1;
}
