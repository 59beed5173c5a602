/* SPDX-License-Identifier: Apache-2.0 */
/* cFE's headers do not include it here: apps do. */
#ifndef OSAPI_H
#define OSAPI_H

#include "common_types.h"

typedef struct osal_id {
    uint32 v;
} osal_id_t;

#define OS_SUCCESS 0

int32 OS_TaskDelay(uint32);
int32 OS_BinSemCreate(osal_id_t *, const char *, uint32, uint32);
int32 OS_BinSemGive(osal_id_t);
int32 OS_BinSemTimedWait(osal_id_t, uint32);
int32 OS_BinSemDelete(osal_id_t);

#endif
