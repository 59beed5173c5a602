/* SPDX-License-Identifier: Apache-2.0 */
#define BESIDE_CODE
#include "bench/guest/stores.c"
