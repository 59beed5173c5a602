/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin of QEMU: how many instructions a program executed, in the log at its end. QEMU's header is not packaged, so
 * this declares what it needs of version 1 of that interface. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>

struct qemu_plugin_tb; /* instructions that run from the first to the last */

void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*translated)(uint64_t id, struct qemu_plugin_tb *block));
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *block);
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *block, int operation, void *to, uint64_t n);
void qemu_plugin_register_atexit_cb(uint64_t id, void (*ended)(uint64_t id, void *context), void *context);
void qemu_plugin_outs(const char *line);

int qemu_plugin_install(uint64_t id, const void *machine, int count, char **arguments);

int qemu_plugin_version = 1;
static uint64_t executed;

static void count_block(uint64_t id, struct qemu_plugin_tb *block)
{
    enum { ADD };
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, ADD, &executed, qemu_plugin_tb_n_insns(block));
}

static void print(uint64_t id, void *context)
{
    char line[32];
    (void)id;
    (void)context;
    snprintf(line, sizeof line, "%" PRIu64 "\n", executed);
    qemu_plugin_outs(line);
}

int qemu_plugin_install(uint64_t id, const void *machine, int count, char **arguments)
{
    (void)machine;
    (void)count;
    (void)arguments;
    qemu_plugin_register_vcpu_tb_trans_cb(id, count_block);
    qemu_plugin_register_atexit_cb(id, print, NULL);
    return 0;
}
