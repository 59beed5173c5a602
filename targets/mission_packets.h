/* SPDX-License-Identifier: Apache-2.0 */
/* Numbers of messages in packets and queued words. Only the table of a mission that has such lanes refers to this part,
 * so that others are linked without it. */
#ifndef TARGETS_MISSION_PACKETS_H
#define TARGETS_MISSION_PACKETS_H

#include "targets/mission_io.h"

#ifdef __cplusplus
extern "C" {
#endif

/** mission_io.c calls these for the kinds of packets in MissionIo. */
extern const MissionPacketFunctions mission_packet_functions;

#ifdef __cplusplus
}
#endif

#endif
