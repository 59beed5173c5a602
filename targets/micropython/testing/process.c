/* SPDX-License-Identifier: Apache-2.0 */
/* Composes the mission once by each of the frozen modules case_0, case_1, ... and prints what comes of it. */
#include "targets/micropython/executive.h"

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
    return 0;
}
