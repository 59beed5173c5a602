/* SPDX-License-Identifier: Apache-2.0 */
/* The software bus: it stores one copy of a message for all its subscribers, and pipes hold references to it. */
#include "targets/cfs/core.h"

#include <string.h>

#define NONE UINT16_MAX

enum {
    OVERFLOW_EVENT = 17,
    FULL_EVENT = 25,
    CHECKSUM_EVENT = 60,
    SHORT_EVENT = 61,
    TOO_BIG_EVENT = 15,
    ROOM_EVENT = 62,
    NO_PACKET_EVENT = 63
};

typedef struct Message {
    uint32 references;
    uint32 size;
    union {
        CFE_SB_Buffer_t buffer;
        uint8 bytes[POCKET_MESSAGE_MAX];
    } content;
} Message;

typedef struct Pipe {
    char name[OS_MAX_API_NAME];
    uint32 app;
    uint16 generation;
    bool used;
    uint16 depth;
    uint16 first;
    uint16 n;
    uint16 held; ///< the message that the app received last
    uint16 messages[POCKET_PIPE_DEPTH];
    uint16 routes[POCKET_PIPE_DEPTH];
} Pipe;

typedef struct Route {
    uint32 id; ///< of the messages
    uint16 pipe;
    uint16 limit;
    uint16 waiting;
    bool used;
} Route;

typedef struct Sent {
    uint32 id;
    uint16 sequence;
    bool used;
} Sent;

static struct {
    Message messages[POCKET_MESSAGES];
    Pipe pipes[POCKET_PIPES];
    Route routes[POCKET_ROUTES];
    Sent sent[POCKET_SENT];
} sb;

void pocket_sb_start(void)
{
    memset(&sb, 0, sizeof sb);
}

bool CFE_SB_IsValidMsgId(CFE_SB_MsgId_t MsgId)
{
    return MsgId.Value != 0u && MsgId.Value <= 0x1fffu;
}

/* ---- pipes */

static Pipe *pipe_of(CFE_SB_PipeId_t id)
{
    const uint32 i = index_of(id.id, KIND_PIPE, POCKET_PIPES);
    if (i == POCKET_PIPES || !sb.pipes[i].used || make_id(KIND_PIPE, sb.pipes[i].generation, i) != id.id) {
        return NULL;
    }
    return &sb.pipes[i];
}

static void release(uint16 *message)
{
    if (*message != NONE) {
        sb.messages[*message].references--;
        *message = NONE;
    }
}

static void close_pipe(Pipe *pipe)
{
    const uint16 index = (uint16)(pipe - sb.pipes);
    for (uint32 i = 0; i < POCKET_ROUTES; i++) {
        if (sb.routes[i].pipe == index) {
            sb.routes[i].used = false;
        }
    }
    for (; pipe->n > 0u; pipe->n--) {
        release(&pipe->messages[pipe->first]);
        pipe->first = (uint16)((pipe->first + 1u) % pipe->depth);
    }
    release(&pipe->held);
    pipe->used = false;
    pipe->generation++;
    pocket_wake_locked(pipe);
}

CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *PipeIdPtr, uint16 Depth, const char *PipeName)
{
    CFE_Status_t status = CFE_SB_MAX_PIPES_MET;
    if (PipeIdPtr == NULL || Depth == 0u || Depth > POCKET_PIPE_DEPTH) {
        return CFE_SB_BAD_ARGUMENT;
    }
    pocket_lock();
    for (uint32 i = 0; i < POCKET_PIPES; i++) {
        Pipe *pipe = &sb.pipes[i];
        if (pipe->used) {
            continue;
        }
        const uint16 generation = pipe->generation;
        memset(pipe, 0, sizeof *pipe);
        if (!pocket_name(pipe->name, sizeof pipe->name, PipeName)) {
            status = CFE_SB_BAD_ARGUMENT;
            break;
        }
        pipe->app = pocket_self_app_locked();
        pipe->generation = generation;
        pipe->depth = Depth;
        pipe->held = NONE;
        pipe->used = true;
        PipeIdPtr->id = make_id(KIND_PIPE, generation, i);
        status = CFE_SUCCESS;
        break;
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_SB_DeletePipe(CFE_SB_PipeId_t PipeId)
{
    pocket_lock();
    Pipe *pipe = pipe_of(PipeId);
    const bool ours = pipe != NULL && pipe->app == pocket_self_app_locked();
    if (ours) {
        close_pipe(pipe);
    }
    pocket_unlock();
    return ours ? CFE_SUCCESS : CFE_SB_BAD_ARGUMENT;
}

void pocket_sb_app_ended_locked(uint32 app)
{
    for (uint32 i = 0; i < POCKET_PIPES; i++) {
        if (sb.pipes[i].used && sb.pipes[i].app == app) {
            close_pipe(&sb.pipes[i]);
        }
    }
}

/* ---- subscriptions */

static Route *route_of(uint32 id, uint16 pipe)
{
    for (uint32 i = 0; i < POCKET_ROUTES; i++) {
        if (sb.routes[i].used && sb.routes[i].id == id && sb.routes[i].pipe == pipe) {
            return &sb.routes[i];
        }
    }
    return NULL;
}

CFE_Status_t CFE_SB_SubscribeEx(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId, CFE_SB_Qos_t Quality, uint16 MsgLim)
{
    CFE_Status_t status = CFE_SB_MAX_DESTS_MET;
    (void)Quality;
    pocket_lock();
    Pipe *pipe = pipe_of(PipeId);
    if (pipe == NULL || pipe->app != pocket_self_app_locked() || !CFE_SB_IsValidMsgId(MsgId) || MsgLim == 0u) {
        status = CFE_SB_BAD_ARGUMENT;
    } else if (route_of(MsgId.Value, (uint16)(pipe - sb.pipes)) != NULL) {
        status = CFE_SUCCESS; /* a second subscription changes nothing, as in NASA's cFE */
    } else {
        for (uint32 i = 0; i < POCKET_ROUTES; i++) {
            if (!sb.routes[i].used) {
                const Route route = {MsgId.Value, (uint16)(pipe - sb.pipes), MsgLim, 0, true};
                sb.routes[i] = route;
                status = CFE_SUCCESS;
                break;
            }
        }
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId)
{
    return CFE_SB_SubscribeEx(MsgId, PipeId, CFE_SB_DEFAULT_QOS, CFE_PLATFORM_SB_DEFAULT_MSG_LIMIT);
}

CFE_Status_t CFE_SB_Unsubscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId)
{
    CFE_Status_t status = CFE_SB_BAD_ARGUMENT;
    pocket_lock();
    Pipe *pipe = pipe_of(PipeId);
    if (pipe != NULL && pipe->app == pocket_self_app_locked() && CFE_SB_IsValidMsgId(MsgId)) {
        Route *route = route_of(MsgId.Value, (uint16)(pipe - sb.pipes));
        status = CFE_SB_NO_SUBSCRIBERS;
        if (route != NULL) {
            /* Messages that wait in the pipe stay there, but no longer count against a limit. */
            const uint16 number = (uint16)(route - sb.routes);
            for (uint16 i = 0; i < pipe->n; i++) {
                uint16 *r = &pipe->routes[(pipe->first + i) % pipe->depth];
                *r = *r == number ? NONE : *r;
            }
            route->used = false;
            status = CFE_SUCCESS;
        }
    }
    pocket_unlock();
    return status;
}

/* ---- messages */

CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut)
{
    CFE_Status_t status = CFE_SUCCESS;
    if (BufPtr == NULL || TimeOut < CFE_SB_PEND_FOREVER) {
        return CFE_SB_BAD_ARGUMENT;
    }
    *BufPtr = NULL;
    pocket_lock();
    const int64 until = pocket_until(TimeOut);
    const uint32 app = pocket_self_app_locked();
    const bool main = pocket_core.apps[app].main_task == port_task_self();
    Pipe *pipe = pipe_of(PipeId);
    if (pipe == NULL || pipe->app != app) {
        pocket_unlock();
        return CFE_SB_BAD_ARGUMENT;
    }
    release(&pipe->held);
    while (pipe->n == 0u && status == CFE_SUCCESS) {
        if (TimeOut == CFE_SB_POLL) {
            status = CFE_SB_NO_MESSAGE;
        } else if ((main && pocket_core.apps[app].requested != 0u) || !pocket_sleep_locked(pipe, until)) {
            status = CFE_SB_TIME_OUT; /* also where the app must end: its main task returns, and calls RunLoop */
        } else if (pipe_of(PipeId) == NULL) {
            status = CFE_SB_PIPE_RD_ERR;
        }
    }
    if (status == CFE_SUCCESS) {
        const uint16 route = pipe->routes[pipe->first];
        pipe->held = pipe->messages[pipe->first];
        pipe->messages[pipe->first] = NONE;
        pipe->first = (uint16)((pipe->first + 1u) % pipe->depth);
        pipe->n--;
        if (route != NONE) {
            sb.routes[route].waiting--;
        }
        *BufPtr = &sb.messages[pipe->held].content.buffer;
    }
    pocket_unlock();
    return status;
}

void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *MsgPtr)
{
    (void)CFE_MSG_SetMsgTime(MsgPtr, CFE_TIME_GetTime());
}

static size_t header_size(const CFE_MSG_Message_t *m)
{
    return (m->Byte[0] & 0x10u) != 0u ? sizeof(CFE_MSG_CommandHeader_t) : sizeof(CFE_MSG_TelemetryHeader_t);
}

void *CFE_SB_GetUserData(CFE_MSG_Message_t *MsgPtr)
{
    return MsgPtr == NULL ? NULL : (uint8 *)MsgPtr + header_size(MsgPtr);
}

size_t CFE_SB_GetUserDataLength(const CFE_MSG_Message_t *MsgPtr)
{
    if (MsgPtr == NULL || pocket_size(MsgPtr) < header_size(MsgPtr)) {
        return 0;
    }
    return pocket_size(MsgPtr) - header_size(MsgPtr);
}

static uint16 next_sequence(uint32 id)
{
    for (uint32 i = 0; i < POCKET_SENT; i++) {
        Sent *s = &sb.sent[i];
        if (!s->used) {
            s->used = true;
            s->id = id;
        }
        if (s->id == id) {
            s->sequence = (uint16)((s->sequence + 1u) & 0x3fffu);
            return s->sequence;
        }
    }
    return 0;
}

static uint16 free_message(void)
{
    for (uint16 i = 0; i < POCKET_MESSAGES; i++) {
        if (sb.messages[i].references == 0u) {
            return i;
        }
    }
    return NONE;
}

/* The pipes that did not take a message. The pocket sends their events after it has released the lock. */
typedef struct Refusals {
    uint32 n;
    uint16 why[4];
    char pipe[4][OS_MAX_API_NAME];
} Refusals;

static void refuse(Refusals *refusals, uint16 why, const Pipe *pipe)
{
    if (refusals->n < 4u) {
        refusals->why[refusals->n] = why;
        memcpy(refusals->pipe[refusals->n], pipe->name, sizeof pipe->name);
        refusals->n++;
    }
}

static CFE_Status_t deliver(const CFE_MSG_Message_t *m, size_t size, bool origination, Refusals *refusals)
{
    const uint32 id = pocket_id(m);
    const uint16 sequence = origination ? next_sequence(id) : 0u;
    uint16 message = NONE;
    for (uint16 i = 0; i < POCKET_ROUTES; i++) {
        Route *route = &sb.routes[i];
        if (!route->used || route->id != id) {
            continue;
        }
        Pipe *pipe = &sb.pipes[route->pipe];
        if (route->waiting >= route->limit) {
            pocket_core.counts.overflow++;
            refuse(refusals, OVERFLOW_EVENT, pipe);
            continue;
        }
        if (pipe->n >= pipe->depth) {
            pocket_core.counts.pipe_full++;
            refuse(refusals, FULL_EVENT, pipe);
            continue;
        }
        if (message == NONE) {
            message = free_message();
            if (message == NONE) {
                pocket_core.counts.no_buffer++;
                refuse(refusals, ROOM_EVENT, pipe);
                return CFE_SB_BUF_ALOC_ERR;
            }
            CFE_MSG_Message_t *copy = &sb.messages[message].content.buffer.Msg;
            memcpy(sb.messages[message].content.bytes, m, size);
            sb.messages[message].size = (uint32)size;
            if (origination) {
                (void)CFE_MSG_SetSequenceCount(copy, sequence);
                (void)CFE_MSG_SetMsgTime(copy, CFE_TIME_GetTime()); /* as Draco and 7.x; Caelum leaves it alone */
                (void)CFE_MSG_GenerateChecksum(copy);
            }
        }
        const uint32 end = (pipe->first + (uint32)pipe->n) % pipe->depth;
        pipe->messages[end] = message;
        pipe->routes[end] = i;
        pipe->n++;
        route->waiting++;
        sb.messages[message].references++;
        pocket_wake_locked(pipe);
    }
    if (message != NONE) {
        pocket_core.counts.sent++;
    } else if (refusals->n == 0u) {
        pocket_core.counts.no_subscriber++;
    }
    return CFE_SUCCESS;
}

/* NASA's cFE delivers every command without a check; the pocket also sends an event for a bad one. */
static void report_bad_command(const CFE_MSG_Message_t *m, uint32 id, size_t size)
{
    bool valid = false;
    if (size < sizeof(CFE_MSG_CommandHeader_t)) {
        pocket_lock();
        pocket_core.counts.short_command++;
        pocket_unlock();
        pocket_event("CFE_SB", SHORT_EVENT, CFE_EVS_EventType_ERROR,
                     "Command 0x%04X of %u bytes is shorter than its header", (unsigned)id, (unsigned)size);
    } else if (CFE_MSG_ValidateChecksum(m, &valid) == CFE_SUCCESS && !valid) {
        pocket_lock();
        pocket_core.counts.bad_checksum++;
        pocket_unlock();
        pocket_event("CFE_SB", CHECKSUM_EVENT, CFE_EVS_EventType_ERROR, "Command 0x%04X has a wrong checksum",
                     (unsigned)id);
    }
}

CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *MsgPtr, bool IsOrigination)
{
    Refusals refusals;
    if (MsgPtr == NULL) {
        return CFE_SB_BAD_ARGUMENT;
    }
    const uint32 id = pocket_id(MsgPtr);
    const size_t size = pocket_size(MsgPtr);
    if (!CFE_SB_IsValidMsgId(CFE_SB_ValueToMsgId(id))) {
        return CFE_SB_BAD_ARGUMENT;
    }
    if (size > POCKET_MESSAGE_MAX) {
        pocket_event("CFE_SB", TOO_BIG_EVENT, CFE_EVS_EventType_ERROR, "Message 0x%04X has %u bytes; the limit is %u",
                     (unsigned)id, (unsigned)size, (unsigned)POCKET_MESSAGE_MAX);
        return CFE_SB_MSG_TOO_BIG;
    }
    if ((id & 0x1000u) != 0u && !IsOrigination) {
        report_bad_command(MsgPtr, id, size);
    }
    refusals.n = 0;
    pocket_lock();
    const CFE_Status_t status = deliver(MsgPtr, size, IsOrigination, &refusals);
    pocket_unlock();
    for (uint32 i = 0; i < refusals.n && id != CFE_EVS_LONG_EVENT_MSG_MID; i++) {
        pocket_event("CFE_SB", refusals.why[i], CFE_EVS_EventType_ERROR,
                     refusals.why[i] == OVERFLOW_EVENT ? "Message 0x%04X lost: too many of them wait in pipe %s"
                     : refusals.why[i] == FULL_EVENT   ? "Message 0x%04X lost: pipe %s is full"
                                                       : "Message 0x%04X lost: no buffer for pipe %s",
                     (unsigned)id, refusals.pipe[i]);
    }
    if (id == CFE_TBL_CMD_MID) {
        pocket_tbl_command(MsgPtr, size);
    }
    return status;
}

bool pocket_ingest(const void *bytes, size_t n)
{
    static union {
        CFE_SB_Buffer_t buffer;
        uint8 bytes[POCKET_MESSAGE_MAX];
    } packet; /* the host calls this from one task */
    if (bytes != NULL && n >= 7u && n <= sizeof packet) {
        memcpy(packet.bytes, bytes, n);
        if (pocket_size(&packet.buffer.Msg) == n &&
            CFE_SB_TransmitMsg(&packet.buffer.Msg, false) != CFE_SB_BAD_ARGUMENT) {
            return true;
        }
    }
    pocket_lock();
    pocket_core.counts.no_packet++;
    pocket_unlock();
    pocket_event("CFE_SB", NO_PACKET_EVENT, CFE_EVS_EventType_ERROR, "The host passed %u bytes that are not a packet",
                 (unsigned)n);
    return false;
}
