/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: checks the support of a board and its C library. It prints a line for each failure, and "checked" at the
 * end; a letter through the line then requests an action, mostly a fault. */
#include "targets/bare/memory.h"
#include "targets/bare/port.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(expression)                                                                                              \
    do {                                                                                                               \
        if (!(expression)) {                                                                                           \
            printf("line %d: %s\n", __LINE__, #expression);                                                            \
        }                                                                                                              \
    } while (0)

typedef struct Kept {
    uint64_t begun;
    uint32_t starts;
} Kept;

/** Of the board: start anew, with the memory as it is. */
void board_reset(void) __attribute__((noreturn));

static volatile uint32_t initial = 0x1234u, zero;
static volatile double sum;

/* Registers of all kinds live over many interrupts: of the timer, and of the bytes that come meanwhile. */
static __attribute__((noinline)) uint64_t calculate(void)
{
    double x = 1.0, y = 0.0;
    uint64_t n = 1u;
    for (uint32_t i = 1u; i < 200000u; i++) {
        x = x * 0.9990234375 + y * 0.25;
        y = y * 0.5 - x / 16.0 + (double)(n % 7u);
        n = n * 6364136223846793005u + i / 3u;
    }
    sum = x + y;
    uint64_t bits;
    const double now = sum;
    memcpy(&bits, &now, sizeof bits);
    return bits ^ n;
}

static __attribute__((noinline)) uint32_t deeper(uint32_t n)
{
    volatile uint8_t here[256];
    here[n % sizeof here] = (uint8_t)n;
    return n == UINT32_MAX ? 0u : deeper(n + 1u) + here[n % sizeof here];
}

/* Not static, so that a test finds them by name. */
void wild_call(void) __attribute__((noinline));
void wild_store(void) __attribute__((noinline));
void wild_load(void) __attribute__((noinline));
void wild_code(void) __attribute__((noinline));
void wild_quotient(void) __attribute__((noinline));

void wild_call(void)
{
    ((void (*)(void))(uintptr_t)0x11u)();
}

void wild_store(void)
{
    static uint32_t *volatile nowhere;
    nowhere[2] = 1u;
}

void wild_load(void)
{
    (void)*(volatile uint32_t *)(uintptr_t)UINT64_C(0x7070000000); /* the lower half of it, with 32 bits */
}

void wild_code(void)
{
    *(volatile uint32_t *)((uintptr_t)board_code_end - 8u) = 1u;
}

void wild_quotient(void)
{
    initial = initial / zero;
}

static void obey(char order)
{
    switch (order) {
    case 'c': wild_call(); break;
    case 's': wild_store(); break;
    case 'l': wild_load(); break;
    case 'p': wild_code(); break;
    case 'd': wild_quotient(); break;
    case 'f': zero = deeper(0u); break;
    case 'r': board_reset();
    case 'w':
        for (;;) { /* and never calls board_watch */
        }
    case 'e': exit(7);
    default: break;
    }
}

int main(void)
{
    Kept *kept = board_keep(sizeof *kept);
    kept->starts = kept->begun == 0x600Du ? kept->starts + 1u : 1u;
    kept->begun = 0x600Du;
    printf("start %u\n", (unsigned)kept->starts);
    CHECK(initial == 0x1234u && zero == 0u);
    initial = zero = 1u;

    const uint64_t alone = calculate();
    const int64_t begin = board_time();
    uint32_t rounds = 0u;
    while (board_time() < begin + 50000000) { /* ten beats */
        CHECK(calculate() == alone);
        rounds++;
    }
    CHECK(rounds > 0u);

    errno = 0;
    CHECK(strtod("1e999", NULL) > 1e300 && errno == ERANGE);
    static volatile double tiny = 0x1p-1070, two = 2.0;
    CHECK(tiny * 0x1p100 == 0x1p-970 && tiny / two == 0x1p-1071); /* denormal numbers stay */
    CHECK(sqrt(two) == 0x1.6a09e667f3bcdp+0);

    initial = zero = 0u;
    board_watch();
    printf("checked\n");
    for (char order = 0; order != '.';) {
        board_watch();
        if (board_receive(&order, 1u) == 1u) {
            obey(order);
        }
    }
    return 0;
}
