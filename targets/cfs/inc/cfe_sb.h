/* SPDX-License-Identifier: Apache-2.0 */
/* The software bus. */
#ifndef CFE_SB_H
#define CFE_SB_H

#include "cfe_msg.h"

#define CFE_SB_POLL 0
#define CFE_SB_PEND_FOREVER (-1)

typedef struct CFE_SB_PipeId {
    uint32 id;
} CFE_SB_PipeId_t;

typedef struct CFE_SB_Qos {
    uint8 Priority;
    uint8 Reliability;
} CFE_SB_Qos_t;

typedef union CFE_SB_Msg {
    CFE_MSG_Message_t Msg;
    long long int LongInt;
    long double LongDouble;
} CFE_SB_Buffer_t;

#define CFE_SB_DEFAULT_QOS ((CFE_SB_Qos_t){0, 0})
#define CFE_SB_INVALID_PIPE ((CFE_SB_PipeId_t){0})
#define CFE_SB_MSGID_WRAP_VALUE(value)                                                                                 \
    {                                                                                                                  \
        (CFE_SB_MsgId_Atom_t)(value)                                                                                   \
    }
#define CFE_SB_MSGID_RESERVED CFE_SB_MSGID_WRAP_VALUE(-1)
#define CFE_SB_INVALID_MSG_ID ((CFE_SB_MsgId_t)CFE_SB_MSGID_RESERVED)

static inline CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t MsgIdValue)
{
    const CFE_SB_MsgId_t id = {MsgIdValue};
    return id;
}

static inline CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t MsgId)
{
    return MsgId.Value;
}

static inline bool CFE_SB_MsgId_Equal(CFE_SB_MsgId_t MsgId1, CFE_SB_MsgId_t MsgId2)
{
    return MsgId1.Value == MsgId2.Value;
}

bool CFE_SB_IsValidMsgId(CFE_SB_MsgId_t MsgId);

CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *PipeIdPtr, uint16 Depth, const char *PipeName);
CFE_Status_t CFE_SB_DeletePipe(CFE_SB_PipeId_t PipeId);

CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId);
/** MsgLim: how many messages of this id may wait in the pipe. */
CFE_Status_t CFE_SB_SubscribeEx(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId, CFE_SB_Qos_t Quality, uint16 MsgLim);
CFE_Status_t CFE_SB_Unsubscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId);

/** Receive the next message of a pipe. The buffer is valid until the next call for the same pipe.
 *  TimeOut: [ms], CFE_SB_POLL or CFE_SB_PEND_FOREVER. */
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut);

/** Send a message to all subscribers. With IsOrigination, the bus sets the sequence count, and the checksum of a
 *  command. */
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *MsgPtr, bool IsOrigination);

/** Set the time of a telemetry message to CFE_TIME_GetTime. */
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *MsgPtr);

void *CFE_SB_GetUserData(CFE_MSG_Message_t *MsgPtr);
size_t CFE_SB_GetUserDataLength(const CFE_MSG_Message_t *MsgPtr);

#endif
