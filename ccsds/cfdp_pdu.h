/* SPDX-License-Identifier: Apache-2.0 */
/* The protocol data units of the CCSDS File Delivery Protocol (727.0-B-5), written and read.
 *
 *     byte 0  version (3 bits, 1 or 0), file data, toward sender, unacknowledged, with CRC, large (1 bit each)
 *          1  length of what follows the header (16 bits)
 *          3  1 records, length of entities - 1 (3 bits), 1 with context, length of the sequence number - 1 (3 bits)
 *          4  source entity, sequence number, destination entity, 1 to 8 bytes each
 *             then the code of a directive and its fields, or an offset and data of the file; a CRC at the end
 *
 * Sizes and offsets have 32 bits, or 64 in PDUs with the flag `large`. What has no length of its own follows as TLVs:
 * type, length, value of up to 255 bytes. */
#ifndef CCSDS_CFDP_PDU_H
#define CCSDS_CFDP_PDU_H

#include "ccsds/bytes.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Codes of directives; CFDP_FILE_DATA is none. */
typedef enum CfdpKind {
    CFDP_FILE_DATA = 0,
    CFDP_EOF = 4,
    CFDP_FINISHED = 5,
    CFDP_ACK = 6,
    CFDP_METADATA = 7,
    CFDP_NAK = 8,
    CFDP_PROMPT = 9,
    CFDP_KEEP_ALIVE = 12
} CfdpKind;

typedef enum CfdpCondition {
    CFDP_NO_ERROR = 0,
    CFDP_ACK_LIMIT = 1,
    CFDP_KEEP_ALIVE_LIMIT = 2,
    CFDP_INVALID_MODE = 3,
    CFDP_FILESTORE_REJECTION = 4,
    CFDP_CHECKSUM_FAILURE = 5,
    CFDP_SIZE_ERROR = 6,
    CFDP_NAK_LIMIT = 7,
    CFDP_INACTIVITY = 8,
    CFDP_INVALID_STRUCTURE = 9,
    CFDP_CHECK_LIMIT = 10,
    CFDP_UNSUPPORTED_CHECKSUM = 11,
    CFDP_SUSPEND_REQUEST = 14,
    CFDP_CANCEL_REQUEST = 15
} CfdpCondition;

typedef enum CfdpChecksum {
    CFDP_MODULAR = 0, ///< the sum of words of 4 bytes
    CFDP_CRC32 = 3,   ///< of IEEE 802.3
    CFDP_NULL_CHECKSUM = 15
} CfdpChecksum;

/** What became of a delivered file. */
typedef enum CfdpFileStatus {
    CFDP_DISCARDED = 0,
    CFDP_REJECTED = 1, ///< by the store
    CFDP_RETAINED = 2,
    CFDP_UNREPORTED = 3
} CfdpFileStatus;

typedef enum CfdpStatus { CFDP_UNDEFINED = 0, CFDP_ACTIVE = 1, CFDP_TERMINATED = 2, CFDP_UNRECOGNIZED = 3 } CfdpStatus;

/** Bytes of a PDU, not terminated. A file's name, mostly. */
typedef struct CfdpText {
    const uint8_t *bytes;
    uint8_t n;
} CfdpText;

/** A PDU. Fields without a kind in their comment are those of the header. */
typedef struct CfdpPdu {
    uint64_t source;
    uint64_t sequence;
    uint64_t destination;
    uint64_t
        offset;   ///< [bytes] FILE_DATA; METADATA, EOF: the file's size; NAK: its scope's begin; KEEP_ALIVE: progress
    uint64_t end; ///< [bytes] NAK: end of its scope
    const uint8_t *data; ///< FILE_DATA; NAK: segments, a begin and an end each; METADATA, EOF, FINISHED: TLVs
    size_t n;            ///< [bytes] of data
    CfdpText from;       ///< METADATA: the source file's name; FILE_DATA: the context of the segment
    CfdpText to;         ///< METADATA: the destination file's name
    uint32_t checksum;   ///< EOF
    uint8_t kind;        ///< CfdpKind
    uint8_t to_sender;
    uint8_t unacknowledged; ///< 1: class 1
    uint8_t crc;
    uint8_t large;
    uint8_t entity_bytes;   ///< 1 to 8
    uint8_t sequence_bytes; ///< 1 to 8
    uint8_t records;        ///< segmentation control: 1: segments keep the boundaries of records
    uint8_t has_context;    ///< of FILE_DATA
    uint8_t continuation;   ///< FILE_DATA with context: 1: a record begins, 2: one ends
    uint8_t condition;      ///< EOF, FINISHED, ACK: CfdpCondition
    uint8_t incomplete;     ///< FINISHED: 1: the file is not whole
    uint8_t file_status;    ///< FINISHED: CfdpFileStatus
    uint8_t acknowledged;   ///< ACK: CFDP_EOF or CFDP_FINISHED
    uint8_t status;         ///< ACK: CfdpStatus
    uint8_t closure;        ///< METADATA: 1: class 1 with a FINISHED at the end
    uint8_t checksum_type;  ///< METADATA: CfdpChecksum
    uint8_t keep_alive;     ///< PROMPT: 1: for KEEP_ALIVE, 0: for NAK
} CfdpPdu;

enum {
    CFDP_PDU_MAX = 65535 + 28, ///< [bytes]
    CFDP_CONTEXT_MAX = 63      ///< [bytes] of a segment's context
};

/** Read a PDU of n bytes; its texts and data stay there. CCSDS_SHORT, CCSDS_VERSION, CCSDS_LENGTH: a length does not
 * hold, that of a TLV or a segment too; CCSDS_CRC; CCSDS_TYPE: no such directive, or one in the wrong direction. */
CcsdsFault cfdp_pdu_read(CfdpPdu *pdu, const uint8_t *bytes, size_t n);

/** [bytes] in front of `data`. Data that stands there already is not copied. */
size_t cfdp_pdu_head(const CfdpPdu *pdu);

/** Write a PDU. Returns its size, 0 if there is no room. */
size_t cfdp_pdu_write(const CfdpPdu *pdu, uint8_t *bytes, size_t room);

/** [bytes] of an offset. */
static inline size_t cfdp_wide(int large)
{
    return large ? 8 : 4;
}

/** A number of 1 to 8 bytes. */
static inline uint64_t cfdp_get(const uint8_t *p, size_t n)
{
    uint64_t value = 0;
    for (size_t i = 0; i < n; i++) {
        value = value << 8 | p[i];
    }
    return value;
}

/** [bytes] for a number: `least`, from 1 to 8, or as many more as it needs. */
static inline uint8_t cfdp_bytes(uint64_t value, uint8_t least)
{
    while (least < 8u && value >> (8u * least) != 0u) {
        least++;
    }
    return least;
}

static inline void cfdp_put_number(uint8_t *p, size_t n, uint64_t value)
{
    for (size_t i = n; i-- > 0; value >>= 8) {
        p[i] = (uint8_t)value;
    }
}

/* ---- TLVs */

typedef enum CfdpTlvType {
    CFDP_TLV_REQUEST = 0,  ///< to the store
    CFDP_TLV_RESPONSE = 1, ///< of the store
    CFDP_TLV_MESSAGE = 2,  ///< to the user
    CFDP_TLV_HANDLER = 4,  ///< a fault handler: condition (4 bits), CfdpHandler (4 bits)
    CFDP_TLV_FLOW = 5,     ///< flow label
    CFDP_TLV_ENTITY = 6    ///< where a fault occurred
} CfdpTlvType;

typedef struct CfdpTlv {
    CfdpText value;
    uint8_t type; ///< CfdpTlvType, or another
} CfdpTlv;

/** Take the next TLV off n bytes. Returns 0 after the last. A length beyond the end gives 0, and n stays. */
int cfdp_tlv_next(CfdpTlv *tlv, const uint8_t **bytes, size_t *n);

/** Write a TLV. Returns its size, 0 if there is no room. */
size_t cfdp_tlv_write(uint8_t type, const uint8_t *value, size_t n, uint8_t *bytes, size_t room);

typedef enum CfdpAction {
    CFDP_CREATE_FILE = 0,
    CFDP_DELETE_FILE = 1,
    CFDP_RENAME_FILE = 2,
    CFDP_APPEND_FILE = 3,  ///< the second to the first
    CFDP_REPLACE_FILE = 4, ///< the first's contents by the second's
    CFDP_CREATE_DIRECTORY = 5,
    CFDP_REMOVE_DIRECTORY = 6,
    CFDP_DENY_FILE = 7, ///< delete it, if it is there
    CFDP_DENY_DIRECTORY = 8
} CfdpAction;

enum { CFDP_DONE = 0, CFDP_NOT_PERFORMED = 15 }; ///< status of an action; 1 to 3 by the action (727.0-B-5, table 5-18)

/** A request to the store, or its response. */
typedef struct CfdpFilestore {
    CfdpText first;
    CfdpText second;  ///< of CFDP_RENAME_FILE, CFDP_APPEND_FILE, CFDP_REPLACE_FILE
    CfdpText message; ///< of a response
    uint8_t response; ///< 1: it is one
    uint8_t action;   ///< CfdpAction
    uint8_t status;   ///< of a response
} CfdpFilestore;

/** Read one. CCSDS_TYPE: another TLV, or no such action; CCSDS_LENGTH. */
CcsdsFault cfdp_filestore_read(CfdpFilestore *operation, const CfdpTlv *tlv);

/** Write one as a TLV. Returns its size, 0 if there is no room. */
size_t cfdp_filestore_write(const CfdpFilestore *operation, uint8_t *bytes, size_t room);

/** Messages to the user that the standard reserves (727.0-B-5, 6). */
typedef enum CfdpMessageType {
    CFDP_PROXY_PUT = 0x00,
    CFDP_PROXY_MESSAGE = 0x01,
    CFDP_PROXY_REQUEST = 0x02,
    CFDP_PROXY_HANDLER = 0x03,
    CFDP_PROXY_MODE = 0x04,
    CFDP_PROXY_FLOW = 0x05,
    CFDP_PROXY_RECORDS = 0x06,
    CFDP_PROXY_PUT_RESPONSE = 0x07,
    CFDP_PROXY_RESPONSE = 0x08,
    CFDP_PROXY_CANCEL = 0x09,
    CFDP_ORIGIN = 0x0A, ///< the transaction that requests
    CFDP_PROXY_CLOSURE = 0x0B,
    CFDP_LIST = 0x10, ///< a directory, into a file
    CFDP_LISTED = 0x11,
    CFDP_REMOTE_REPORT = 0x20, ///< of a transaction, into a file
    CFDP_REMOTE_REPORTED = 0x21,
    CFDP_REMOTE_SUSPEND = 0x30,
    CFDP_REMOTE_SUSPENDED = 0x31,
    CFDP_REMOTE_RESUME = 0x38,
    CFDP_REMOTE_RESUMED = 0x39
} CfdpMessageType;

typedef struct CfdpMessage {
    uint64_t entity;        ///< PROXY_PUT: destination; ORIGIN, REMOTE_...: source
    uint64_t sequence;      ///< ORIGIN, REMOTE_...
    CfdpText first;         ///< PROXY_PUT: source file; LIST, LISTED: directory; REMOTE_REPORT: file for the report;
                            ///< MESSAGE, REQUEST, FLOW, RESPONSE: value
    CfdpText second;        ///< PROXY_PUT: destination file; LIST, LISTED: file for the list
    uint8_t type;           ///< CfdpMessageType
    uint8_t entity_bytes;   ///< 1 to 8
    uint8_t sequence_bytes; ///< 1 to 8
    uint8_t value; ///< HANDLER; MODE, RECORDS, CLOSURE: 0, 1; PUT_RESPONSE: as in FINISHED; LISTED: 0x80 if it failed;
                   ///< REPORTED: CfdpStatus * 64, + 1 if it failed; SUSPENDED, RESUMED: CfdpStatus * 32, + 0x80 if it
                   ///< is suspended
} CfdpMessage;

/** Read one. CCSDS_TYPE: not one of these; CCSDS_LENGTH. */
CcsdsFault cfdp_message_read(CfdpMessage *message, const CfdpTlv *tlv);

/** Write one as a TLV. Returns its size, 0 if there is no room. */
size_t cfdp_message_write(const CfdpMessage *message, uint8_t *bytes, size_t room);

/** Add n bytes of a file at an offset to its checksum, which begins with 0. CRC-32 takes them in order. */
uint32_t cfdp_checksum(uint8_t type, uint32_t sum, uint64_t offset, const uint8_t *bytes, size_t n);

#ifdef __cplusplus
}
#endif

#endif
