/* SPDX-License-Identifier: Apache-2.0 */
/* Whole messages through lanes: the same bytes as in archive and wire, so that runs on different
 * machines can be compared bit for bit. The writer stores its struct as it lies in memory, behind 4
 * bytes with the byte order; a reader of the other order reverses the bytes of each number. */
#ifndef REGISTERS_MESSAGE_H
#define REGISTERS_MESSAGE_H

#include "flight/exec/order.h"
#include "registers/lane.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef ExecRun RegisterRun;

/** A message type, with the data for reversing its bytes. introspect generates it from the headers. */
typedef struct RegisterMessage {
    const char *name;
    uint32_t size; ///< [bytes] of the struct
    uint32_t n_runs;
    const RegisterRun *runs; ///< in the order of memory; they fill the struct
} RegisterMessage;

/** All message types of a library. */
typedef struct RegisterMessages {
    uint32_t n;
    const RegisterMessage *const *messages;
} RegisterMessages;

/** Reverse the bytes of every number of a message, in place. A second call restores them. */
void register_message_reverse(const RegisterMessage *type, void *bytes);

/** Write a message. REGISTER_SIZE: the lane is not for messages of this size. */
RegisterStatus register_put_message(const RegisterWindow *w, const RegisterLane *lane, const RegisterMessage *type,
                                    const void *message);

/** Read a message, in this machine's byte order. It is touched only with REGISTER_OK and
 *  REGISTER_SAME, and with REGISTER_CORRUPT or REGISTER_BUSY, when it holds no message. */
RegisterStatus register_take_message(const RegisterWindow *w, const RegisterLane *lane, const RegisterMessage *type,
                                     void *message, RegisterInfo *info);

#ifdef __cplusplus
}
#endif

#endif
