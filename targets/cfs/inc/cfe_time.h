/* SPDX-License-Identifier: Apache-2.0 */
#ifndef CFE_TIME_H
#define CFE_TIME_H

#include "cfe_error.h"

typedef struct CFE_TIME_SysTime {
    uint32 Seconds;
    uint32 Subseconds; ///< 2^-32 s
} CFE_TIME_SysTime_t;

typedef enum CFE_TIME_Compare { CFE_TIME_A_LT_B = -1, CFE_TIME_EQUAL = 0, CFE_TIME_A_GT_B = 1 } CFE_TIME_Compare_t;

/** All four return the time since the start of the pocket, which has neither epoch nor leap seconds. */
CFE_TIME_SysTime_t CFE_TIME_GetTime(void);
CFE_TIME_SysTime_t CFE_TIME_GetMET(void);
CFE_TIME_SysTime_t CFE_TIME_GetTAI(void);
CFE_TIME_SysTime_t CFE_TIME_GetUTC(void);

CFE_TIME_SysTime_t CFE_TIME_Add(CFE_TIME_SysTime_t Time1, CFE_TIME_SysTime_t Time2);
CFE_TIME_SysTime_t CFE_TIME_Subtract(CFE_TIME_SysTime_t Time1, CFE_TIME_SysTime_t Time2);
/** Seconds wrap around: A is later than B if it is less than 2^31 s after B. */
CFE_TIME_Compare_t CFE_TIME_Compare(CFE_TIME_SysTime_t TimeA, CFE_TIME_SysTime_t TimeB);
uint32 CFE_TIME_Sub2MicroSecs(uint32 SubSeconds);
uint32 CFE_TIME_Micro2SubSecs(uint32 MicroSeconds);

#endif
