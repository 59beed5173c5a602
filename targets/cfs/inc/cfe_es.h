/* SPDX-License-Identifier: Apache-2.0 */
/* The executive: apps, their tasks, and data that outlive an app. */
#ifndef CFE_ES_H
#define CFE_ES_H

#include "cfe_config.h"
#include "cfe_error.h"
#include "osapi.h"

typedef struct CFE_ES_AppId {
    uint32 id;
} CFE_ES_AppId_t;
typedef struct CFE_ES_TaskId {
    uint32 id;
} CFE_ES_TaskId_t;
typedef struct CFE_ES_CDSHandle {
    uint32 id;
} CFE_ES_CDSHandle_t;

enum CFE_ES_RunStatus {
    CFE_ES_RunStatus_UNDEFINED = 0,
    CFE_ES_RunStatus_APP_RUN = 1,
    CFE_ES_RunStatus_APP_EXIT = 2,
    CFE_ES_RunStatus_APP_ERROR = 3,
    CFE_ES_RunStatus_SYS_EXCEPTION = 4,
    CFE_ES_RunStatus_SYS_RESTART = 5,
    CFE_ES_RunStatus_SYS_RELOAD = 6,
    CFE_ES_RunStatus_SYS_DELETE = 7
};

#define CFE_PSP_RST_TYPE_PROCESSOR 1
#define CFE_PSP_RST_TYPE_POWERON 2
#define CFE_ES_APP_RESTART 3
#define CFE_PSP_RST_SUBTYPE_POWER_CYCLE 1

typedef void (*CFE_ES_ChildTaskMainFuncPtr_t)(void);
typedef void *CFE_ES_StackPointer_t;
typedef uint16 CFE_ES_TaskPriority_Atom_t;
#define CFE_ES_TASK_STACK_ALLOCATE NULL

typedef enum CFE_ES_CrcType {
    CFE_ES_CrcType_CRC_8 = 1,
    CFE_ES_CrcType_CRC_16 = 2,
    CFE_ES_CrcType_CRC_32 = 3
} CFE_ES_CrcType_Enum_t;
#define CFE_MISSION_ES_DEFAULT_CRC CFE_ES_CrcType_CRC_16

/** True as long as the app shall run. */
bool CFE_ES_RunLoop(uint32 *RunStatus);
void CFE_ES_ExitApp(uint32 ExitStatus);
/** Wait until all apps of the start-up script have called this or CFE_ES_RunLoop, or until a timeout [ms]. */
void CFE_ES_WaitForStartupSync(uint32 TimeOutMilliseconds);
int32 CFE_ES_GetResetType(uint32 *ResetSubtypePtr);

CFE_Status_t CFE_ES_GetAppID(CFE_ES_AppId_t *AppIdPtr);
CFE_Status_t CFE_ES_GetAppName(char *AppName, CFE_ES_AppId_t AppId, size_t BufferLength);

/** If StackPtr is NULL, the port allocates a stack. The task ends when its function returns. */
CFE_Status_t CFE_ES_CreateChildTask(CFE_ES_TaskId_t *TaskIdPtr, const char *TaskName,
                                    CFE_ES_ChildTaskMainFuncPtr_t FunctionPtr, CFE_ES_StackPointer_t StackPtr,
                                    size_t StackSize, CFE_ES_TaskPriority_Atom_t Priority, uint32 Flags);
void CFE_ES_ExitChildTask(void);
/** The task ends at its next call of cFE or OSAL, or now if it waits in one. */
CFE_Status_t CFE_ES_DeleteChildTask(CFE_ES_TaskId_t TaskId);
CFE_Status_t CFE_ES_GetTaskID(CFE_ES_TaskId_t *TaskIdPtr);

CFE_Status_t CFE_ES_WriteToSysLog(const char *SpecStringPtr, ...) OS_PRINTF(1, 2);

/** The default CRC: x^16 + x^15 + x^2 + 1, least bit first; for other types the result is 0. */
uint32 CFE_ES_CalculateCRC(const void *DataPtr, size_t DataLength, uint32 InputCRC, CFE_ES_CrcType_Enum_t TypeCRC);

/** Data that outlive a restart of their app. CFE_ES_CDS_ALREADY_EXISTS: they come from before the restart. */
CFE_Status_t CFE_ES_RegisterCDS(CFE_ES_CDSHandle_t *CDSHandlePtr, size_t BlockSize, const char *Name);
CFE_Status_t CFE_ES_CopyToCDS(CFE_ES_CDSHandle_t Handle, const void *DataToCopy);
CFE_Status_t CFE_ES_RestoreFromCDS(void *RestoreToMemory, CFE_ES_CDSHandle_t Handle);

/** Does nothing: the pocket measures no performance. */
void CFE_ES_PerfLogAdd(uint32 Marker, uint32 EntryExit);
#define CFE_ES_PerfLogEntry(id) (CFE_ES_PerfLogAdd(id, 0))
#define CFE_ES_PerfLogExit(id) (CFE_ES_PerfLogAdd(id, 1))

#endif
