/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

#include <string.h>

#define HIGHEST_ID 0x1fffu

static CFE_MSG_Type_t type_of(const CFE_MSG_Message_t *m)
{
    return (m->Byte[0] & 0x10u) != 0u ? CFE_MSG_Type_Cmd : CFE_MSG_Type_Tlm;
}

/* Whether a message is of a type, and has at least the bytes of the header of that type. */
static CFE_Status_t check(const CFE_MSG_Message_t *m, CFE_MSG_Type_t type, size_t header)
{
    return type_of(m) == type && (m->Byte[0] & 0x08u) != 0u && pocket_size(m) >= header ? CFE_SUCCESS
                                                                                        : CFE_MSG_WRONG_MSG_TYPE;
}

static CFE_Status_t check_command(const CFE_MSG_Message_t *m)
{
    return check(m, CFE_MSG_Type_Cmd, sizeof(CFE_MSG_CommandHeader_t));
}

CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size)
{
    const uint32 id = MsgId.Value;
    if (MsgPtr == NULL || id > HIGHEST_ID || Size < 7u || Size > 65542u) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    memset(MsgPtr, 0, Size);
    (void)CFE_MSG_SetMsgId(MsgPtr, MsgId);
    MsgPtr->Byte[2] = 0xc0u;
    return CFE_MSG_SetSize(MsgPtr, Size);
}

CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t *MsgId)
{
    if (MsgPtr == NULL || MsgId == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    MsgId->Value = pocket_id(MsgPtr);
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_SetMsgId(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId)
{
    if (MsgPtr == NULL || MsgId.Value > HIGHEST_ID) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    MsgPtr->Byte[0] = (uint8)(MsgId.Value >> 8);
    MsgPtr->Byte[1] = (uint8)MsgId.Value;
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t *Size)
{
    if (MsgPtr == NULL || Size == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    *Size = pocket_size(MsgPtr);
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_SetSize(CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t Size)
{
    if (MsgPtr == NULL || Size < 7u || Size > 65542u) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    MsgPtr->Byte[4] = (uint8)((Size - 7u) >> 8);
    MsgPtr->Byte[5] = (uint8)(Size - 7u);
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetType(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Type_t *Type)
{
    if (MsgPtr == NULL || Type == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    *Type = type_of(MsgPtr);
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetSequenceCount(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_SequenceCount_t *SeqCnt)
{
    if (MsgPtr == NULL || SeqCnt == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    *SeqCnt = (uint16)((MsgPtr->Byte[2] & 0x3fu) << 8 | MsgPtr->Byte[3]);
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_SetSequenceCount(CFE_MSG_Message_t *MsgPtr, CFE_MSG_SequenceCount_t SeqCnt)
{
    if (MsgPtr == NULL || SeqCnt > 0x3fffu) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    MsgPtr->Byte[2] = (uint8)((MsgPtr->Byte[2] & 0xc0u) | SeqCnt >> 8);
    MsgPtr->Byte[3] = (uint8)SeqCnt;
    return CFE_SUCCESS;
}

/* ---- commands */

CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_FcnCode_t *FcnCode)
{
    if (MsgPtr == NULL || FcnCode == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check_command(MsgPtr);
    *FcnCode = status == CFE_SUCCESS ? ((const uint8 *)MsgPtr)[6] & 0x7fu : 0u;
    return status;
}

CFE_Status_t CFE_MSG_SetFcnCode(CFE_MSG_Message_t *MsgPtr, CFE_MSG_FcnCode_t FcnCode)
{
    if (MsgPtr == NULL || FcnCode > 0x7fu) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check_command(MsgPtr);
    if (status == CFE_SUCCESS) {
        ((uint8 *)MsgPtr)[6] = (uint8)FcnCode;
    }
    return status;
}

/* The exclusive or of 0xFF and all bytes: 0 if the checksum is right. */
static uint8 sum(const CFE_MSG_Message_t *m)
{
    const uint8 *p = (const uint8 *)m;
    const size_t n = pocket_size(m);
    uint8 s = 0xffu;
    for (size_t i = 0; i < n; i++) {
        s ^= p[i];
    }
    return s;
}

CFE_Status_t CFE_MSG_GenerateChecksum(CFE_MSG_Message_t *MsgPtr)
{
    if (MsgPtr == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check_command(MsgPtr);
    if (status == CFE_SUCCESS) {
        ((uint8 *)MsgPtr)[7] = 0u;
        ((uint8 *)MsgPtr)[7] = sum(MsgPtr);
    }
    return status;
}

CFE_Status_t CFE_MSG_ValidateChecksum(const CFE_MSG_Message_t *MsgPtr, bool *IsValid)
{
    if (MsgPtr == NULL || IsValid == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check_command(MsgPtr);
    *IsValid = status == CFE_SUCCESS && sum(MsgPtr) == 0u;
    return status;
}

/* ---- telemetry */

CFE_Status_t CFE_MSG_SetMsgTime(CFE_MSG_Message_t *MsgPtr, CFE_TIME_SysTime_t NewTime)
{
    if (MsgPtr == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check(MsgPtr, CFE_MSG_Type_Tlm, 12u);
    if (status == CFE_SUCCESS) {
        uint8 *p = (uint8 *)MsgPtr + 6;
        for (uint32 i = 0; i < 4u; i++) {
            p[i] = (uint8)(NewTime.Seconds >> (24u - 8u * i));
        }
        p[4] = (uint8)(NewTime.Subseconds >> 24);
        p[5] = (uint8)(NewTime.Subseconds >> 16);
    }
    return status;
}

CFE_Status_t CFE_MSG_GetMsgTime(const CFE_MSG_Message_t *MsgPtr, CFE_TIME_SysTime_t *Time)
{
    if (MsgPtr == NULL || Time == NULL) {
        return CFE_MSG_BAD_ARGUMENT;
    }
    const CFE_Status_t status = check(MsgPtr, CFE_MSG_Type_Tlm, 12u);
    memset(Time, 0, sizeof *Time);
    if (status == CFE_SUCCESS) {
        const uint8 *p = (const uint8 *)MsgPtr + 6;
        Time->Seconds = (uint32)p[0] << 24 | (uint32)p[1] << 16 | (uint32)p[2] << 8 | p[3];
        Time->Subseconds = (uint32)p[4] << 24 | (uint32)p[5] << 16;
    }
    return status;
}
