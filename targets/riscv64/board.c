/* SPDX-License-Identifier: Apache-2.0 */
/* The devices of QEMU's `virt`, at the addresses of its hw/riscv/virt.c: a UART 16550 behind the PLIC, the timer of the
 * CLINT, which is the watchdog, too, and the device by which a program ends or resets the machine. */
#include "targets/riscv64/riscv64.h"

#include "targets/bare/memory.h"
#include "targets/bare/port.h"

#include <stdlib.h>

#define AT(type, address) (*(volatile type *)(uintptr_t)(address))
#define CSR_WRITE(name, value) __asm__ volatile("csrw " #name ", %0" : : "r"(value) : "memory")

/* The UART: a register has a byte. */
enum { UART = 0x10000000, UART_LINE = 10, DATA = 0, ENABLE = 1, FIFO = 2, FORMAT = 3, STATUS = 5 };
enum { RECEIVED = 1, EMPTY = 0x20, FIFO_ON = 7, DIVISOR = 0x80, EIGHT_BITS = 3 };

/* The PLIC: priorities, and of machine mode of the first processor: enables, threshold, claim. */
enum { PLIC = 0x0C000000, PLIC_ENABLE = PLIC + 0x2000, PLIC_THRESHOLD = PLIC + 0x200000, PLIC_CLAIM = PLIC + 0x200004 };

enum { CLINT_COMPARE = 0x02004000, CLINT_TIME = 0x0200BFF8, TIME_NS = 100 }; /* ten counts a microsecond */

enum { FINISHER = 0x00100000, FINISH_FAIL = 0x3333, FINISH_PASS = 0x5555, FINISH_RESET = 0x7777 };

enum { TIMER_INTERRUPT = 1 << 7, DEVICE_INTERRUPT = 1 << 11, INTERRUPTS_ON = 8 };

/* An interrupt of the timer ends any sleep, and counts the patience of the watchdog: a machine that stands still loses
 * none. */
enum { BEAT_NS = 5000000 };
#ifndef BOARD_PATIENCE_MS
#define BOARD_PATIENCE_MS 10000
#endif
#define PATIENCE (BOARD_PATIENCE_MS / (BEAT_NS / 1000000))

enum { RING = 8192 }; /* more than arrives within 20 ms at 3,000,000 baud */

uint64_t board_late;

static volatile uint8_t ring[RING];
static volatile uint32_t taken, filled; /* bytes of the ring so far */
static volatile int32_t patience = -1;  /* [beats] of the watchdog; negative: it is off */

/* ---- interrupts: they call nothing, so they save few registers */

extern uint8_t board_exception_entry[]; /* of start.S */
void board_beat(void) __attribute__((interrupt("machine"), aligned(4)));
void board_interrupt(void) __attribute__((interrupt("machine"), aligned(4)));

void board_beat(void)
{
    AT(uint64_t, CLINT_COMPARE) = AT(uint64_t, CLINT_TIME) + BEAT_NS / TIME_NS;
    if (patience > 0) {
        patience = patience - 1;
    } else if (patience == 0) { /* the program goes on at the report, with all its registers */
        patience = -1;
        __asm__ volatile("csrr %0, mepc" : "=r"(board_late));
        CSR_WRITE(mepc, board_exception_entry);
    }
}

void board_interrupt(void)
{
    const uint32_t line = AT(uint32_t, PLIC_CLAIM);
    while ((AT(uint8_t, UART + STATUS) & RECEIVED) != 0u) {
        const uint8_t byte = AT(uint8_t, UART + DATA);
        if (filled - taken < RING) { /* else it is lost, and the line requests it again */
            ring[filled % RING] = byte;
            filled = filled + 1u;
        }
    }
    AT(uint32_t, PLIC_CLAIM) = line;
}

/* ---- the start */

/* Page 0, the code and the guard below the stack, each from an address to the next: locked, they hold in machine mode.
 * A stray pointer and a full stack are faults, where else they would change the flight software. */
static void protect(void)
{
    enum { READ = 1, EXECUTE = 4, TO_ADDRESS = 8, LOCKED = 0x80 };
    const uint64_t nothing = TO_ADDRESS | LOCKED, code = TO_ADDRESS | LOCKED | READ | EXECUTE;
    CSR_WRITE(pmpaddr0, UINT64_C(0x1000) >> 2);
    CSR_WRITE(pmpaddr1, (uintptr_t)board_code >> 2);
    CSR_WRITE(pmpaddr2, (uintptr_t)board_code_end >> 2);
    CSR_WRITE(pmpaddr3, (uintptr_t)board_guard >> 2);
    CSR_WRITE(pmpaddr4, (uintptr_t)board_stack >> 2);
    CSR_WRITE(pmpcfg0, nothing | code << 16 | nothing << 32);
}

void board_start(void)
{
    protect();
    AT(uint8_t, UART + FORMAT) = DIVISOR; /* the fastest; a machine in software sends at once */
    AT(uint8_t, UART + DATA) = 1u;
    AT(uint8_t, UART + ENABLE) = 0u;
    AT(uint8_t, UART + FORMAT) = EIGHT_BITS;
    AT(uint8_t, UART + FIFO) = FIFO_ON;
    AT(uint8_t, UART + ENABLE) = RECEIVED;
    AT(uint32_t, PLIC + 4 * UART_LINE) = 1u;
    AT(uint32_t, PLIC_ENABLE) = 1u << UART_LINE;
    AT(uint32_t, PLIC_THRESHOLD) = 0u;
    AT(uint64_t, CLINT_COMPARE) = AT(uint64_t, CLINT_TIME) + BEAT_NS / TIME_NS;
    CSR_WRITE(mie, TIMER_INTERRUPT | DEVICE_INTERRUPT);
    __asm__ volatile("csrsi mstatus, %0" : : "i"(INTERRUPTS_ON) : "memory");
}

void board_reset(void)
{
    AT(uint32_t, FINISHER) = FINISH_RESET;
    for (;;) {
    }
}

/* Of the C library, too: the end of the machine. */
void _exit(int status)
{
    AT(uint32_t, FINISHER) = status == 0 ? FINISH_PASS : FINISH_FAIL | (uint32_t)status << 16;
    for (;;) {
    }
}

/* ---- targets/bare/port.h */

void board_send(const void *bytes, size_t n)
{
    const uint8_t *from = bytes;
    for (size_t i = 0u; i < n; i++) {
        while ((AT(uint8_t, UART + STATUS) & EMPTY) == 0u) {
        }
        AT(uint8_t, UART + DATA) = from[i];
    }
}

size_t board_receive(void *bytes, size_t room)
{
    uint8_t *to = bytes;
    size_t n = 0u;
    __asm__ volatile("csrci mstatus, %0" : : "i"(INTERRUPTS_ON) : "memory");
    if (filled == taken) {
        __asm__ volatile("wfi" : : : "memory"); /* an interrupt ends it, even one that is not taken */
    }
    __asm__ volatile("csrsi mstatus, %0" : : "i"(INTERRUPTS_ON) : "memory");
    while (n < room && filled != taken) {
        to[n++] = ring[taken % RING];
        taken = taken + 1u;
    }
    return n;
}

int64_t board_time(void)
{
    return (int64_t)AT(uint64_t, CLINT_TIME) * TIME_NS;
}

void board_watch(void)
{
    patience = PATIENCE;
}

void *board_keep(size_t size)
{
    return size <= (size_t)((uintptr_t)board_guard - (uintptr_t)board_kept) ? board_kept : NULL;
}
