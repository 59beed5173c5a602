/* SPDX-License-Identifier: Apache-2.0 */
/* FreeRTOS as far as freertos.c uses it, by its manual. */
#ifndef FREERTOS_H
#define FREERTOS_H

#include <stdint.h>

typedef long BaseType_t;
typedef unsigned long UBaseType_t;
typedef uint32_t TickType_t;
typedef uint32_t StackType_t;
typedef struct {
    uint8_t any[128];
} StaticTask_t;
typedef struct {
    uint8_t any[48];
} StaticStreamBuffer_t;

#define pdFALSE ((BaseType_t)0)
#define configTICK_RATE_HZ 1000u
#define pdMS_TO_TICKS(ms) ((TickType_t)((uint64_t)(ms)*configTICK_RATE_HZ / 1000u))

void vPortYieldFromISR(BaseType_t woken);
#define portYIELD_FROM_ISR(woken) vPortYieldFromISR(woken)

#endif
