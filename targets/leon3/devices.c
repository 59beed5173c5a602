/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/leon3/leon3.h"

#include "registers/plug_and_play.h"

/* Where the tables of plug and play are, on each LEON3: of the AHB 64 masters, then 64 slaves, of 8 words; of the APB,
 * at the end of its bridge, entries of 2 words. A word has the vendor of the device, and its interrupt. */
#define SLAVES 0xFFFFF800u
#define SLAVE_SIZE 32u
#define APB_TABLE 0xFF000u
#define APB_SIZE 8u
#define ENTRIES 64u

enum { GAISLER = 1, APB_BRIDGE = 0x006, APBUART = 0x00C, IRQMP = 0x00D, GPTIMER = 0x011, GRSPW2 = 0x029 };

enum { UART_DATA = 0, UART_STATUS = 4, UART_CONTROL = 8, UART_EMPTY = 1 << 2, UART_ENABLE = 3 };
enum { LINK_CONTROL = 0, LINK_STATUS = 4, LINK_DMA = 0x20, LINK_DESCRIPTOR = 0x28 };
enum { LINK_DISABLE = 1, LINK_START = 2, LINK_RUNS = 5 };
enum { DMA_TRANSMIT = 1, PACKET_ENABLE = 1 << 12, PACKET_WRAP = 1 << 13 };
enum { LINK_LOOKS = 10000 }; /* a millisecond: a link with another end needs some 20 us to start */

extern const uint32_t leon3_registers[]; /* of the linker: where the registers are without plug and play */

Leon3Devices leon3;
int leon3_console_off;

/* The only one of the SpaceWire link's table: flags, header, size, address. */
static volatile uint32_t descriptor[4] __attribute__((aligned(1024)));

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
        } else if (is(entry, GAISLER, GRSPW2) && leon3.spacewire == 0u) {
            leon3.spacewire = address;
        } else if (is(entry, GAISLER, IRQMP)) {
            leon3.interrupts = address;
        } else if (is(entry, GAISLER, GPTIMER) && leon3.timers == 0u) {
            leon3.timers = address;
            leon3.timer_line = entry & 0x1Fu;
        }
    }
}

/* The link runs if there is something at its other end. */
static int start_link(uint32_t link)
{
    leon3_store(link + LINK_CONTROL, (leon3_load(link + LINK_CONTROL) & ~(uint32_t)LINK_DISABLE) | LINK_START);
    for (int i = 0; i < LINK_LOOKS; i++) {
        if ((leon3_load(link + LINK_STATUS) >> 21 & 7u) == LINK_RUNS) {
            leon3_store(link + LINK_DESCRIPTOR, (uint32_t)(uintptr_t)descriptor);
            return 1;
        }
    }
    return 0;
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
    if (leon3.spacewire != 0u && start_link(leon3.spacewire)) {
        leon3.link = leon3.spacewire;
    }
}

/* ---- the console, and records */

/* The link takes the bytes from memory by itself. */
static void send_packet(const void *bytes, size_t n)
{
    descriptor[2] = (uint32_t)n;
    descriptor[3] = (uint32_t)(uintptr_t)bytes;
    descriptor[0] = PACKET_ENABLE | PACKET_WRAP;
    __asm__ volatile("" : : : "memory");
    leon3_store(leon3.spacewire + LINK_DMA, DMA_TRANSMIT);
    while ((descriptor[0] & PACKET_ENABLE) != 0u) {
    }
}

void leon3_send(uint32_t device, const void *bytes, size_t n)
{
    const uint8_t *p = bytes;
    if (device == 0u || n == 0u) {
        return;
    }
    if (device == leon3.spacewire) {
        send_packet(bytes, n);
        return;
    }
    while (n-- != 0u) {
        while ((leon3_load(device + UART_STATUS) & UART_EMPTY) == 0u) {
        }
        leon3_store(device + UART_DATA, *p++);
    }
}

void bare_say(const char *text)
{
    size_t n = 0;
    while (text[n] != '\0') {
        n++;
    }
    if (!leon3_console_off) {
        leon3_send(leon3.console, text, n);
    }
}
