/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/command/rules.h"

#include <string.h>

/* The i-th number, as a double. */
static double number(const CommandRule *rule, const uint8_t *block, uint32_t i)
{
    return element_read(rule->number, block + rule->offset + (size_t)i * element_size(rule->number));
}

/* The index of the first number of a field that breaks its rule, or rule->n. */
static uint32_t broken(const CommandRule *rule, const uint8_t *block)
{
    uint32_t n = rule->n;
    if (rule->rows_at != COMMAND_ALL_ROWS) {
        uint32_t rows;
        memcpy(&rows, block + rule->rows_at, sizeof rows);
        n = rows < n / rule->row ? rows * rule->row : n;
    }
    for (uint32_t i = 0u; i < n; i++) {
        const double x = number(rule, block, i);
        if (!exec_computable(x) || !exec_within(rule->flags, rule->low, rule->high, x)) {
            return i;
        }
    }
    if ((rule->flags & COMMAND_NON_ZERO) != 0u) {
        const uint32_t vector = rule->row == 3u ? 3u : 1u;
        for (uint32_t i = 0u; i + vector <= n; i += vector) {
            uint32_t zeros = 0u;
            for (uint32_t k = 0u; k < vector; k++) {
                zeros += number(rule, block, i + k) == 0.0;
            }
            if (zeros == vector) {
                return i;
            }
        }
    }
    for (uint32_t i = 0u; (rule->flags & COMMAND_INERTIA) != 0u && i + 9u <= n; i += 9u) {
        double m[3][3];
        memcpy(m, block + rule->offset + i * sizeof(double), sizeof m);
        if (exec_inertia(m) != EXEC_INERTIA_GOOD) {
            return i;
        }
    }
    return rule->n;
}

const CommandRule *command_check(const CommandRule *rules, uint32_t n, const void *block, uint32_t *element)
{
    for (uint32_t i = 0u; i < n; i++) {
        *element = broken(&rules[i], block);
        if (*element < rules[i].n) {
            return &rules[i];
        }
    }
    return NULL;
}
