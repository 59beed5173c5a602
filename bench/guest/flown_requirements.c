/* SPDX-License-Identifier: Apache-2.0 */
/* Flown requirements at each of TICKS samples: bench/flown_requirements.py writes their formulas before this text, and
 * counts what each call of judge() takes. All outputs are the same: a head, and numbers that wander. */
#include "flight/services/requirement_monitor.h"

static struct {
    Head head;
    double x[32];
} output;
static RequirementMonitor watch;

static const void *output_of(const void *mission, uint16_t place, uint32_t *size)
{
    (void)mission;
    (void)place;
    *size = sizeof output;
    return &output;
}

static uint16_t mode(const void *mission)
{
    (void)mission;
    return 1u;
}

static const CommandServices services = {.output = output_of};
static const CommandTable table = {.n_outputs = UINT16_MAX, .services = &services, .mode = mode};

__attribute__((noinline, noclone)) void judge(int64_t t)
{
    const CommandContext context = {.table = &table, .t = t};
    (void)requirement_monitor_service.take(&context, &watch, NULL, NULL);
}

int main(void)
{
    if (sizeof(FormulaNode) != (size_t)NODE || sizeof(FlownRequirement) != (size_t)REQUIREMENT) {
        return 1;
    }
    for (uint32_t i = 0u; i < FORMULAS; i++) {
        requirement_monitor_reset(&watch);
        watch.par.requirements[0] = (FlownRequirement){.every = EVERY, .n = formulas[i].n, .on = formulas[i].n > 0u};
        for (uint32_t k = 0u; k < formulas[i].n; k++) {
            watch.par.nodes[k] = formulas[i].nodes[k];
        }
        uint32_t draw = 1u;
        for (int64_t t = 0; t < (int64_t)TICKS * EVERY; t += EVERY) {
            judge(t);
            output.head = (Head){t, QUALITY_GOOD, output.head.sequence + 1u};
            for (uint32_t k = 0u; k < 32u; k++) {
                draw = draw * 1664525u + 1013904223u;
                output.x[k] = (double)(draw >> 8) * 0x1p-24;
            }
        }
        if (watch.mem.bad != 0u || watch.out.state.on != (formulas[i].n > 0u ? 1u : 0u)) {
            return 1;
        }
    }
    return 0;
}
