/* SPDX-License-Identifier: Apache-2.0 */
/* Composes the mission once by each of the frozen modules case_0, case_1, ... and prints the results. */
#include "targets/micropython/process.h"
#include "targets/micropython/executive.h"
#include "targets/micropython/objects.h"

#include <stdio.h>
#include <stdlib.h>

char script_module[32];

int main(int argc, char **argv)
{
    const int n = argc > 1 ? atoi(argv[1]) : 0;
    for (int i = 0; i < n; i++) {
        (void)snprintf(script_module, sizeof script_module, "case_%d", i);
        executive_init();
        (void)printf("%s\n", executive_failure() != NULL ? executive_failure() : "composed");
    }
    /* A script changes configuration, the second module, while flight runs. */
    (void)snprintf(script_module, sizeof script_module, "case_0");
    executive_init();
    ScriptNode *flags = &objects_module(process_instance(1))->node;
    const ScriptNode *kinds = objects_view(flags, objects_field(flags->type, "kinds"), 0);
    const uint8_t *x = objects_memory(kinds) + objects_field(kinds->type, "x")->offset;
    objects_store(flags, objects_field(flags->type, "x"), mp_obj_new_float(2.5));
    (void)printf("%g", element_read(FLEDGE_F64, x));
    executive_tick(executive_next());
    (void)printf(" %g\n", element_read(FLEDGE_F64, x));
    return 0;
}
