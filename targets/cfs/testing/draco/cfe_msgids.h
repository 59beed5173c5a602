/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: message ids from topics, as 7.x has it. */
#ifndef CFE_MSGIDS_H
#define CFE_MSGIDS_H

#define CFE_PLATFORM_CMD_TOPICID_TO_MIDV(topic) (0x1800 | (topic))
#define CFE_PLATFORM_TLM_TOPICID_TO_MIDV(topic) (0x0800 | (topic))

#endif
