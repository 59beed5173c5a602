/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

CFE_TIME_SysTime_t CFE_TIME_GetMET(void)
{
    const int64 ns = port_now() - pocket_core.start_ns;
    CFE_TIME_SysTime_t t;
    t.Seconds = (uint32)(ns / 1000000000);
    t.Subseconds = (uint32)(((uint64)(ns % 1000000000) << 32) / 1000000000u);
    return t;
}

void pocket_set_met(uint32 seconds)
{
    pocket_core.start_ns = port_now() - (int64)seconds * 1000000000;
}

/* As in cFE's default configuration: TAI, a million seconds and the mission elapsed time after its epoch. */
CFE_TIME_SysTime_t CFE_TIME_GetTAI(void)
{
    CFE_TIME_SysTime_t t = CFE_TIME_GetMET();
    t.Seconds += 1000000;
    return t;
}

CFE_TIME_SysTime_t CFE_TIME_GetTime(void)
{
    return CFE_TIME_GetTAI();
}

CFE_TIME_SysTime_t CFE_TIME_GetUTC(void)
{
    CFE_TIME_SysTime_t t = CFE_TIME_GetTAI();
    t.Seconds -= 37; /* leap seconds */
    return t;
}

static uint64 whole(CFE_TIME_SysTime_t t)
{
    return (uint64)t.Seconds << 32 | t.Subseconds;
}

static CFE_TIME_SysTime_t parts(uint64 t)
{
    const CFE_TIME_SysTime_t time = {(uint32)(t >> 32), (uint32)t};
    return time;
}

CFE_TIME_SysTime_t CFE_TIME_Add(CFE_TIME_SysTime_t Time1, CFE_TIME_SysTime_t Time2)
{
    return parts(whole(Time1) + whole(Time2));
}

CFE_TIME_SysTime_t CFE_TIME_Subtract(CFE_TIME_SysTime_t Time1, CFE_TIME_SysTime_t Time2)
{
    return parts(whole(Time1) - whole(Time2));
}

CFE_TIME_Compare_t CFE_TIME_Compare(CFE_TIME_SysTime_t TimeA, CFE_TIME_SysTime_t TimeB)
{
    const uint64 a = whole(TimeA), b = whole(TimeB);
    if (a == b) {
        return CFE_TIME_EQUAL;
    }
    return a - b < UINT64_C(1) << 63 ? CFE_TIME_A_GT_B : CFE_TIME_A_LT_B;
}

uint32 CFE_TIME_Sub2MicroSecs(uint32 SubSeconds)
{
    return (uint32)(((uint64)SubSeconds * 1000000u) >> 32);
}

/* Rounded up, so that CFE_TIME_Sub2MicroSecs returns the same number. */
uint32 CFE_TIME_Micro2SubSecs(uint32 MicroSeconds)
{
    return MicroSeconds > 999999u ? UINT32_MAX : (uint32)((((uint64)MicroSeconds << 32) + 999999u) / 1000000u);
}
