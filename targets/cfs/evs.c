/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define SPACECRAFT 66u
#define PROCESSOR 1u

/* Format the text of an event. A text that is too long is cut, and then ends in $. */
static void format(char *text, const char *spec, va_list list)
{
    const int n = vsnprintf(text, CFE_MISSION_EVS_MAX_MESSAGE_LENGTH, spec, list);
    if (n < 0) {
        text[0] = '\0';
    } else if (n >= CFE_MISSION_EVS_MAX_MESSAGE_LENGTH) {
        text[CFE_MISSION_EVS_MAX_MESSAGE_LENGTH - 2] = '$';
    }
}

static void send(const char *name, uint16 id, uint16 type, const char *text)
{
    CFE_EVS_LongEventTlm_t event;
    char line[CFE_MISSION_EVS_MAX_MESSAGE_LENGTH + 64];
    (void)CFE_MSG_Init(&event.TelemetryHeader.Msg, CFE_SB_ValueToMsgId(CFE_EVS_LONG_EVENT_MSG_MID), sizeof event);
    (void)pocket_name(event.Payload.PacketID.AppName, sizeof event.Payload.PacketID.AppName, name);
    event.Payload.PacketID.EventID = id;
    event.Payload.PacketID.EventType = type;
    event.Payload.PacketID.SpacecraftID = SPACECRAFT;
    event.Payload.PacketID.ProcessorID = PROCESSOR;
    (void)strcpy(event.Payload.Message, text);

    pocket_lock();
    const bool quiet = pocket_core.quiet;
    pocket_core.counts.events++;
    if (type >= CFE_EVS_EventType_ERROR) {
        pocket_core.counts.errors++;
    }
    pocket_unlock();
    const int n =
        snprintf(line, sizeof line, "EVS Port1 %u/%u/%s %u: %s\n", SPACECRAFT, PROCESSOR, name, (unsigned)id, text);
    if (!quiet && n > 0) {
        port_console(line, (size_t)n);
    }
    (void)CFE_SB_TransmitMsg(&event.TelemetryHeader.Msg, true);
}

void pocket_event(const char *service, uint16 id, uint16 type, const char *spec, ...)
{
    char text[CFE_MISSION_EVS_MAX_MESSAGE_LENGTH];
    va_list list;
    va_start(list, spec);
    format(text, spec, list);
    va_end(list);
    send(service, id, type, text);
}

CFE_Status_t CFE_EVS_Register(const void *Filters, uint16 NumEventFilters, uint16 FilterScheme)
{
    CFE_Status_t status = CFE_SUCCESS;
    if (FilterScheme != CFE_EVS_EventFilter_BINARY) {
        return CFE_EVS_UNKNOWN_FILTER;
    }
    if (NumEventFilters > 0u && Filters == NULL) {
        return CFE_EVS_INVALID_PARAMETER;
    }
    pocket_lock();
    App *app = &pocket_core.apps[pocket_self_app_locked()];
    if (NumEventFilters > POCKET_FILTERS) {
        NumEventFilters = POCKET_FILTERS;
        status = CFE_EVS_APP_FILTER_OVERLOAD;
    }
    memset(app->filters, 0, sizeof app->filters);
    memset(app->seen, 0, sizeof app->seen);
    if (NumEventFilters > 0u) {
        memcpy(app->filters, Filters, NumEventFilters * sizeof app->filters[0]);
    }
    app->n_filters = NumEventFilters;
    app->events = true;
    pocket_unlock();
    return status;
}

/* Whether the filter lets an event pass. The filter counts every event. */
static bool passes(App *app, uint16 id)
{
    for (uint32 i = 0; i < app->n_filters; i++) {
        if (app->filters[i].EventID == id) {
            const bool out = (app->seen[i] & app->filters[i].Mask) == 0u;
            if (app->seen[i] < UINT16_MAX) {
                app->seen[i]++;
            }
            return out;
        }
    }
    return true;
}

CFE_Status_t CFE_EVS_SendEvent(uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char *Spec, ...)
{
    char text[CFE_MISSION_EVS_MAX_MESSAGE_LENGTH];
    char name[CFE_MISSION_MAX_API_LEN];
    va_list list;
    if (Spec == NULL || EventType < CFE_EVS_EventType_DEBUG || EventType > CFE_EVS_EventType_CRITICAL) {
        return CFE_EVS_INVALID_PARAMETER;
    }
    pocket_lock();
    App *app = &pocket_core.apps[pocket_self_app_locked()];
    const bool registered = app->events;
    const bool out = registered && passes(app, EventID);
    if (registered && !out) {
        pocket_core.counts.filtered++;
    }
    memcpy(name, app->name, sizeof name);
    pocket_unlock();
    if (!registered) {
        return CFE_EVS_APP_NOT_REGISTERED;
    }
    if (out) {
        va_start(list, Spec);
        format(text, Spec, list);
        va_end(list);
        send(name, EventID, EventType, text);
    }
    return CFE_SUCCESS;
}

static CFE_Status_t reset(bool all, uint16 id)
{
    CFE_Status_t status = all ? CFE_SUCCESS : CFE_EVS_EVT_NOT_REGISTERED;
    pocket_lock();
    App *app = &pocket_core.apps[pocket_self_app_locked()];
    for (uint32 i = 0; i < app->n_filters; i++) {
        if (all || app->filters[i].EventID == id) {
            app->seen[i] = 0;
            status = CFE_SUCCESS;
        }
    }
    if (!app->events) {
        status = CFE_EVS_APP_NOT_REGISTERED;
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_EVS_ResetFilter(uint16 EventID)
{
    return reset(false, EventID);
}

CFE_Status_t CFE_EVS_ResetAllFilters(void)
{
    return reset(true, 0);
}
