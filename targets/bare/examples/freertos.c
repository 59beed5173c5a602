/* SPDX-License-Identifier: Apache-2.0 */
/* A mission in a task of FreeRTOS. FreeRTOS has no drivers, so what belongs to the board stands in its my_board.h:
 *
 *     void my_uart_write(const void *bytes, size_t n);    returns when they are sent, or lie in its buffer
 *     void my_watchdog_feed(void);                        the first call starts it
 *     void my_reset(void);
 *
 * The UART's interrupt calls line_received(). main() calls start_flight() before vTaskStartScheduler(). */
#include "targets/bare/bare.h"
#include "targets/bare/port.h"
#include <FreeRTOS.h>
#include <my_board.h>
#include <stream_buffer.h>
#include <task.h>

enum {
    STACK = 16384 / sizeof(StackType_t),
    PRIORITY = 3,
    BUFFERED = 5120, /* bytes that come while flight computes */
};

static StreamBufferHandle_t received;

void line_received(const void *bytes, size_t n)
{
    BaseType_t woken = pdFALSE;
    (void)xStreamBufferSendFromISR(received, bytes, n, &woken);
    portYIELD_FROM_ISR(woken);
}

void board_send(const void *bytes, size_t n)
{
    my_uart_write(bytes, n);
}

size_t board_receive(void *bytes, size_t room)
{
    return xStreamBufferReceive(received, bytes, room, pdMS_TO_TICKS(2));
}

/* The ticks of the scheduler, counted on where their type ends. A counter of the board would be finer. */
int64_t board_time(void)
{
    static TickType_t last;
    static uint64_t ticks;
    const TickType_t now = xTaskGetTickCount();
    ticks += (TickType_t)(now - last);
    last = now;
    return (int64_t)(ticks * (UINT64_C(1000000000) / configTICK_RATE_HZ));
}

void board_watch(void)
{
    my_watchdog_feed();
}

void *board_keep(size_t size)
{
    static uint64_t kept[2560] __attribute__((section(".noinit")));
    return size <= sizeof kept ? kept : NULL;
}

static void fly(void *unused)
{
    (void)unused;
    (void)fledge_fly();
    my_reset(); /* for the next run */
}

void start_flight(void)
{
    static StackType_t stack[STACK];
    static StaticTask_t task;
    static StaticStreamBuffer_t buffer;
    static uint8_t bytes[BUFFERED + 1];
    received = xStreamBufferCreateStatic(sizeof bytes, 1, bytes, &buffer);
    (void)xTaskCreateStatic(fly, "flight", STACK, NULL, PRIORITY, stack, &task);
}
