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

enum { UART_DATA = 0, UART_STATUS = 4, UART_CONTROL = 8, UART_EMPTY = 1 << 2, UART_ENABLE = 3 };

extern const uint32_t leon3_registers[]; /* of the linker: where the registers are without plug and play */

Leon3Devices leon3;
int leon3_console_off;

/* ---- plug and play */

static int is(uint32_t entry, uint32_t vendor, uint32_t device)
{
    return entry >> 24 == vendor && (entry >> 12 & 0xFFFu) == device;
}

static void find_on_apb(uint32_t bridge)
{
    for (uint32_t i = 0u; i < ENTRIES; i++) {
        const uint32_t entry = leon3_load(bridge + APB_TABLE + APB_SIZE * i);
        const uint32_t address = bridge + (leon3_load(bridge + APB_TABLE + APB_SIZE * i + 4u) >> 20 << 8);
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

void leon3_find_devices(void)
{
    for (uint32_t i = 0u; i < ENTRIES; i++) {
        const uint32_t at = SLAVES + SLAVE_SIZE * i;
        const uint32_t entry = leon3_load(at), address = leon3_load(at + 16u) >> 20 << 20;
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
    if (leon3.link != 0u) {
        leon3_store(leon3.link + UART_CONTROL, leon3_load(leon3.link + UART_CONTROL) | UART_ENABLE);
        leon3_store(leon3.console + UART_CONTROL, leon3_load(leon3.console + UART_CONTROL) | UART_ENABLE);
    }
}

/* ---- the console */

void leon3_send(uint32_t uart, const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    while (uart != 0u && n-- != 0u) {
        while ((leon3_load(uart + UART_STATUS) & UART_EMPTY) == 0u) {
        }
        leon3_store(uart + UART_DATA, *p++);
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
