/* SPDX-License-Identifier: Apache-2.0 */
#ifndef STREAM_BUFFER_H
#define STREAM_BUFFER_H

#include <FreeRTOS.h>

#include <stddef.h>

typedef struct StreamBufferDef_t *StreamBufferHandle_t;

StreamBufferHandle_t xStreamBufferCreateStatic(size_t size, size_t trigger, uint8_t *storage,
                                               StaticStreamBuffer_t *buffer);
size_t xStreamBufferSendFromISR(StreamBufferHandle_t buffer, const void *bytes, size_t n, BaseType_t *woken);
size_t xStreamBufferReceive(StreamBufferHandle_t buffer, void *bytes, size_t room, TickType_t patience);

#endif
