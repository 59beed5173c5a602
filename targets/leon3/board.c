/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/leon3/leon3.h"

/* Registers of the devices. */
enum { IRQ_FORCE = 0x08, IRQ_CLEAR = 0x0C, IRQ_MASK = 0x40 };
enum {
    TIMER_SCALER = 0x04,
    TIMER_CONFIGURATION = 0x08,
    TIMER_FIRST = 0x10,
    TIMER_RELOAD = 0x04,
    TIMER_CONTROL = 0x08,
    TIMER_ENABLE = 1 << 0,
    TIMER_RESTART = 1 << 1,
    TIMER_LOAD = 1 << 2,
    TIMER_INTERRUPT = 1 << 3
};

/* The period of the interrupt that ends any sleep; shorter if there is no interrupt of a tick. */
#define BEAT_US (leon3.registers_line != 0u ? 100000u : 500u)

/* Symbols of the linker script. */
extern const uint32_t leon3_traps[], leon3_heap[], leon3_data_load[], leon3_data_end[], leon3_data[], leon3_bss_end[],
    leon3_stack[], leon3_stack_end[];
extern const char LEON3_CLOCK[]; /* [Hz], as an address */

Leon3Fault leon3_fault __attribute__((aligned(8)));
uint64_t leon3_fault_stack[LEON3_FAULT_STACK / 8];

static void (*handlers[16])(void);
static uint32_t watchdog; /* the address of its timer, or 0 */
static int watched;
static uint32_t counted; /* [us] of the counter, at the last read */
static uint64_t elapsed; /* [us] */

/* ---- interrupts and sleep */

void leon3_interrupt(uint32_t level)
{
    if (handlers[level] != NULL) {
        handlers[level]();
    }
}

void leon3_on_interrupt(uint32_t level, void (*handler)(void))
{
    handlers[level] = handler;
    if (leon3.interrupts != 0u) {
        leon3_store(leon3.interrupts + IRQ_CLEAR, 1u << level);
        leon3_store(leon3.interrupts + IRQ_MASK, leon3_load(leon3.interrupts + IRQ_MASK) | 1u << level);
    }
}

static void wake(void) {} /* bare_idle returns, and its caller polls */

void bare_idle(void)
{
    if (watched) {
        leon3_store(watchdog + TIMER_CONTROL, TIMER_ENABLE | TIMER_LOAD);
    }
    (void)bare_now(); /* often enough to see each turn of the counter */
    if (leon3.timers != 0u) {
        __asm__ volatile("wr %%g0, %%asr19" : : : "memory");
    }
}

/* ---- time */

static void start_timers(void)
{
    const uint32_t hz = (uint32_t)(uintptr_t)LEON3_CLOCK;
    if (leon3.timers == 0u) {
        return;
    }
    const uint32_t n = leon3_load(leon3.timers + TIMER_CONFIGURATION) & 7u;
    const uint32_t beat = leon3.timers + TIMER_FIRST, count = beat + 0x10u;
    if (leon3.registers_line != 0u) { /* on a board of ours; elsewhere its boot program knows the clock */
        leon3_store(leon3.timers + TIMER_SCALER, hz / 1000000u - 1u);
    }
    leon3_on_interrupt(leon3.timer_line, wake);
    leon3_store(beat + TIMER_RELOAD, BEAT_US - 1u);
    leon3_store(beat + TIMER_CONTROL, TIMER_ENABLE | TIMER_RESTART | TIMER_LOAD | TIMER_INTERRUPT);
    leon3_store(count + TIMER_RELOAD, UINT32_MAX);
    leon3_store(count + TIMER_CONTROL, TIMER_ENABLE | TIMER_RESTART | TIMER_LOAD);
    counted = UINT32_MAX;
    elapsed = 0u;
    watchdog = n > 2u ? beat + 0x10u * (n - 1u) : 0u; /* the last one */
}

void bare_watch(void)
{
    watched = watchdog != 0u;
    if (watched) {
        leon3_store(watchdog + TIMER_RELOAD, BARE_PATIENCE_S * 1000000u);
    }
}

void leon3_stop(int status)
{
    if (watchdog != 0u) {
        leon3_store(watchdog + TIMER_CONTROL, 0u);
    }
    leon3_halt(status);
}

int64_t bare_now(void)
{
    const uint32_t count = leon3.timers != 0u ? leon3_load(leon3.timers + TIMER_FIRST + 0x10u) : counted;
    elapsed += counted - count; /* it counts down */
    counted = count;
    return (int64_t)elapsed * 1000;
}

void leon3_reset(void)
{
    if (watchdog == 0u) {
        leon3_stop(1);
    }
    leon3_store(watchdog + TIMER_RELOAD, 0u);
    leon3_store(watchdog + TIMER_CONTROL, TIMER_ENABLE | TIMER_LOAD);
    for (;;) {
    }
}

/* ---- faults */

static void say_row(const char *name, const uint32_t *values)
{
    bare_say(name);
    for (int i = 0; i < 8; i++) {
        bare_say(" ");
        bare_say_hex(values[i]);
    }
    bare_say("\n");
}

void leon3_report_fault(const Leon3Fault *f)
{
    leon3_console_off = 0;
    bare_say("trap 0x");
    bare_say_hex(f->tbr >> 4 & 0xFFu);
    bare_say(" at 0x");
    bare_say_hex(f->pc);
    bare_say(": the program stops\nnpc psr wim y fsr");
    const uint32_t state[8] = {f->npc, f->psr, f->wim, f->y, f->fsr, 0u, 0u, 0u};
    say_row("", state);
    say_row("g", f->g);
    say_row("o", f->o);
    say_row("l", f->l);
    say_row("i", f->i);
    leon3_halt(1);
}

/* ---- the program */

uint32_t leon3_stack_size(void)
{
    return (uint32_t)((uintptr_t)leon3_stack_end - (uintptr_t)leon3_stack);
}

uint32_t leon3_stack_used(void)
{
    const uint32_t *p = leon3_stack;
    while (p < leon3_stack_end && *p == LEON3_PAINT) {
        p++;
    }
    return (uint32_t)((uintptr_t)leon3_stack_end - (uintptr_t)p);
}

uint32_t leon3_program_size(void)
{
    return (uint32_t)((uintptr_t)leon3_data_load - (uintptr_t)leon3_traps + (uintptr_t)leon3_data_end -
                      (uintptr_t)leon3_data);
}

uint32_t leon3_ram_used(void)
{
    return (uint32_t)((uintptr_t)leon3_heap - (uintptr_t)leon3_traps) + leon3_stack_used();
}

uint32_t leon3_data_size(void)
{
    return (uint32_t)((uintptr_t)leon3_bss_end - (uintptr_t)leon3_data);
}

BareContext bare_context(void *stack, size_t size, void (*entry)(uint32_t), uint32_t argument)
{
    extern void leon3_begin(void);
    uint32_t *frame = (uint32_t *)(((uintptr_t)stack + size - 96u) & ~(uintptr_t)7);
    for (int i = 0; i < 16; i++) {
        frame[i] = 0u;
    }
    frame[0] = (uint32_t)(uintptr_t)entry; /* %l0 */
    frame[1] = argument;                   /* %l1 */
    const BareContext context = {(uint32_t)(uintptr_t)frame, (uint32_t)(uintptr_t)leon3_begin - 8u};
    return context;
}

int main(void);

void leon3_run(void)
{
    uint32_t configuration;
    leon3_find_devices();
    __asm__ volatile("rd %%asr17, %0" : "=r"(configuration));
    if ((configuration & 0x1Fu) + 1u != LEON3_WINDOWS) {
        bare_say("this processor has another number of register windows than 8\n");
        leon3_stop(1);
    }
    start_timers();
    if (leon3.registers_line != 0u) {
        leon3_on_interrupt(leon3.registers_line, wake);
    }
    leon3_stop(main());
}
