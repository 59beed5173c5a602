/* SPDX-License-Identifier: Apache-2.0 */
/* The bases of message ids. */
#ifndef CFE_MSGIDS_H
#define CFE_MSGIDS_H

#define CFE_PLATFORM_CMD_MID_BASE 0x1800
#define CFE_PLATFORM_TLM_MID_BASE 0x0800

#endif
