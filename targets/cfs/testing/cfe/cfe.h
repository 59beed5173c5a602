/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: what an app uses, as Draco and 7.x have it in strict builds: ids are structs of their own types, messages
 * are const to the bus, and a message begins with a struct. With CAELUM, as Caelum has it: ids are numbers, there is no
 * CFE_MSG_PTR, the bus takes messages that are not const, and cFE's headers include OSAL's. */
#ifndef CFE_H
#define CFE_H

#include "common_types.h"
#ifdef CAELUM
#include "osapi.h"
#endif

typedef int32 CFE_Status_t;
typedef uint32 CFE_SB_MsgId_Atom_t;
#ifdef CAELUM
typedef uint32 CFE_SB_MsgId_t;
typedef uint32 CFE_SB_PipeId_t;
typedef uint32 CFE_ES_TaskId_t;
typedef uint8 TaskPriority;
#define BUS_CONST
static inline CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t v)
{
    return v;
}
static inline CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t id)
{
    return id;
}
typedef union CFE_MSG_Message {
    uint8 CCSDS[6];
    uint8 Byte[6];
} CFE_MSG_Message_t;
#else
typedef struct CFE_SB_MsgId {
    CFE_SB_MsgId_Atom_t Value;
} CFE_SB_MsgId_t;
typedef struct CFE_SB_PipeId {
    uint32 id;
} CFE_SB_PipeId_t;
typedef struct CFE_ES_TaskId {
    uint32 id;
} CFE_ES_TaskId_t;
typedef uint16 TaskPriority;
#define BUS_CONST const
static inline CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t v)
{
    const CFE_SB_MsgId_t id = {v};
    return id;
}
static inline CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t id)
{
    return id.Value;
}
typedef struct CFE_MSG_Message {
    struct {
        uint8 StreamId[2];
        uint8 Sequence[2];
        uint8 Length[2];
    } CCSDS;
} CFE_MSG_Message_t;
#define CFE_MSG_PTR(header) (&((header).Msg))
#endif
typedef struct CFE_MSG_CommandSecondaryHeader {
    uint8 FunctionCode;
    uint8 Checksum;
} CFE_MSG_CommandSecondaryHeader_t;
typedef struct CFE_MSG_CommandHeader {
    CFE_MSG_Message_t Msg;
    CFE_MSG_CommandSecondaryHeader_t Sec;
} CFE_MSG_CommandHeader_t;
typedef struct CFE_MSG_TelemetryHeader {
    CFE_MSG_Message_t Msg;
    uint8 Time[6];
    uint8 Spare[4];
} CFE_MSG_TelemetryHeader_t;
typedef union CFE_SB_Msg {
    CFE_MSG_Message_t Msg;
    long long int LongInt;
    long double LongDouble;
} CFE_SB_Buffer_t;
typedef struct CFE_TIME_SysTime {
    uint32 Seconds;
    uint32 Subseconds;
} CFE_TIME_SysTime_t;
typedef size_t CFE_MSG_Size_t;
typedef uint16 CFE_MSG_FcnCode_t;
typedef uint16 CFE_MSG_SequenceCount_t;
typedef int16 CFE_TBL_Handle_t;
typedef int32 (*CFE_TBL_CallbackFuncPtr_t)(void *);
typedef enum CFE_TBL_SrcEnum { CFE_TBL_SRC_FILE, CFE_TBL_SRC_ADDRESS } CFE_TBL_SrcEnum_t;

#define CFE_SUCCESS (0)
#define CFE_STATUS_EXTERNAL_RESOURCE_FAIL ((CFE_Status_t)0xc8000005)
#define CFE_SB_TIME_OUT ((CFE_Status_t)0xca000001)
#define CFE_SB_NO_MESSAGE ((CFE_Status_t)0xca000002)
#define CFE_TBL_ERR_INVALID_NAME ((CFE_Status_t)0xcc000002)
#define CFE_TBL_INFO_UPDATED ((CFE_Status_t)0x4c00000e)
#define CFE_TBL_OPT_DEFAULT 0
#define CFE_EVS_EventFilter_BINARY 0
#define CFE_EVS_EventType_INFORMATION 2
#define CFE_EVS_EventType_ERROR 3
#define CFE_ES_RunStatus_APP_RUN 1
#define CFE_ES_RunStatus_APP_EXIT 2
#define CFE_ES_RunStatus_APP_ERROR 3
#define CFE_ES_TASK_STACK_ALLOCATE NULL

#define CFE_ES_PerfLogEntry(id) CFE_ES_PerfLogAdd(id, 0)
#define CFE_ES_PerfLogExit(id) CFE_ES_PerfLogAdd(id, 1)

bool CFE_ES_RunLoop(uint32 *);
void CFE_ES_ExitApp(uint32);
void CFE_ES_WaitForStartupSync(uint32);
void CFE_ES_PerfLogAdd(uint32, uint32);
CFE_TIME_SysTime_t CFE_TIME_GetMET(void);
CFE_TIME_SysTime_t CFE_TIME_GetTime(void);
CFE_Status_t CFE_ES_WriteToSysLog(const char *, ...) OS_PRINTF(1, 2);
CFE_Status_t CFE_ES_CreateChildTask(CFE_ES_TaskId_t *, const char *, void (*)(void), void *, size_t, TaskPriority,
                                    uint32);
void CFE_ES_ExitChildTask(void);
CFE_Status_t CFE_EVS_Register(const void *, uint16, uint16);
CFE_Status_t CFE_EVS_SendEvent(uint16, uint16, const char *, ...) OS_PRINTF(3, 4);
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *, uint16, const char *);
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t, CFE_SB_PipeId_t);
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **, CFE_SB_PipeId_t, int32);
CFE_Status_t CFE_SB_TransmitMsg(BUS_CONST CFE_MSG_Message_t *, bool);
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *, CFE_SB_MsgId_t, CFE_MSG_Size_t);
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *, CFE_SB_MsgId_t *);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *, CFE_MSG_Size_t *);
CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t *, CFE_MSG_FcnCode_t *);
CFE_Status_t CFE_MSG_ValidateChecksum(const CFE_MSG_Message_t *, bool *);
CFE_Status_t CFE_MSG_GenerateChecksum(CFE_MSG_Message_t *);
CFE_Status_t CFE_MSG_SetMsgTime(CFE_MSG_Message_t *, CFE_TIME_SysTime_t);
CFE_Status_t CFE_MSG_SetSequenceCount(CFE_MSG_Message_t *, CFE_MSG_SequenceCount_t);
CFE_Status_t CFE_MSG_SetMsgId(CFE_MSG_Message_t *, CFE_SB_MsgId_t);
CFE_Status_t CFE_TBL_Register(CFE_TBL_Handle_t *, const char *, size_t, uint16, CFE_TBL_CallbackFuncPtr_t);
CFE_Status_t CFE_TBL_Load(CFE_TBL_Handle_t, CFE_TBL_SrcEnum_t, const void *);
CFE_Status_t CFE_TBL_Manage(CFE_TBL_Handle_t);
CFE_Status_t CFE_TBL_Modified(CFE_TBL_Handle_t);
CFE_Status_t CFE_TBL_GetAddress(void **, CFE_TBL_Handle_t);
CFE_Status_t CFE_TBL_ReleaseAddress(CFE_TBL_Handle_t);

#endif
