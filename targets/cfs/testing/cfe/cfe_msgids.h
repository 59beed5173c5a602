/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: message ids from topics, as 7.x has it; of Caelum their bases. */
#ifndef CFE_MSGIDS_H
#define CFE_MSGIDS_H

#ifdef CAELUM
#define CFE_PLATFORM_CMD_MID_BASE 0x1800
#define CFE_PLATFORM_TLM_MID_BASE 0x0800
#else
#define CFE_PLATFORM_CMD_TOPICID_TO_MIDV(topic) (0x1800 | (topic))
#define CFE_PLATFORM_TLM_TOPICID_TO_MIDV(topic) (0x0800 | (topic))
#endif

#endif
