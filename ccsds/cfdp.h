/* SPDX-License-Identifier: Apache-2.0 */
/* The CCSDS File Delivery Protocol (727.0-B-5): an entity that sends and receives files, in classes 1 and 2, many at
 * once.
 *
 *     cfdp_time(&cfdp, now);                           // at each tick
 *     n = cfdp_next(&cfdp, NULL, pdu, sizeof pdu);     // whenever the link has room
 *     cfdp_take(&cfdp, pdu, n);                        // for each PDU that arrives
 *
 * Files are in a store, behind functions of the caller's. A file is received under a name of its own, `.cfdpN` with
 * the number of the transaction's place in memory; it has its destination's name only when it is whole.
 *
 * All memory is the caller's, and plain: a program that keeps `live`, `transactions`, `ranges` and `past` over a reset,
 * and puts them back between cfdp_begin() and cfdp_restart(), goes on with its transactions. Keep it after each
 * cfdp_put(), for the sequence number; a program that keeps nothing begins with one that it has not used. */
#ifndef CCSDS_CFDP_H
#define CCSDS_CFDP_H

#include "ccsds/cfdp_pdu.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    CFDP_NAME = 128,    ///< [bytes] of a file's name with its end
    CFDP_OPTIONS = 512, ///< [bytes] of the TLVs of Metadata
    CFDP_REQUESTS = 16, ///< to the store, in one transaction
    CFDP_ANSWERS = 16,  ///< acknowledgements that wait for the link
    CFDP_ROOM = 512     ///< [bytes] that cfdp_next() needs at least
};

/* ---- the store */

/** What the functions of a store return instead of a result. */
typedef enum CfdpRefusal {
    CFDP_ABSENT = -1,
    CFDP_REFUSED = -2, ///< the name, or the access
    CFDP_FULL = -3,
    CFDP_BROKEN = -4 ///< the device
} CfdpRefusal;

typedef enum CfdpOpen {
    CFDP_OPEN_READ = 0,
    CFDP_OPEN_WRITE = 1, ///< a file that is there
    CFDP_OPEN_NEW = 2    ///< empty, for writing and reading
} CfdpOpen;

/** Takes a name in a directory, with `/` behind that of a directory. Less than 0: no more of them. */
typedef int (*CfdpEach)(void *to, const char *name);

/** Names are relative to the store's root, with `/` between directories. Each returns a CfdpRefusal below 0. */
typedef struct CfdpStore {
    int (*open)(void *user, const char *name, CfdpOpen how); ///< a handle, at least 0
    void (*close)(void *user, int file);
    int64_t (*size)(void *user, int file);                                               ///< [bytes]
    int (*read)(void *user, int file, uint64_t offset, uint8_t *bytes, size_t n);        ///< all n bytes
    int (*write)(void *user, int file, uint64_t offset, const uint8_t *bytes, size_t n); ///< all n bytes
    int (*rename)(void *user, const char *from, const char *to); ///< a file that is there is replaced
    int (*remove)(void *user, const char *name);                 ///< a file
    int (*make_directory)(void *user, const char *name);
    int (*remove_directory)(void *user, const char *name);
    int (*list)(void *user, const char *directory, CfdpEach each, void *to); ///< the names in it, in any order
    void *user;
} CfdpStore;

/* ---- the entity */

typedef enum CfdpHandler { CFDP_CANCEL = 1, CFDP_SUSPEND = 2, CFDP_IGNORE = 3, CFDP_ABANDON = 4 } CfdpHandler;

/** What a remote entity may ask for. */
enum {
    CFDP_ALLOW_FILESTORE = 1,
    CFDP_ALLOW_PROXY = 2,
    CFDP_ALLOW_LIST = 4,
    CFDP_ALLOW_REMOTE = 8 ///< to suspend, resume and report its transactions
};

/** Another entity, and how files go to it and come from it. */
typedef struct CfdpRemote {
    uint64_t entity;
    int64_t ack_timer;         ///< [ns] until an EOF or FINISHED is sent again
    int64_t nak_timer;         ///< [ns] until what is missing is requested again
    int64_t inactivity;        ///< [ns] without a PDU of the transaction
    int64_t check_timer;       ///< [ns] class 1: after EOF, for data that is late
    int64_t keep_alive;        ///< [ns] between KEEP_ALIVEs; 0: none
    uint64_t keep_alive_limit; ///< [bytes] that the receiver may be behind; 0: any
    uint16_t segment;          ///< [bytes] of file data, or of segment requests, in a PDU
    uint8_t ack_limit;         ///< how often an EOF or FINISHED is sent
    uint8_t nak_limit;         ///< how often in a row the timer expires without new data
    uint8_t check_limit;
    uint8_t immediate;    ///< 1: ask at once for what is missing; 0: after EOF
    uint8_t checksum;     ///< CfdpChecksum of files sent
    uint8_t crc;          ///< 1: PDUs have one
    uint8_t allowed;      ///< CFDP_ALLOW_...
    uint8_t frozen;       ///< 1: the link is out: nothing is sent, and its timers rest
    uint8_t handlers[16]; ///< CfdpHandler by CfdpCondition; 0: CFDP_CANCEL. A wrong checksum, size, or file that the
                          ///< store refuses cannot be ignored: that cancels
} CfdpRemote;

typedef struct CfdpId {
    uint64_t source;
    uint64_t sequence;
} CfdpId;

typedef enum CfdpEventKind {
    CFDP_EVENT_STARTED, ///< Metadata came
    CFDP_EVENT_ENDED,   ///< the transaction ended, by `condition`
    CFDP_EVENT_SUSPENDED,
    CFDP_EVENT_RESUMED,
    CFDP_EVENT_FAULT,     ///< `condition`
    CFDP_EVENT_ABANDONED, ///< the transaction ended without a word to the other end
    CFDP_EVENT_MESSAGE,   ///< a file is delivered, with this message to the user in `text`
    CFDP_EVENT_RESPONSE,  ///< of the receiver's store: `text` is the value of a CFDP_TLV_RESPONSE
    CFDP_EVENT_REPORT     ///< cfdp_report()
} CfdpEventKind;

/** What an entity notifies its user of. Texts last until the function returns. */
typedef struct CfdpEvent {
    CfdpEventKind what;
    CfdpId id;
    uint64_t peer;
    uint64_t progress; ///< [bytes] sent, or received in a row
    uint64_t size;     ///< [bytes]
    const char *from;
    const char *to;
    CfdpText text;
    uint8_t receiver;    ///< 1: here is the receiver
    uint8_t condition;   ///< CfdpCondition
    uint8_t incomplete;  ///< CFDP_EVENT_ENDED
    uint8_t file_status; ///< CFDP_EVENT_ENDED: CfdpFileStatus
} CfdpEvent;

/** It may call cfdp_put(), and nothing else of the entity. */
typedef void (*CfdpNotify)(void *user, const CfdpEvent *event);

/** From `begin` to below `end` [bytes]. */
typedef struct CfdpRange {
    uint64_t begin;
    uint64_t end;
} CfdpRange;

typedef enum CfdpState {
    CFDP_FREE = 0,
    CFDP_SENDING,   ///< Metadata and data
    CFDP_SENT,      ///< EOF too; until it is acknowledged
    CFDP_WAITING,   ///< for FINISHED
    CFDP_RECEIVING, ///< Metadata, data or EOF
    CFDP_CHECKING,  ///< all is there; the checksum is computed
    CFDP_FINISHING  ///< FINISHED is to be acknowledged
} CfdpState;

/** A transaction. */
typedef struct CfdpTransaction {
    CfdpId id;
    CfdpId origin;      ///< that requested this transaction by proxy
    uint64_t peer;      ///< the other entity
    uint64_t size;      ///< [bytes] of the file
    uint64_t progress;  ///< [bytes] sent once; received: the end of the last that came
    uint64_t checked;   ///< [bytes] that `sum` has
    uint64_t requested; ///< [bytes] up to which the receiver has requested what is missing
    int64_t expires;    ///< [ns] of the ACK, NAK or check timer; INT64_MAX: it does not run
    int64_t inactive;   ///< [ns]
    int64_t keep_alive; ///< [ns]
    uint32_t sum;
    uint32_t checksum; ///< of EOF
    uint32_t ranges;   ///< how many: what is to be sent again, or what is missing below `progress`
    uint32_t first;    ///< the first of them, in the transaction's part of the memory
    int32_t file;      ///< handle in the store; -1: not open
    uint16_t options_n;
    uint8_t state; ///< CfdpState
    uint8_t due;   ///< PDUs that are to be sent
    uint8_t class1;
    uint8_t closure;
    uint8_t priority;
    uint8_t tries;
    uint8_t suspended;
    uint8_t metadata; ///< 1: it is known
    uint8_t eof;      ///< 1: it came
    uint8_t condition;
    uint8_t ordered; ///< 1: `sum` takes bytes in order, and reads them again if they did not come so
    uint8_t created; ///< 1: the store has a file of this place, of what is received, or a list to be sent
    uint8_t checksum_type;
    uint8_t file_status;
    uint8_t incomplete;
    uint8_t proxy; ///< 1: `origin` is answered at the end
    uint8_t large;
    uint8_t crc;
    uint8_t entity_bytes;
    uint8_t sequence_bytes;
    uint8_t results_n;
    uint8_t results[CFDP_REQUESTS]; ///< of the store
    uint8_t handlers[16];           ///< CfdpHandler of this transaction; 0: that of the remote entity
    char from[CFDP_NAME];
    char to[CFDP_NAME];
    uint8_t options[CFDP_OPTIONS];
} CfdpTransaction;

/** A transaction that ended: its late PDUs begin none, and are acknowledged. */
typedef struct CfdpPast {
    CfdpId id;
    uint8_t used;
} CfdpPast;

/** An acknowledgement that waits for the link. */
typedef struct CfdpAnswer {
    CfdpId id;
    uint64_t peer;
    uint8_t acknowledged, condition, status, crc, large, entity_bytes, sequence_bytes, spare;
} CfdpAnswer;

/** What the caller gives. */
typedef struct CfdpSetup {
    uint64_t entity; ///< the own id
    CfdpStore store;
    CfdpNotify notify;
    void *user;          ///< of notify
    CfdpRemote *remotes; ///< transactions with one that is taken away rest until it is there again
    uint32_t remotes_n;
    CfdpTransaction *transactions;
    uint32_t transactions_n;
    uint32_t kept;     ///< of them, for what is put here: files that come take none of the last
    CfdpRange *ranges; ///< ranges_n for each transaction. A receiver whose ranges are full asks for what they name, and
                       ///< drops what it cannot note
    uint32_t ranges_n;
    CfdpPast *past;
    uint32_t past_n;
    uint8_t *work;          ///< for a part of a file
    uint32_t work_n;        ///< [bytes] of it, at least 1
    uint8_t entity_bytes;   ///< 1 to 8, of ids in what is put here; a larger id has as many as it needs
    uint8_t sequence_bytes; ///< the same of sequence numbers
} CfdpSetup;

/** What changes, beside the transactions. */
typedef struct CfdpLive {
    int64_t now;       ///< [ns]
    uint64_t sequence; ///< of the next transaction
    uint32_t turn;     ///< which transaction may send first
    uint32_t past;     ///< where the next that ends is recorded
    uint32_t answers_n;
    uint32_t sent;  ///< PDUs
    uint32_t taken; ///< PDUs without a fault
    uint32_t
        faults[CCSDS_FAULTS]; ///< PDUs that were dropped. SPACECRAFT: for another entity; CHANNEL: of one that is not
                              ///< known; STRAY: of no transaction; ROOM: no place for it
    uint32_t conditions[16];  ///< by CfdpCondition
    CfdpAnswer answers[CFDP_ANSWERS];
} CfdpLive;

typedef struct Cfdp {
    CfdpSetup set;
    CfdpLive live;
} Cfdp;

/** sequence: of the first transaction, larger than all before, also those before a reset. */
void cfdp_begin(Cfdp *cfdp, const CfdpSetup *setup, uint64_t sequence);

/** The memory is that of before a reset: go on. Files are opened again, and what came is read again for the checksum,
 * so that a file that lost bytes is noticed. A receiver whose file is gone cancels. now: [ns], may have begun anew. */
void cfdp_restart(Cfdp *cfdp, int64_t now);

/** It is now [ns]. Times do not go back. A receiver whose CRC-32 is behind, as data came out of order,
 * reads work_n bytes of the file at each call. */
void cfdp_time(Cfdp *cfdp, int64_t now);

/** Take a PDU from the link. Wrong ones are counted. */
void cfdp_take(Cfdp *cfdp, const uint8_t *bytes, size_t n);

/** Write the next PDU to a remote entity, or to any (NULL), by the transactions' priorities. room: at least CFDP_ROOM.
 * A transaction whose Metadata is longer is cancelled: names alone always fit. Returns its size, 0 if there is none. */
size_t cfdp_next(Cfdp *cfdp, const CfdpRemote *remote, uint8_t *bytes, size_t room);

/** A file to be sent. */
typedef struct CfdpPut {
    uint64_t destination;
    const char *from; ///< "" with `to`: only the options are sent
    const char *to;
    const uint8_t *options; ///< TLVs: requests, messages, handlers, a flow label
    size_t options_n;       ///< [bytes]
    uint8_t class1;
    uint8_t closure;  ///< class 1: FINISHED is awaited
    uint8_t priority; ///< larger is sent first
} CfdpPut;

/** Send a file. Returns 0 with *id, or a CfdpRefusal: of the store; CFDP_FULL: no transaction is free; CFDP_REFUSED:
 * the destination is not known, or a name or the options are too long. */
int cfdp_put(Cfdp *cfdp, const CfdpPut *put, CfdpId *id);

/** Each returns 0 if there is no such transaction, or it is at the wrong end. */
int cfdp_suspend(Cfdp *cfdp, CfdpId id);
int cfdp_resume(Cfdp *cfdp, CfdpId id);
int cfdp_cancel(Cfdp *cfdp, CfdpId id);
int cfdp_report(Cfdp *cfdp, CfdpId id);
int cfdp_prompt(Cfdp *cfdp, CfdpId id, int keep_alive); ///< a sender asks for a KEEP_ALIVE, or for a NAK

#ifdef __cplusplus
}
#endif

#endif
