/* SPDX-License-Identifier: Apache-2.0 */
/* What the files of an entity of CFDP share; callers include cfdp.h.
 *
 *     cfdp.c               requests of the user, PDUs from the link and for it, time
 *     cfdp_sender.c        a transaction that sends a file
 *     cfdp_receiver.c      a transaction that receives a file
 *     cfdp_transaction.c   what both have: begin, names, files, faults, suspension, end
 *     cfdp_ranges.c        the parts of a file that are missing, or are to be sent again
 *     cfdp_filestore.c     requests to the store
 *     cfdp_messages.c      messages to the user: proxies, lists of directories, remote control
 *
 * The states of a transaction (CfdpState):
 *
 *     sender                                          receiver
 *
 *     FREE                                            FREE
 *      |  cfdp_put()                                   |  Metadata, data or EOF of a transaction that is not known
 *     SENDING    Metadata, data                       RECEIVING   asks for what is missing (NAK)
 *      |  EOF is sent, or cancelled                    |  all is there
 *     SENT       EOF again, until it is acknowledged  CHECKING    reads what came out of order, for the checksum
 *      |  ACK of EOF                                   |  the checksum holds: the file gets its name, requests run
 *     WAITING    sends again what NAKs name           FINISHING   FINISHED again, until it is acknowledged
 *      |  FINISHED comes, and is acknowledged          |  ACK of FINISHED
 *     FREE                                            FREE
 *
 * In class 1, a sender is FREE after EOF, or with closure WAITING at once; a receiver without closure skips FINISHING.
 * A sender that is cancelled is SENT with a condition, and FREE at the acknowledgement; a receiver that is cancelled
 * is FINISHING, and one that the sender cancels is FREE. Each state but FREE may be suspended: its timers rest, and it
 * sends nothing. */
#ifndef CCSDS_CFDP_TRANSACTION_H
#define CCSDS_CFDP_TRANSACTION_H

#include "ccsds/cfdp.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { /* bits of `due`, in the order in which they are sent */
       DUE_METADATA = 1,
       DUE_EOF = 2,
       DUE_FINISHED = 4,
       DUE_NAK = 8,
       DUE_KEEP_ALIVE = 16,
       DUE_PROMPT_NAK = 32,
       DUE_PROMPT_KEEP_ALIVE = 64
};

enum { FAULT_LOCATION = 12 }; /* [bytes] at most, with a CRC behind it */

/* ---- transactions */

static inline int cfdp_receives(const CfdpTransaction *t)
{
    return t->state >= (uint8_t)CFDP_RECEIVING;
}

CfdpRemote *cfdp_remote(const Cfdp *cfdp, uint64_t entity);

/** That of a transaction or an acknowledgement. One that is not known any more is as one whose link is out. */
const CfdpRemote *cfdp_peer(const Cfdp *cfdp, uint64_t peer);
CfdpTransaction *cfdp_find(const Cfdp *cfdp, CfdpId id, int receiver);

/** A free place, if there are more than those that are kept. */
CfdpTransaction *cfdp_vacant(const Cfdp *cfdp, uint32_t kept);
int cfdp_is_past(const Cfdp *cfdp, CfdpId id);

/** When a timer that starts now expires. */
int64_t cfdp_deadline(const Cfdp *cfdp, int64_t timer);
void cfdp_notify(Cfdp *cfdp, const CfdpTransaction *t, CfdpEventKind what);
void cfdp_notify_text(Cfdp *cfdp, const CfdpTransaction *t, CfdpEventKind what, CfdpText text);

/** Answer a transaction that came by proxy, with messages alone. */
void cfdp_answer_proxy(Cfdp *cfdp, CfdpId origin, uint8_t value);
void cfdp_end_transaction(Cfdp *cfdp, CfdpTransaction *t, CfdpEventKind what);

/** End a transaction for a reason that is known here, and inform the other end. */
void cfdp_cancel_transaction(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition);
void cfdp_suspend_transaction(Cfdp *cfdp, CfdpTransaction *t);
void cfdp_resume_transaction(Cfdp *cfdp, CfdpTransaction *t);

/** Act as the transaction's fault handler requires, or the remote entity's. */
void cfdp_declare_fault(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition);

/** Take the handler of a fault, if the TLV is one. */
void cfdp_set_handler(CfdpTransaction *t, const CfdpTlv *tlv);

/** Whether the receiver lacks Metadata or data. */
int cfdp_misses_parts(const CfdpTransaction *t);

/* ---- names and files */

CfdpText cfdp_text(const char *name);

/** A name from outside. Returns 0 if it is too long, has a NUL, or is that of an unfinished file. */
int cfdp_copy_name(char *to, CfdpText name);

/** A word, a number and an end, behind a text. Returns where they end. */
char *cfdp_write_number(char *to, const char *word, uint64_t number, char end);

/** The name of a transaction's unfinished file: that of its place, so a reset leaves no more files than places. */
void cfdp_unfinished_name(const Cfdp *cfdp, const CfdpTransaction *t, char name[CFDP_NAME]);

/** The file that is read, or received. Returns below 0 if the store refuses. */
int cfdp_open_file(Cfdp *cfdp, CfdpTransaction *t);
void cfdp_close_file(Cfdp *cfdp, CfdpTransaction *t);
void cfdp_discard_file(Cfdp *cfdp, CfdpTransaction *t);

/* ---- PDUs */

CfdpPdu cfdp_pdu(const Cfdp *cfdp, const CfdpTransaction *t, CfdpKind kind);
void cfdp_add_fault_location(const Cfdp *cfdp, const CfdpTransaction *t, CfdpPdu *pdu, uint8_t *bytes);

/** Keep an acknowledgement for the link. Returns 0 if there is no room: the PDU counts as not received. */
int cfdp_acknowledge(Cfdp *cfdp, const CfdpPdu *pdu, uint64_t peer, CfdpStatus status);

/* ---- ranges: sorted, apart from one another */

CfdpRange *cfdp_ranges(const Cfdp *cfdp, const CfdpTransaction *t);

/** The first range that ends behind an offset. */
uint32_t cfdp_range_at(const CfdpRange *ranges, uint32_t n, uint64_t offset);
int cfdp_ranges_full(const Cfdp *cfdp, const CfdpTransaction *t);

/** There is room for it. */
void cfdp_range_insert(const Cfdp *cfdp, CfdpTransaction *t, uint32_t i, CfdpRange range);
void cfdp_range_remove(CfdpTransaction *t, CfdpRange *ranges, uint32_t i);

/** Add what is to be sent again. What there is no room for is left out: the receiver asks again. */
void cfdp_range_add(const Cfdp *cfdp, CfdpTransaction *t, CfdpRange range);

/* ---- the sender's end */

void cfdp_sender_take(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu);
void cfdp_sender_expire(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote);

/** Write what is due, else data; 0 if the transaction ends instead. */
size_t cfdp_sender_next(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room);

/* ---- the receiver's end */

/** A place for the transaction of a PDU, or NULL. */
CfdpTransaction *cfdp_receiver_begin(Cfdp *cfdp, const CfdpPdu *pdu, const CfdpRemote *remote);
void cfdp_receiver_take(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu);
void cfdp_receiver_expire(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote);
size_t cfdp_receiver_next(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room);

/** Something came, or the transaction goes on: is all there? */
void cfdp_receiver_step(Cfdp *cfdp, CfdpTransaction *t);

/** The same at a tick, with a part of the file for the checksum. */
void cfdp_receiver_tick(Cfdp *cfdp, CfdpTransaction *t);

/** After a reset: open the file again, and read it again for the checksum. */
void cfdp_receiver_restart(Cfdp *cfdp, CfdpTransaction *t);

/* ---- what a delivered file asks for */

/** Do what a remote entity requests of the store. Returns the status of the response (727.0-B-5, table 5-18). */
uint8_t cfdp_perform(Cfdp *cfdp, const CfdpTransaction *t, const CfdpFilestore *request);

/** The messages of a delivered transaction: the user gets all; those of proxies and directories are done here. */
void cfdp_serve_messages(Cfdp *cfdp, const CfdpTransaction *t);

#ifdef __cplusplus
}
#endif

#endif
