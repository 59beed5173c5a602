/* SPDX-License-Identifier: Apache-2.0 */
/* Packets: a primary header of 6 bytes, then a secondary header of 2 bytes (commands) or 10 bytes (telemetry). All is
 * big-endian. */
#ifndef CFE_MSG_H
#define CFE_MSG_H

#include "cfe_config.h"
#include "cfe_error.h"
#include "cfe_time.h"

/** A struct, as in newer versions of cFE: a compiler refuses code that uses it as a number. */
typedef uint32 CFE_SB_MsgId_Atom_t;
typedef struct CFE_SB_MsgId {
    CFE_SB_MsgId_Atom_t Value;
} CFE_SB_MsgId_t;

typedef size_t CFE_MSG_Size_t;
typedef uint16 CFE_MSG_FcnCode_t;
typedef uint16 CFE_MSG_SequenceCount_t;
typedef uint16 CFE_MSG_ApId_t;

typedef enum CFE_MSG_Type { CFE_MSG_Type_Invalid = 0, CFE_MSG_Type_Cmd = 1, CFE_MSG_Type_Tlm = 2 } CFE_MSG_Type_t;

typedef struct CCSDS_PrimaryHeader {
    uint8 StreamId[2];
    uint8 Sequence[2];
    uint8 Length[2];
} CCSDS_PrimaryHeader_t;

typedef struct CCSDS_SpacePacket {
    CCSDS_PrimaryHeader_t Pri;
} CCSDS_SpacePacket_t;

typedef union CFE_MSG_Message {
    CCSDS_SpacePacket_t CCSDS;
    uint8 Byte[sizeof(CCSDS_SpacePacket_t)];
} CFE_MSG_Message_t;

typedef struct CFE_MSG_CommandSecondaryHeader {
    uint8 FunctionCode;
    uint8 Checksum;
} CFE_MSG_CommandSecondaryHeader_t;

typedef struct CFE_MSG_TelemetrySecondaryHeader {
    uint8 Time[6];
} CFE_MSG_TelemetrySecondaryHeader_t;

typedef struct CFE_MSG_CommandHeader {
    CFE_MSG_Message_t Msg;
    CFE_MSG_CommandSecondaryHeader_t Sec;
} CFE_MSG_CommandHeader_t;

typedef struct CFE_MSG_TelemetryHeader {
    CFE_MSG_Message_t Msg;
    CFE_MSG_TelemetrySecondaryHeader_t Sec;
    uint8 Spare[4];
} CFE_MSG_TelemetryHeader_t;

#define CFE_MSG_PTR(shdr) (&((shdr).Msg))

CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size);
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t *MsgId);
CFE_Status_t CFE_MSG_SetMsgId(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t *Size);
CFE_Status_t CFE_MSG_SetSize(CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t Size);
CFE_Status_t CFE_MSG_GetType(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Type_t *Type);
CFE_Status_t CFE_MSG_GetSequenceCount(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_SequenceCount_t *SeqCnt);
CFE_Status_t CFE_MSG_SetSequenceCount(CFE_MSG_Message_t *MsgPtr, CFE_MSG_SequenceCount_t SeqCnt);

/** For commands. A command that is shorter than its header is an error. */
CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_FcnCode_t *FcnCode);
CFE_Status_t CFE_MSG_SetFcnCode(CFE_MSG_Message_t *MsgPtr, CFE_MSG_FcnCode_t FcnCode);
CFE_Status_t CFE_MSG_GenerateChecksum(CFE_MSG_Message_t *MsgPtr);
CFE_Status_t CFE_MSG_ValidateChecksum(const CFE_MSG_Message_t *MsgPtr, bool *IsValid);

/** For telemetry. The time has seconds and the upper 16 bits of the subseconds. */
CFE_Status_t CFE_MSG_SetMsgTime(CFE_MSG_Message_t *MsgPtr, CFE_TIME_SysTime_t NewTime);
CFE_Status_t CFE_MSG_GetMsgTime(const CFE_MSG_Message_t *MsgPtr, CFE_TIME_SysTime_t *Time);

#endif
