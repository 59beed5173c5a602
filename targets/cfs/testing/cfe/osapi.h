/* SPDX-License-Identifier: Apache-2.0 */
/* Of Caelum cFE's headers include it, of the others apps do. */
#ifndef OSAPI_H
#define OSAPI_H

#include "common_types.h"

#ifdef CAELUM
typedef uint32 osal_id_t;
#else
typedef struct osal_id {
    uint32 v;
} osal_id_t;
#endif

#define OS_SUCCESS 0

int32 OS_TaskDelay(uint32);
int32 OS_BinSemCreate(osal_id_t *, const char *, uint32, uint32);
int32 OS_BinSemGive(osal_id_t);
int32 OS_BinSemTimedWait(osal_id_t, uint32);
int32 OS_BinSemDelete(osal_id_t);

#endif
