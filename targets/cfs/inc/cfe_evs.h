/* SPDX-License-Identifier: Apache-2.0 */
/* Events: the pocket prints each one on the console, and sends it as a packet. */
#ifndef CFE_EVS_H
#define CFE_EVS_H

#include "cfe_msg.h"

#define CFE_EVS_LONG_EVENT_MSG_MID 0x0808

#define CFE_EVS_EventFilter_BINARY 0
#define CFE_EVS_NO_FILTER 0x0000
#define CFE_EVS_FIRST_ONE_STOP 0xFFFF
#define CFE_EVS_FIRST_TWO_STOP 0xFFFE
#define CFE_EVS_FIRST_4_STOP 0xFFFC
#define CFE_EVS_FIRST_8_STOP 0xFFF8
#define CFE_EVS_EVERY_OTHER_ONE 0x0001
#define CFE_EVS_EVERY_OTHER_TWO 0x0002
#define CFE_EVS_EVERY_FOURTH_ONE 0x0003

typedef uint16 CFE_EVS_EventType_Enum_t;
enum CFE_EVS_EventType {
    CFE_EVS_EventType_DEBUG = 1,
    CFE_EVS_EventType_INFORMATION = 2,
    CFE_EVS_EventType_ERROR = 3,
    CFE_EVS_EventType_CRITICAL = 4
};

/** The filter lets an event pass if (its count & Mask) is 0. */
typedef struct CFE_EVS_BinFilter {
    uint16 EventID;
    uint16 Mask;
} CFE_EVS_BinFilter_t;

typedef struct CFE_EVS_PacketID {
    char AppName[CFE_MISSION_MAX_API_LEN];
    uint16 EventID;
    uint16 EventType;
    uint32 SpacecraftID;
    uint32 ProcessorID;
} CFE_EVS_PacketID_t;

typedef struct CFE_EVS_LongEventTlm_Payload {
    CFE_EVS_PacketID_t PacketID;
    char Message[CFE_MISSION_EVS_MAX_MESSAGE_LENGTH];
    uint8 Spare1;
    uint8 Spare2;
} CFE_EVS_LongEventTlm_Payload_t;

typedef struct CFE_EVS_LongEventTlm {
    CFE_MSG_TelemetryHeader_t TelemetryHeader;
    CFE_EVS_LongEventTlm_Payload_t Payload;
} CFE_EVS_LongEventTlm_t;

CFE_Status_t CFE_EVS_Register(const void *Filters, uint16 NumEventFilters, uint16 FilterScheme);
CFE_Status_t CFE_EVS_SendEvent(uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char *Spec, ...)
    OS_PRINTF(3, 4);
CFE_Status_t CFE_EVS_ResetFilter(uint16 EventID);
CFE_Status_t CFE_EVS_ResetAllFilters(void);

#endif
