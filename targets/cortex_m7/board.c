/* SPDX-License-Identifier: Apache-2.0 */
/* The five functions of the board: its first UART is the line, a timer counts, SysTick ends any sleep. */
#include "targets/bare/port.h"
#include "targets/cortex_m7/cortex_m7.h"

enum { HZ = 25000000, BEATS_HZ = 200, BAUD = 921600 };

/* Of ARM's CMSDK. */
enum {
    UART = 0x40004000,
    UART_DATA = 0x0,
    UART_STATE = 0x4,
    UART_CONTROL = 0x8,
    UART_INTERRUPT = 0xC,
    UART_DIVIDER = 0x10,
    UART_FULL = 1 << 0,              /* to send */
    UART_COME = 1 << 1,              /* a byte has come */
    UART_BOTH = 3 << 0,              /* ways */
    UART_RECEIVE_INTERRUPT = 1 << 3, /* interrupt when a byte has come */
    UART_INTERRUPT_SEEN = 1 << 1
};
enum { TIMER = 0x40000000, TIMER_CONTROL = 0x0, TIMER_VALUE = 0x4, TIMER_RELOAD = 0x8, TIMER_ENABLE = 1 };
enum { WATCHDOG = 0x40008000, WATCHDOG_LOAD = 0x0, WATCHDOG_CONTROL = 0x8, WATCHDOG_CLEAR = 0xC, WATCHDOG_BOTH = 3 };
#define WATCHDOG_LOCK (WATCHDOG + 0xC00)
#define WATCHDOG_KEY 0x1ACCE551u

/* Of the processor. */
#define SYSTICK_CONTROL 0xE000E010u
#define SYSTICK_RELOAD 0xE000E014u
#define SYSTICK_VALUE 0xE000E018u
#define INTERRUPTS_ENABLE 0xE000E100u
#define FAULTS 0xE000ED24u
#define FAULTS_APART (7u << 16) /* memory, bus, usage: not all as one */
#define CONFIGURATION 0xE000ED14u
#define DIVISION_BY_ZERO (1u << 4)
#define MPU_CONTROL 0xE000ED94u
#define MPU_BASE 0xE000ED9Cu
#define MPU_ATTRIBUTES 0xE000EDA0u
enum { MPU_ON = 5 }; /* all else as without it */
enum { NO_ACCESS = 0 << 24, READ_ONLY = 6 << 24, NO_CODE = 1 << 28, SHARED_MEMORY = 7 << 16, REGION_ON = 1 };

enum { RING = 8192 }; /* bytes that have come: more than the other end sends before it awaits an answer */
static volatile uint8_t ring[RING];
static volatile uint32_t come, taken;

static uint32_t counted; /* of the timer, at the last read */
static uint64_t elapsed; /* counts */
static volatile uint32_t beats;
static uint32_t fed; /* the beat, plus 1, in which the watchdog was */

/* ---- the line */

void cortex_m7_receive(void)
{
    cortex_m7_store(UART + UART_INTERRUPT, UART_INTERRUPT_SEEN);
    while ((cortex_m7_load(UART + UART_STATE) & UART_COME) != 0u) {
        const uint8_t byte = (uint8_t)cortex_m7_load(UART + UART_DATA);
        if (come - taken < RING) { /* else it is lost: the other end sends it again */
            ring[come % RING] = byte;
            come = come + 1u;
        }
    }
}

void board_send(const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    while (n-- != 0u) {
        while ((cortex_m7_load(UART + UART_STATE) & UART_FULL) != 0u) {
        }
        cortex_m7_store(UART + UART_DATA, *p++);
    }
}

size_t board_receive(void *bytes, size_t room)
{
    uint8_t *p = bytes;
    size_t n = 0;
    (void)board_time(); /* often enough to see each turn of the timer */
    __asm__ volatile("cpsid i" ::: "memory");
    if (come == taken && room != 0u) {
        __asm__ volatile("dsb\n\twfi" ::: "memory"); /* an interrupt that waits ends it, too */
    }
    __asm__ volatile("cpsie i\n\tisb" ::: "memory");
    while (n < room && taken != come) {
        p[n++] = ring[taken % RING];
        taken = taken + 1u;
    }
    return n;
}

/* ---- time and watchdog */

/* It ends board_receive's sleep. */
void cortex_m7_beat(void)
{
    beats = beats + 1u;
}

int64_t board_time(void)
{
    const uint32_t count = cortex_m7_load(TIMER + TIMER_VALUE);
    elapsed += counted - count; /* it counts down */
    counted = count;
    return (int64_t)elapsed * (1000000000 / HZ);
}

/* The watchdog's first expiry is an exception, which reports the place in the program, its second one a reset. It is
 * fed once a beat. */
void board_watch(void)
{
    if (fed == beats + 1u) {
        return;
    }
    fed = beats + 1u;
    cortex_m7_store(WATCHDOG_LOCK, WATCHDOG_KEY);
    cortex_m7_store(WATCHDOG + WATCHDOG_LOAD, HZ / 1000u * BOARD_PATIENCE_MS);
    cortex_m7_store(WATCHDOG + WATCHDOG_CONTROL, WATCHDOG_BOTH);
    cortex_m7_store(WATCHDOG_LOCK, 0u);
}

/* ---- memory */

void *board_keep(size_t size)
{
    return size <= (size_t)((uintptr_t)board_guard - (uintptr_t)board_kept) ? board_kept : NULL;
}

/* Each region has 2^bits bytes, and lies at a multiple of that. */
static void protect(uint32_t region, uintptr_t base, uint32_t bits, uint32_t attributes)
{
    enum { VALID = 1 << 4 };
    cortex_m7_store(MPU_BASE, (uint32_t)base | VALID | region);
    cortex_m7_store(MPU_ATTRIBUTES, attributes | SHARED_MEMORY | (bits - 1u) << 1 | REGION_ON);
}

/* A higher region goes before a lower one. */
static void protect_memory(void)
{
    protect(0u, 0u, 22u, READ_ONLY);                               /* code and constants */
    protect(1u, 0u, 10u, NO_ACCESS | NO_CODE);                     /* where null pointers point to */
    protect(2u, 0x20000000u, 22u, 3u << 24 | NO_CODE);             /* what changes is no code */
    protect(3u, (uintptr_t)board_guard, 10u, NO_ACCESS | NO_CODE); /* below the stack */
    cortex_m7_store(MPU_CONTROL, MPU_ON);
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

void cortex_m7_begin(void)
{
    cortex_m7_store(FAULTS, FAULTS_APART);
    cortex_m7_store(CONFIGURATION, cortex_m7_load(CONFIGURATION) | DIVISION_BY_ZERO);
    protect_memory();
    cortex_m7_store(TIMER + TIMER_RELOAD, UINT32_MAX);
    cortex_m7_store(TIMER + TIMER_VALUE, UINT32_MAX);
    cortex_m7_store(TIMER + TIMER_CONTROL, TIMER_ENABLE);
    counted = UINT32_MAX;
    cortex_m7_store(UART + UART_DIVIDER, (HZ + BAUD / 2) / BAUD);
    cortex_m7_store(UART + UART_CONTROL, UART_BOTH | UART_RECEIVE_INTERRUPT);
    cortex_m7_store(INTERRUPTS_ENABLE, 1u << 0);
    cortex_m7_store(SYSTICK_RELOAD, HZ / BEATS_HZ - 1u);
    cortex_m7_store(SYSTICK_VALUE, 0u);
    cortex_m7_store(SYSTICK_CONTROL, 7u);
}
