/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: checks the board support and the C library on a board. It prints a line for each failure, and "checked" at
 * the end. Compiled with -DFAULT it then jumps to an odd address; with -DRESET it is reset by its own wish, then by the
 * watchdog. */
#include "targets/leon3/leon3.h"

#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(expression)                                                                                              \
    do {                                                                                                               \
        if (!(expression)) {                                                                                           \
            printf("line %d: %s\n", __LINE__, #expression);                                                            \
        }                                                                                                              \
    } while (0)

static volatile uint32_t interrupts;
static volatile double sum;

/* Deeper than the windows: locals, arguments and results survive spills and fills. */
static __attribute__((noinline)) uint32_t deep(uint32_t n, uint32_t a, uint32_t b)
{
    volatile uint32_t here = n * a + b;
    const uint32_t below = n == 0u ? 0u : deep(n - 1u, a + 1u, b ^ n);
    return here == n * a + b ? below + here : 0u;
}

static uint32_t expected(uint32_t n, uint32_t a, uint32_t b)
{
    uint32_t total = 0u;
    for (;; n--) {
        total += n * a + b;
        if (n == 0u) {
            return total;
        }
        a++;
        b ^= n;
    }
}

/* An interrupt spoils windows, floating-point registers, condition codes and Y. */
static void disturb(void)
{
    volatile double x = sum;
    interrupts++;
    x = x * 1.5 + sqrt((double)interrupts);
    (void)deep(11u, interrupts, 5u);
    (void)(UINT64_C(0x123456789) * interrupts / 77u);
}

typedef struct Results {
    double x, y;
    float z;
    uint64_t n;
    uint32_t m, windows;
} Results;

/* Calculations in which each register, Y and the condition codes matter at many instructions. */
static __attribute__((noinline)) Results calculate(void)
{
    Results r = {1.0, 0.0, 1.0f, 1u, 12345u, 0u};
    for (uint32_t i = 1u; i < 400u; i++) {
        r.x = r.x * 1.0625 - r.y;
        r.y = r.y + r.x / 16.0;
        r.z = r.z * 0.75f + (float)r.x;
        r.n = r.n * 7u + i;
        r.m = r.m * 1103515245u + r.n % i + r.m / i;
        r.m ^= (int32_t)r.m < 0 ? i << 7 : r.m >> 3;
        r.windows += deep(i % 20u, r.m, i) == expected(i % 20u, r.m, i);
    }
    return r;
}

static void check_interrupts(void)
{
    const Results alone = calculate();
    CHECK(alone.windows == 399u);
    leon3_on_interrupt(5u, disturb);
    leon3_on_interrupt(9u, disturb);
    for (uint32_t i = 0u; i < 60u; i++) {
        *(volatile uint32_t *)(uintptr_t)(leon3.interrupts + 8u) = 1u << 5 | 1u << 9; /* force both */
        for (volatile uint32_t k = 0u; k < 100000u && interrupts < 2u * i + 2u; k++) {
        }
        CHECK(interrupts == 2u * i + 2u);
    }
    /* At any instruction: by a timer, whose period in us shares no divisor with the calculation. */
    leon3_on_interrupt(leon3.timer_line, disturb);
    volatile uint32_t *const timer = (volatile uint32_t *)(uintptr_t)(leon3.timers + 0x10u);
    timer[1] = 100u;
    timer[2] = 0xFu;
    for (uint32_t i = 0u; i < 60u || (interrupts < 400u && i < 10000u); i++) {
        const Results r = calculate();
        CHECK(r.x == alone.x && r.y == alone.y && r.z == alone.z && r.n == alone.n && r.m == alone.m);
        CHECK(r.windows == alone.windows);
    }
    timer[2] = 0u;
    CHECK(interrupts >= 400u);
}

static jmp_buf there;

static __attribute__((noinline)) void leap(int n)
{
    volatile int here = n;
    if (here == 0) {
        longjmp(there, 42);
    }
    if (here > 0) {
        leap(here - 1);
    }
    here++;
}

static void check_leaps(void)
{
    volatile int count = 7;
    for (volatile int depth = 0; depth < 20; depth++) {
        const int value = setjmp(there);
        if (value == 0) {
            leap(depth);
            CHECK(0);
        }
        CHECK(value == 42 && count == 7 + depth);
        count++;
    }
}

static BareContext first, second;
static uint64_t stack[1024];
static uint32_t turns;

static __attribute__((noinline)) void hop(uint32_t n, const BareContext *to, BareContext *from)
{
    volatile uint32_t here = n;
    if (n == 0u) {
        bare_switch(from, to);
    } else {
        hop(n - 1u, to, from);
    }
    CHECK(here == n);
}

static void other(uint32_t argument)
{
    CHECK(argument == 99u);
    for (uint32_t i = 0u;; i++) {
        turns++;
        hop(i % 12u, &first, &second);
    }
}

static void check_contexts(void)
{
    second = bare_context(stack, sizeof stack, other, 99u);
    for (uint32_t i = 0u; i < 50u; i++) {
        hop((i * 7u) % 13u, &second, &first);
    }
    CHECK(turns == 50u);
}

static void check_long_numbers(void)
{
    static volatile uint64_t values[] = {0u,
                                         1u,
                                         2u,
                                         10u,
                                         0xFFFFFFFFu,
                                         0x100000000u,
                                         0x123456789ABCDEFu,
                                         0x8000000000000000u,
                                         0xFFFFFFFFFFFFFFFFu,
                                         1000000000u,
                                         0x7FFFFFFFFFFFFFFFu};
    const uint32_t n = sizeof values / sizeof values[0];
    for (uint32_t i = 0u; i < n; i++) {
        for (uint32_t j = 1u; j < n; j++) {
            const uint64_t a = values[i], b = values[j], q = a / b, r = a % b;
            CHECK(r < b && q * b + r == a && (b == 1u || q <= a / 2u));
            const int64_t c = (int64_t)a, d = (int64_t)b;
            if (c != INT64_MIN || d != -1) {
                CHECK(c / d * d + c % d == c && (c % d == 0 || (c % d < 0) == (c < 0)));
            }
        }
        uint64_t a = values[i] | 1u, b = 3u;
        for (uint32_t k = 0u; k < 300u; k++) {
            a = a * UINT64_C(6364136223846793005) + 1442695040888963407u;
            b = b * UINT64_C(2862933555777941757) + 3037000493u;
            const uint64_t d = (b >> (k % 48u)) | 1u, n = k % 2u ? a : d * (a >> 40) - 1u;
            CHECK(n / d * d + n % d == n && n % d < d);
            /* Here an estimate by the highest 32 bits is 1 too much. */
            const uint64_t d2 = (b >> 30) | 1u, q2 = a >> 35;
            CHECK((d2 * q2 - 1u) / d2 == q2 - 1u);
        }
        for (volatile int k = 0; k < 64; k++) {
            uint64_t left = values[i], right = values[i];
            int64_t copies = (int64_t)values[i];
            for (int m = 0; m < k; m++) {
                left += left;
                right = right >> 1;
                copies = copies >> 1;
            }
            CHECK(values[i] << k == left && values[i] >> k == right && (int64_t)values[i] >> k == copies);
        }
    }
    static volatile double d;
    d = -123456789012345.75;
    CHECK((int64_t)d == INT64_C(-123456789012345));
    d = 18446744073709549568.0;
    CHECK((uint64_t)d == UINT64_C(0xFFFFFFFFFFFFF800));
    static volatile uint64_t u = UINT64_C(0x8000008000000001);
    CHECK((float)u == 0x1.000002p63f && (double)u == 0x1.00000100000000p63);
    static volatile int64_t s = INT64_C(-9007199254740993);
    CHECK((double)s == -9007199254740992.0);
}

static void check_library(void)
{
    char text[80];
    (void)snprintf(text, sizeof text, "%s %5d %#llx %.17g %a %e", "text", -42, 0x123456789ABULL, 0.1, 1.0 / 3.0, 1e300);
    CHECK(strcmp(text, "text   -42 0x123456789ab 0.10000000000000001 0x1.5555555555555p-2 1.000000e+300") == 0);
    CHECK(strtod("2.2250738585072014e-308", NULL) == 0x1p-1022);
    char *p = malloc(1000000u);
    CHECK(p != NULL);
    memset(p, 1, 1000000u);
    free(p);
    CHECK(malloc(100000000u) == NULL);
    static volatile double tiny = 0x1p-1070, two = 2.0;
    CHECK(tiny * 0x1p100 == 0.0 || tiny * 0x1p100 == 0x1p-970); /* by GRFPU, and by QEMU */
    CHECK(sqrt(two) == 0x1.6a09e667f3bcdp+0 && sin(two) == 0x1.d18f6ead1b446p-1 && exp(two) == 0x1.d8e64b8d4ddaep+2);
}

#ifdef RESET
static struct {
    uint32_t begun;
    uint32_t starts;
} kept __attribute__((section(".noinit")));

static void check_resets(void)
{
    kept.starts = kept.begun == 0x600Du ? kept.starts + 1u : 1u;
    kept.begun = 0x600Du;
    printf("start %u\n", (unsigned)kept.starts);
    if (kept.starts == 1u) {
        leon3_reset();
    }
    bare_watch();
    bare_idle();
    while (kept.starts == 2u) {
        __asm__ volatile("wr %g0, %asr19"); /* awake ten times a second, and never in bare_idle */
    }
}
#endif

int main(void)
{
    static uint32_t initial = 0x1234u, zero;
    CHECK(initial++ == 0x1234u && zero++ == 0u);
#ifdef RESET
    check_resets();
#endif
    check_interrupts();
    check_leaps();
    check_contexts();
    check_long_numbers();
    check_library();
    const int64_t begin = bare_now();
    while (bare_now() < begin + 2000000) {
    }
    CHECK(leon3_stack_used() > 400u && leon3_stack_used() < leon3_stack_size());
    printf("checked\n");
#ifdef FAULT
    ((void (*)(void))(uintptr_t)0x40000002u)();
#endif
    return 0;
}
