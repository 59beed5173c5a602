/* SPDX-License-Identifier: Apache-2.0 */
/* The five functions on ST's Nucleo-H743ZI: the line is USART3, which its ST-LINK shows to the desktop as /dev/ttyACM0.
 * The clock stays the one after power-on, 64 MHz for the processor and the USART. It has not been tried on the
 * hardware. */
#include "targets/bare/port.h"
#include "targets/cortex_m7/cortex_m7.h"

enum { HZ = 64000000, BAUD = 921600 };

#define RCC_AHB4ENR 0x580244E0u
#define RCC_APB1LENR 0x580244E8u
#define GPIOD_MODER 0x58020C00u
#define GPIOD_AFRH 0x58020C24u

#define USART3_CR1 0x40004800u
#define USART3_BRR 0x4000480Cu
#define USART3_ISR 0x4000481Cu
#define USART3_ICR 0x40004820u
#define USART3_RDR 0x40004824u
#define USART3_TDR 0x40004828u
enum { UE = 1 << 0, RE = 1 << 2, TE = 1 << 3, RXFNEIE = 1 << 5, FIFOEN = 1 << 29 }; /* of CR1 */
enum { ORE = 1 << 3, RXFNE = 1 << 5, TXFNF = 1 << 7 };                              /* of ISR and ICR */

#define IWDG1_KR 0x58004800u
#define IWDG1_PR 0x58004804u
#define IWDG1_RLR 0x58004808u

#define ISER1 0xE000E104u
#define SYSTICK_CONTROL 0xE000E010u
#define SYSTICK_RELOAD 0xE000E014u
#define DEMCR 0xE000EDFCu
#define DWT_CTRL 0xE0001000u
#define DWT_CYCCNT 0xE0001004u
#define DWT_LAR 0xE0001FB0u
#define MPU_CONTROL 0xE000ED94u
#define MPU_BASE 0xE000ED9Cu
#define MPU_ATTRIBUTES 0xE000EDA0u

enum { RING = 8192 };
static volatile uint8_t ring[RING];
static volatile uint32_t come, taken;

void cortex_m7_receive(void)
{
    cortex_m7_store(USART3_ICR, ORE); /* the other end sends again what was lost */
    while ((cortex_m7_load(USART3_ISR) & RXFNE) != 0u) {
        const uint8_t byte = (uint8_t)cortex_m7_load(USART3_RDR);
        if (come - taken < RING) {
            ring[come % RING] = byte;
            come = come + 1u;
        }
    }
}

void board_send(const void *bytes, size_t n)
{
    for (const uint8_t *p = bytes; n > 0u; n--) {
        while ((cortex_m7_load(USART3_ISR) & TXFNF) == 0u) {
        }
        cortex_m7_store(USART3_TDR, *p++);
    }
}

size_t board_receive(void *bytes, size_t room)
{
    uint8_t *to = bytes;
    size_t n = 0u;
    __asm__ volatile("cpsid i" ::: "memory");
    if (come == taken) {
        __asm__ volatile("wfi" ::: "memory"); /* an interrupt ends it, also one that has not been taken */
    }
    __asm__ volatile("cpsie i" ::: "memory");
    while (n < room && taken != come) {
        to[n++] = ring[taken % RING];
        taken = taken + 1u;
    }
    return n;
}

void cortex_m7_beat(void) {} /* it ends the sleep */

/* The count of cycles turns every 67 s; flight reads it more often. */
int64_t board_time(void)
{
    static uint32_t last;
    static uint64_t cycles;
    const uint32_t now = cortex_m7_load(DWT_CYCCNT);
    cycles += now - last;
    last = now;
    return (int64_t)(cycles * 1000u / (HZ / 1000000));
}

/* It counts at 32 kHz / 256. */
void board_watch(void)
{
    static int on;
    if (!on) {
        cortex_m7_store(IWDG1_KR, 0xCCCCu);
        cortex_m7_store(IWDG1_KR, 0x5555u);
        cortex_m7_store(IWDG1_PR, 6u);
        cortex_m7_store(IWDG1_RLR, BOARD_PATIENCE_MS / 8u);
        on = 1;
    }
    cortex_m7_store(IWDG1_KR, 0xAAAAu);
}

void *board_keep(size_t size)
{
    return size <= (size_t)((uintptr_t)board_guard - (uintptr_t)board_kept) ? board_kept : NULL;
}

/* start.c calls it before main. */
void cortex_m7_begin(void)
{
    enum { REGION_OF_1_KIB = 9 << 1 | 1, NO_ACCESS = 1 << 28, ALL_ELSE_AS_WITHOUT = 4, ON = 1 };
    cortex_m7_store(MPU_BASE, (uint32_t)(uintptr_t)board_guard | 1u << 4); /* below the stack */
    cortex_m7_store(MPU_ATTRIBUTES, NO_ACCESS | REGION_OF_1_KIB);
    cortex_m7_store(MPU_CONTROL, ALL_ELSE_AS_WITHOUT | ON);
    __asm__ volatile("dsb\n\tisb" ::: "memory");

    cortex_m7_store(DEMCR, cortex_m7_load(DEMCR) | 1u << 24);
    cortex_m7_store(DWT_LAR, 0xC5ACCE55u);
    cortex_m7_store(DWT_CYCCNT, 0u);
    cortex_m7_store(DWT_CTRL, cortex_m7_load(DWT_CTRL) | 1u);

    cortex_m7_store(RCC_AHB4ENR, cortex_m7_load(RCC_AHB4ENR) | 1u << 3);
    cortex_m7_store(RCC_APB1LENR, cortex_m7_load(RCC_APB1LENR) | 1u << 18);
    (void)cortex_m7_load(RCC_APB1LENR);                                         /* until then the clocks are on */
    cortex_m7_store(GPIOD_AFRH, (cortex_m7_load(GPIOD_AFRH) & ~0xFFu) | 0x77u); /* PD8 sends, PD9 receives */
    cortex_m7_store(GPIOD_MODER, (cortex_m7_load(GPIOD_MODER) & ~0xF0000u) | 0xA0000u);
    cortex_m7_store(USART3_BRR, (HZ + BAUD / 2) / BAUD);
    cortex_m7_store(USART3_CR1, FIFOEN | RXFNEIE | TE | RE | UE);
    cortex_m7_store(ISER1, 1u << (CORTEX_M7_LINE - 32));
    cortex_m7_store(SYSTICK_RELOAD, HZ / 1000 - 1);
    cortex_m7_store(SYSTICK_CONTROL, 7u);
}
