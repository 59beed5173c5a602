/* SPDX-License-Identifier: Apache-2.0 */
/* Zephyr as far as zephyr.c uses it, by its manual. */
#ifndef ZEPHYR_KERNEL_H
#define ZEPHYR_KERNEL_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    int64_t ticks;
} k_timeout_t;
#define K_NO_WAIT ((k_timeout_t){0})
#define K_MSEC(ms) ((k_timeout_t){(ms)})

struct k_msgq {
    char *storage;
    size_t msg_size;
    uint32_t max_msgs;
};
#define K_MSGQ_DEFINE(name, size, most, alignment)                                                                     \
    static char __attribute__((aligned(alignment))) storage_of_##name[(size) * (most)];                                \
    struct k_msgq name = {storage_of_##name, (size), (most)}
int k_msgq_put(struct k_msgq *queue, const void *message, k_timeout_t patience);
int k_msgq_get(struct k_msgq *queue, void *message, k_timeout_t patience);

int64_t k_uptime_ticks(void);
uint64_t k_ticks_to_ns_floor64(uint64_t ticks);

#define K_FP_REGS (1u << 1)
struct zephyr_thread {
    size_t stack;
    void (*entry)(void *, void *, void *);
    void *arguments[3];
    int priority;
    uint32_t options;
    int32_t delay;
};
#define K_THREAD_DEFINE(name, stack, entry, p1, p2, p3, priority, options, delay)                                      \
    const struct zephyr_thread name = {(stack), (entry), {(p1), (p2), (p3)}, (priority), (options), (delay)}

#define __noinit __attribute__((section(".noinit")))

#endif
