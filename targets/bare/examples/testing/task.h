/* SPDX-License-Identifier: Apache-2.0 */
#ifndef TASK_H
#define TASK_H

#include <FreeRTOS.h>

typedef struct tskTaskControlBlock *TaskHandle_t;
typedef void (*TaskFunction_t)(void *argument);

TickType_t xTaskGetTickCount(void);
TaskHandle_t xTaskCreateStatic(TaskFunction_t code, const char *name, StackType_t depth, void *argument,
                               UBaseType_t priority, StackType_t *stack, StaticTask_t *task);

#endif
