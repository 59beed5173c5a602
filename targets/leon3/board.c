/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/leon3/leon3.h"

#include "registers/plug_and_play.h"

/* Where the tables of plug and play are, on each LEON3: of the AHB 64 masters, then 64 slaves, of 8 words; of the APB,
 * at the end of its bridge, entries of 2 words. A word tells who made the device, and its interrupt. */
#define SLAVES 0xFFFFF800u
#define SLAVE_SIZE 32u
#define APB_TABLE 0xFF000u
#define APB_SIZE 8u
#define ENTRIES 64u

enum { GAISLER = 1, APB_BRIDGE = 0x006, APBUART = 0x00C, IRQMP = 0x00D, GPTIMER = 0x011 };

/* Registers of the devices. */
enum { UART_DATA = 0, UART_STATUS = 4, UART_CONTROL = 8, UART_EMPTY = 1 << 2, UART_ENABLE = 3 };
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

/* The period of the interrupt that ends any sleep; shorter if no interrupt tells of a tick. */
#define BEAT_US (leon3.registers_line != 0u ? 100000u : 500u)

/* Symbols of the linker script. */
extern const uint32_t leon3_traps[], leon3_heap[], leon3_data_load[], leon3_data_end[], leon3_registers[], leon3_data[],
    leon3_bss_end[], leon3_stack[], leon3_stack_end[];
extern const char LEON3_CLOCK[]; /* [Hz], as an address */

Leon3Devices leon3;
Leon3Fault leon3_fault __attribute__((aligned(8)));
uint64_t leon3_fault_stack[256], leon3_fault_stack_end[1];
int leon3_console_off;

static void (*handlers[16])(void);
static uint32_t watchdog; /* the address of its timer, or 0 */
static int watched;
static uint32_t counted; /* [us] of the counter, at the last look */
static uint64_t elapsed; /* [us] */

static uint32_t load(uint32_t address)
{
    return *(const volatile uint32_t *)(uintptr_t)address;
}

static void store(uint32_t address, uint32_t value)
{
    *(volatile uint32_t *)(uintptr_t)address = value;
}

/* ---- plug and play */

static int is(uint32_t entry, uint32_t vendor, uint32_t device)
{
    return entry >> 24 == vendor && (entry >> 12 & 0xFFFu) == device;
}

static void find_on_apb(uint32_t bridge)
{
    for (uint32_t i = 0u; i < ENTRIES; i++) {
        const uint32_t entry = load(bridge + APB_TABLE + APB_SIZE * i);
        const uint32_t address = bridge + (load(bridge + APB_TABLE + APB_SIZE * i + 4u) >> 20 << 8);
        if (is(entry, GAISLER, APBUART)) {
            leon3.console = leon3.console != 0u ? leon3.console : address;
            leon3.link = address;
        } else if (is(entry, GAISLER, IRQMP)) {
            leon3.interrupts = address;
        } else if (is(entry, GAISLER, GPTIMER) && leon3.timers == 0u) {
            leon3.timers = address;
            leon3.timer_line = entry & 0x1Fu;
        }
    }
}

static void find_devices(void)
{
    for (uint32_t i = 0u; i < ENTRIES; i++) {
        const uint32_t at = SLAVES + SLAVE_SIZE * i;
        const uint32_t entry = load(at), address = load(at + 16u) >> 20 << 20;
        if (is(entry, GAISLER, APB_BRIDGE)) {
            find_on_apb(address);
        } else if (is(entry, REGISTER_BUS_VENDOR, REGISTER_BUS_DEVICE)) {
            leon3.registers = address;
            leon3.registers_line = entry & 0x1Fu;
        }
    }
    if (leon3.registers == 0u) {
        leon3.registers = (uint32_t)(uintptr_t)leon3_registers;
    }
}

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
        store(leon3.interrupts + IRQ_CLEAR, 1u << level);
        store(leon3.interrupts + IRQ_MASK, load(leon3.interrupts + IRQ_MASK) | 1u << level);
    }
}

static void wake(void) {} /* leon3_idle returns, and its caller looks */

void leon3_idle(void)
{
    if (watched) {
        store(watchdog + TIMER_CONTROL, TIMER_ENABLE | TIMER_LOAD);
    }
    (void)leon3_now(); /* often enough to see each turn of the counter */
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
    const uint32_t n = load(leon3.timers + TIMER_CONFIGURATION) & 7u;
    const uint32_t beat = leon3.timers + TIMER_FIRST, count = beat + 0x10u;
    if (leon3.registers_line != 0u) { /* on a board of ours; elsewhere its boot program knows the clock */
        store(leon3.timers + TIMER_SCALER, hz / 1000000u - 1u);
    }
    leon3_on_interrupt(leon3.timer_line, wake);
    store(beat + TIMER_RELOAD, BEAT_US - 1u);
    store(beat + TIMER_CONTROL, TIMER_ENABLE | TIMER_RESTART | TIMER_LOAD | TIMER_INTERRUPT);
    store(count + TIMER_RELOAD, UINT32_MAX);
    store(count + TIMER_CONTROL, TIMER_ENABLE | TIMER_RESTART | TIMER_LOAD);
    counted = UINT32_MAX;
    elapsed = 0u;
    watchdog = n > 2u ? beat + 0x10u * (n - 1u) : 0u; /* the last one */
}

void leon3_watch(void)
{
    watched = watchdog != 0u;
    if (watched) {
        store(watchdog + TIMER_RELOAD, LEON3_PATIENCE_S * 1000000u);
    }
}

void leon3_stop(int status)
{
    if (watchdog != 0u) {
        store(watchdog + TIMER_CONTROL, 0u);
    }
    leon3_halt(status);
}

int64_t leon3_now(void)
{
    const uint32_t count = leon3.timers != 0u ? load(leon3.timers + TIMER_FIRST + 0x10u) : counted;
    elapsed += counted - count; /* it counts down */
    counted = count;
    return (int64_t)elapsed * 1000;
}

void leon3_reset(void)
{
    if (watchdog == 0u) {
        leon3_stop(1);
    }
    store(watchdog + TIMER_RELOAD, 0u);
    store(watchdog + TIMER_CONTROL, TIMER_ENABLE | TIMER_LOAD);
    for (;;) {
    }
}

/* ---- the console */

void leon3_send(uint32_t uart, const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    while (uart != 0u && n-- != 0u) {
        while ((load(uart + UART_STATUS) & UART_EMPTY) == 0u) {
        }
        store(uart + UART_DATA, *p++);
    }
}

void leon3_say(const char *text)
{
    size_t n = 0;
    while (text[n] != '\0') {
        n++;
    }
    if (!leon3_console_off) {
        leon3_send(leon3.console, text, n);
    }
}

static void say_in(uint32_t value, uint32_t base, int digits)
{
    char text[11];
    char *p = text + sizeof text;
    *--p = '\0';
    do {
        *--p = "0123456789abcdef"[value % base];
        value /= base;
    } while (value != 0u || p > text + sizeof text - 1 - digits);
    leon3_say(p);
}

void leon3_say_number(uint32_t value)
{
    say_in(value, 10u, 1);
}

void leon3_say_hex(uint32_t value)
{
    say_in(value, 16u, 8);
}

void leon3_say_figure(const char *key, uint32_t value)
{
    leon3_say(key);
    leon3_say(" ");
    leon3_say_number(value);
    leon3_say("\n");
}

static void say_row(const char *name, const uint32_t *values)
{
    leon3_say(name);
    for (int i = 0; i < 8; i++) {
        leon3_say(" ");
        leon3_say_hex(values[i]);
    }
    leon3_say("\n");
}

void leon3_report_fault(const Leon3Fault *f)
{
    leon3_console_off = 0;
    leon3_say("trap 0x");
    leon3_say_hex(f->tbr >> 4 & 0xFFu);
    leon3_say(" at 0x");
    leon3_say_hex(f->pc);
    leon3_say(": the program stops\nnpc psr wim y fsr");
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

Leon3Context leon3_context(void *stack, size_t size, void (*entry)(uint32_t), uint32_t argument)
{
    extern void leon3_begin(void);
    uint32_t *frame = (uint32_t *)(((uintptr_t)stack + size - 96u) & ~(uintptr_t)7);
    for (int i = 0; i < 16; i++) {
        frame[i] = 0u;
    }
    frame[0] = (uint32_t)(uintptr_t)entry; /* %l0 */
    frame[1] = argument;                   /* %l1 */
    const Leon3Context made = {(uint32_t)(uintptr_t)frame, (uint32_t)(uintptr_t)leon3_begin - 8u};
    return made;
}

int main(void);

void leon3_run(void)
{
    uint32_t configuration;
    find_devices();
    if (leon3.link != 0u) {
        store(leon3.link + UART_CONTROL, load(leon3.link + UART_CONTROL) | UART_ENABLE);
        store(leon3.console + UART_CONTROL, load(leon3.console + UART_CONTROL) | UART_ENABLE);
    }
    __asm__ volatile("rd %%asr17, %0" : "=r"(configuration));
    if ((configuration & 0x1Fu) + 1u != LEON3_WINDOWS) {
        leon3_say("this processor has another number of register windows than 8\n");
        leon3_stop(1);
    }
    start_timers();
    if (leon3.registers_line != 0u) {
        leon3_on_interrupt(leon3.registers_line, wake);
    }
    leon3_stop(main());
}
