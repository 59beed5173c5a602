/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "bench/guest/guest.h"

int main(void)
{
    printf("checksum %08lx\n", (unsigned long)work());
    return 0;
}
