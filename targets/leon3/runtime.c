/* SPDX-License-Identifier: Apache-2.0 */
/* Functions of the compiler for numbers of 64 bits, which SPARC V8 lacks. The compiler's own library is for V9. */
#include <stdint.h>

uint64_t __udivmoddi4(uint64_t n, uint64_t d, uint64_t *rest);
uint64_t __udivdi3(uint64_t n, uint64_t d);
uint64_t __umoddi3(uint64_t n, uint64_t d);
int64_t __divdi3(int64_t n, int64_t d);
int64_t __moddi3(int64_t n, int64_t d);
int64_t __muldi3(int64_t a, int64_t b);
int64_t __ashldi3(int64_t a, int n);
int64_t __lshrdi3(int64_t a, int n);
int64_t __ashrdi3(int64_t a, int n);
int __clzsi2(uint32_t a);
int __clzdi2(uint64_t a);
int __ctzsi2(uint32_t a);
int __popcountsi2(uint32_t a);
uint32_t __bswapsi2(uint32_t a);
uint64_t __bswapdi2(uint64_t a);
int __cmpdi2(int64_t a, int64_t b);
int __ucmpdi2(uint64_t a, uint64_t b);
double __floatundidf(uint64_t a);
double __floatdidf(int64_t a);
float __floatundisf(uint64_t a);
float __floatdisf(int64_t a);
uint64_t __fixunsdfdi(double a);
int64_t __fixdfdi(double a);
uint64_t __fixunssfdi(float a);
int64_t __fixsfdi(float a);

#define HIGH(a) ((uint32_t)((uint64_t)(a) >> 32))
#define LOW(a) ((uint32_t)(a))
#define JOIN(high, low) ((uint64_t)(uint32_t)(high) << 32 | (uint32_t)(low))

/* high:low / d, where high < d. */
static uint32_t divide(uint32_t high, uint32_t low, uint32_t d)
{
    uint32_t q;
    __asm__("wr %1, %%y\n\tnop\n\tnop\n\tnop\n\tudiv %2, %3, %0" : "=r"(q) : "r"(high), "r"(low), "r"(d) : "cc");
    return q;
}

int __clzsi2(uint32_t a)
{
    int n = 32;
    while (a != 0u) {
        a >>= 1;
        n--;
    }
    return n;
}

int __clzdi2(uint64_t a)
{
    return HIGH(a) != 0u ? __clzsi2(HIGH(a)) : 32 + __clzsi2(LOW(a));
}

int __ctzsi2(uint32_t a)
{
    return 31 - __clzsi2(a & -a);
}

int __popcountsi2(uint32_t a)
{
    int n = 0;
    for (; a != 0u; a &= a - 1u) {
        n++;
    }
    return n;
}

uint32_t __bswapsi2(uint32_t a)
{
    return a << 24 | (a & 0xFF00u) << 8 | (a >> 8 & 0xFF00u) | a >> 24;
}

uint64_t __bswapdi2(uint64_t a)
{
    return JOIN(__bswapsi2(LOW(a)), __bswapsi2(HIGH(a)));
}

int __ucmpdi2(uint64_t a, uint64_t b)
{
    return HIGH(a) != HIGH(b) ? (HIGH(a) < HIGH(b) ? 0 : 2) : LOW(a) < LOW(b) ? 0 : LOW(a) > LOW(b) ? 2 : 1;
}

int __cmpdi2(int64_t a, int64_t b)
{
    return __ucmpdi2((uint64_t)a ^ JOIN(0x80000000u, 0), (uint64_t)b ^ JOIN(0x80000000u, 0));
}

/* ---- shifts: the compiler must not see one of 64 bits in them */

int64_t __ashldi3(int64_t a, int n)
{
    const uint32_t high = HIGH(a), low = LOW(a);
    return (int64_t)(n == 0   ? (uint64_t)a
                     : n < 32 ? JOIN(high << n | low >> (32 - n), low << n)
                              : JOIN(low << (n - 32), 0));
}

int64_t __lshrdi3(int64_t a, int n)
{
    const uint32_t high = HIGH(a), low = LOW(a);
    return (int64_t)(n == 0   ? (uint64_t)a
                     : n < 32 ? JOIN(high >> n, low >> n | high << (32 - n))
                              : JOIN(0, high >> (n - 32)));
}

int64_t __ashrdi3(int64_t a, int n)
{
    const int32_t high = (int32_t)HIGH(a);
    const uint32_t low = LOW(a);
    return (int64_t)(n == 0   ? (uint64_t)a
                     : n < 32 ? JOIN(high >> n, low >> n | (uint32_t)high << (32 - n))
                              : JOIN(high >> 31, high >> (n - 32)));
}

/* ---- products and quotients */

int64_t __muldi3(int64_t a, int64_t b)
{
    const uint64_t low = (uint64_t)LOW(a) * LOW(b); /* one instruction */
    return (int64_t)JOIN(HIGH(low) + HIGH(a) * LOW(b) + LOW(a) * HIGH(b), LOW(low));
}

uint64_t __udivmoddi4(uint64_t n, uint64_t d, uint64_t *rest)
{
    uint64_t q;
    if (HIGH(d) == 0u) {
        const uint32_t high = HIGH(n) / LOW(d); /* a trap if d is 0 */
        const uint32_t left = HIGH(n) - high * LOW(d);
        q = JOIN(high, divide(left, LOW(n), LOW(d)));
    } else {
        /* By the 32 highest bits of d; what that gives is at most 1 too much. */
        const int shift = __clzsi2(HIGH(d));
        q = (uint64_t)divide(HIGH(n >> 1), LOW(n >> 1), HIGH(d << shift)) << shift >> 31;
        q -= q != 0u;
        q += n - q * d >= d;
    }
    if (rest) {
        *rest = n - q * d;
    }
    return q;
}

uint64_t __udivdi3(uint64_t n, uint64_t d)
{
    return __udivmoddi4(n, d, 0);
}

uint64_t __umoddi3(uint64_t n, uint64_t d)
{
    uint64_t rest;
    (void)__udivmoddi4(n, d, &rest);
    return rest;
}

static uint64_t magnitude(int64_t a)
{
    return a < 0 ? 0u - (uint64_t)a : (uint64_t)a;
}

int64_t __divdi3(int64_t n, int64_t d)
{
    const uint64_t q = __udivmoddi4(magnitude(n), magnitude(d), 0);
    return (int64_t)((n < 0) != (d < 0) ? 0u - q : q);
}

int64_t __moddi3(int64_t n, int64_t d)
{
    uint64_t rest;
    (void)__udivmoddi4(magnitude(n), magnitude(d), &rest);
    return (int64_t)(n < 0 ? 0u - rest : rest);
}

/* ---- floating point: each result is rounded once, because both halves are exact */

#define TWO_TO_32 4294967296.0

double __floatundidf(uint64_t a)
{
    return (double)HIGH(a) * TWO_TO_32 + (double)LOW(a);
}

double __floatdidf(int64_t a)
{
    return (double)(int32_t)HIGH(a) * TWO_TO_32 + (double)LOW(a);
}

/* The bits that a float cannot have become one, which keeps its direction of rounding. */
float __floatundisf(uint64_t a)
{
    return (float)__floatundidf(HIGH(a) >> 21 != 0u ? (a & ~UINT64_C(0xFFF)) | ((a & 0xFFFu) != 0u) << 11 : a);
}

float __floatdisf(int64_t a)
{
    return a < 0 ? -__floatundisf(magnitude(a)) : __floatundisf((uint64_t)a);
}

uint64_t __fixunsdfdi(double a)
{
    const uint32_t high = (uint32_t)(a / TWO_TO_32);
    return JOIN(high, (uint32_t)(a - (double)high * TWO_TO_32));
}

int64_t __fixdfdi(double a)
{
    return (int64_t)(a < 0.0 ? 0u - __fixunsdfdi(-a) : __fixunsdfdi(a));
}

uint64_t __fixunssfdi(float a)
{
    return __fixunsdfdi((double)a);
}

int64_t __fixsfdi(float a)
{
    return __fixdfdi((double)a);
}
