/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_pdu.h"

#include <string.h>

/* ---- PDUs */

static int fits_tlvs(const uint8_t *bytes, size_t n)
{
    CfdpTlv tlv;
    while (cfdp_tlv_next(&tlv, &bytes, &n)) {
    }
    return n == 0;
}

/* Take a text with its length off the n bytes at p. */
static int take_text(CfdpText *text, const uint8_t **p, size_t *n)
{
    if (*n == 0 || (size_t) * *p + 1 > *n) {
        return 0;
    }
    text->n = **p;
    text->bytes = *p + 1;
    *p += text->n + 1;
    *n -= (size_t)text->n + 1;
    return 1;
}

/* What follows the code of a directive: the fields that its kind has, in the order of the standard. */
static CcsdsFault read_directive(CfdpPdu *pdu, const uint8_t *p, size_t n)
{
    const size_t wide = cfdp_wide(pdu->large);
    const CfdpPdu fixed = {.kind = pdu->kind, .large = pdu->large};
    const size_t least = cfdp_pdu_head(&fixed) - 5; /* without a header of 4 bytes and the code */
    if (n < least) {
        return CCSDS_LENGTH;
    }
    const uint8_t *data = p + least; /* without the texts of Metadata, two lengths */
    pdu->n = n - least;
    int to_sender = 0, tlvs = 0;
    switch (pdu->kind) {
    case CFDP_EOF:
        pdu->condition = p[0] >> 4;
        pdu->checksum = ccsds_get32(p + 1);
        pdu->offset = cfdp_get(p + 5, wide);
        tlvs = 1;
        break;
    case CFDP_FINISHED:
        pdu->condition = p[0] >> 4;
        pdu->incomplete = p[0] >> 2 & 1u;
        pdu->file_status = p[0] & 3u;
        to_sender = tlvs = 1;
        break;
    case CFDP_ACK:
        pdu->acknowledged = p[0] >> 4;
        pdu->condition = p[1] >> 4;
        pdu->status = p[1] & 3u;
        to_sender = pdu->acknowledged == (uint8_t)CFDP_EOF;
        if (!to_sender && pdu->acknowledged != (uint8_t)CFDP_FINISHED) {
            return CCSDS_TYPE;
        }
        break;
    case CFDP_METADATA:
        pdu->closure = p[0] >> 6 & 1u;
        pdu->checksum_type = p[0] & 15u;
        pdu->offset = cfdp_get(p + 1, wide);
        data = p + 1 + wide;
        pdu->n = n - 1 - wide;
        if (!take_text(&pdu->from, &data, &pdu->n) || !take_text(&pdu->to, &data, &pdu->n)) {
            return CCSDS_LENGTH;
        }
        tlvs = 1;
        break;
    case CFDP_NAK:
        pdu->offset = cfdp_get(p, wide);
        pdu->end = cfdp_get(p + wide, wide);
        to_sender = 1;
        if (pdu->n % (2 * wide) != 0) {
            return CCSDS_LENGTH;
        }
        break;
    case CFDP_PROMPT: pdu->keep_alive = p[0] >> 7; break;
    default: /* CFDP_KEEP_ALIVE */
        pdu->offset = cfdp_get(p, wide);
        to_sender = 1;
        break;
    }
    pdu->data = data;
    if ((int)pdu->to_sender != to_sender) {
        return CCSDS_TYPE;
    }
    if (tlvs ? !fits_tlvs(data, pdu->n) : pdu->n != 0 && pdu->kind != (uint8_t)CFDP_NAK) {
        return CCSDS_LENGTH;
    }
    return CCSDS_OK;
}

CcsdsFault cfdp_pdu_read(CfdpPdu *pdu, const uint8_t *bytes, size_t n)
{
    memset(pdu, 0, sizeof *pdu);
    if (n < 4) {
        return CCSDS_SHORT;
    }
    if (bytes[0] >> 5 > 1u) {
        return CCSDS_VERSION;
    }
    pdu->to_sender = bytes[0] >> 3 & 1u;
    pdu->unacknowledged = bytes[0] >> 2 & 1u;
    pdu->crc = bytes[0] >> 1 & 1u;
    pdu->large = bytes[0] & 1u;
    pdu->records = bytes[3] >> 7;
    pdu->entity_bytes = (uint8_t)((bytes[3] >> 4 & 7u) + 1u);
    pdu->has_context = bytes[3] >> 3 & 1u;
    pdu->sequence_bytes = (uint8_t)((bytes[3] & 7u) + 1u);
    const size_t head = 4 + 2 * (size_t)pdu->entity_bytes + pdu->sequence_bytes;
    if (n < head) {
        return CCSDS_SHORT;
    }
    if (n != head + ccsds_get16(bytes + 1)) {
        return CCSDS_LENGTH;
    }
    if (pdu->crc != 0u) {
        if (n < head + 2) {
            return CCSDS_LENGTH;
        }
        if (ccsds_crc16(bytes, n) != 0u) {
            return CCSDS_CRC;
        }
        n -= 2;
    }
    const uint8_t *p = bytes + 4;
    pdu->source = cfdp_get(p, pdu->entity_bytes);
    pdu->sequence = cfdp_get(p + pdu->entity_bytes, pdu->sequence_bytes);
    pdu->destination = cfdp_get(p + pdu->entity_bytes + pdu->sequence_bytes, pdu->entity_bytes);
    p = bytes + head;
    n -= head;
    if ((bytes[0] >> 4 & 1u) == 0u) {
        if (n == 0) {
            return CCSDS_LENGTH;
        }
        pdu->kind = *p;
        if (pdu->kind < (uint8_t)CFDP_EOF ||
            (pdu->kind > (uint8_t)CFDP_PROMPT && pdu->kind != (uint8_t)CFDP_KEEP_ALIVE)) {
            return CCSDS_TYPE;
        }
        return read_directive(pdu, p + 1, n - 1);
    }
    if (pdu->has_context != 0u) {
        if (n == 0 || n < (size_t)(*p & 63u) + 1) {
            return CCSDS_LENGTH;
        }
        pdu->continuation = *p >> 6;
        pdu->from.n = *p & 63u;
        pdu->from.bytes = p + 1;
        p += pdu->from.n + 1;
        n -= (size_t)pdu->from.n + 1;
    }
    const size_t wide = cfdp_wide(pdu->large);
    if (n < wide) {
        return CCSDS_LENGTH;
    }
    pdu->offset = cfdp_get(p, wide);
    pdu->data = p + wide;
    pdu->n = n - wide;
    return pdu->to_sender != 0u ? CCSDS_TYPE : CCSDS_OK;
}

size_t cfdp_pdu_head(const CfdpPdu *pdu)
{
    const size_t wide = cfdp_wide(pdu->large);
    const size_t head = 4 + 2 * (size_t)pdu->entity_bytes + pdu->sequence_bytes;
    switch (pdu->kind) {
    case CFDP_FILE_DATA: return head + wide + (pdu->has_context ? 1u + (size_t)pdu->from.n : 0);
    case CFDP_EOF: return head + 6 + wide;
    case CFDP_ACK: return head + 3;
    case CFDP_METADATA: return head + 4 + wide + pdu->from.n + pdu->to.n;
    case CFDP_NAK: return head + 1 + 2 * wide;
    case CFDP_KEEP_ALIVE: return head + 1 + wide;
    default: /* CFDP_FINISHED, CFDP_PROMPT */ return head + 2;
    }
}

static uint8_t *put_text(uint8_t *p, const CfdpText *text)
{
    *p = text->n;
    if (text->n != 0u) {
        memcpy(p + 1, text->bytes, text->n);
    }
    return p + 1 + text->n;
}

size_t cfdp_pdu_write(const CfdpPdu *pdu, uint8_t *bytes, size_t room)
{
    const size_t wide = cfdp_wide(pdu->large), head = cfdp_pdu_head(pdu), check = pdu->crc ? 2 : 0;
    const size_t ids = 4 + 2 * (size_t)pdu->entity_bytes + pdu->sequence_bytes, n = head + pdu->n + check;
    if (pdu->n > (size_t)CFDP_PDU_MAX || n > room || n - ids > 0xFFFF ||
        pdu->from.n > (pdu->kind ? 255 : CFDP_CONTEXT_MAX)) {
        return 0;
    }
    const uint32_t data = pdu->kind == (uint8_t)CFDP_FILE_DATA;
    if (pdu->n != 0 && pdu->data != bytes + head) {
        memmove(bytes + head, pdu->data, pdu->n); /* first, as it may stand where the head is written */
    }
    bytes[0] = (uint8_t)(1u << 5 | data << 4 | (uint32_t)pdu->to_sender << 3 | (uint32_t)pdu->unacknowledged << 2 |
                         (uint32_t)pdu->crc << 1 | pdu->large);
    ccsds_put16(bytes + 1, (uint32_t)(n - ids));
    bytes[3] = (uint8_t)((uint32_t)pdu->records << 7 | (pdu->entity_bytes - 1u) << 4 |
                         (data != 0u ? (uint32_t)pdu->has_context << 3 : 0u) | (pdu->sequence_bytes - 1u));
    uint8_t *p = bytes + 4;
    cfdp_put_number(p, pdu->entity_bytes, pdu->source);
    p += pdu->entity_bytes;
    cfdp_put_number(p, pdu->sequence_bytes, pdu->sequence);
    p += pdu->sequence_bytes;
    cfdp_put_number(p, pdu->entity_bytes, pdu->destination);
    p += pdu->entity_bytes;
    if (data == 0u) {
        *p++ = pdu->kind;
    }
    switch (pdu->kind) {
    case CFDP_FILE_DATA:
        if (pdu->has_context != 0u) {
            uint8_t *length = p;
            p = put_text(p, &pdu->from);
            *length = (uint8_t)(*length | (uint32_t)pdu->continuation << 6);
        }
        cfdp_put_number(p, wide, pdu->offset);
        break;
    case CFDP_EOF:
        p[0] = (uint8_t)(pdu->condition << 4);
        ccsds_put32(p + 1, pdu->checksum);
        cfdp_put_number(p + 5, wide, pdu->offset);
        break;
    case CFDP_FINISHED:
        p[0] = (uint8_t)((uint32_t)pdu->condition << 4 | (uint32_t)pdu->incomplete << 2 | pdu->file_status);
        break;
    case CFDP_ACK:
        p[0] = (uint8_t)((uint32_t)pdu->acknowledged << 4 | (pdu->acknowledged == (uint8_t)CFDP_FINISHED ? 1u : 0u));
        p[1] = (uint8_t)((uint32_t)pdu->condition << 4 | pdu->status);
        break;
    case CFDP_METADATA:
        p[0] = (uint8_t)((uint32_t)pdu->closure << 6 | pdu->checksum_type);
        cfdp_put_number(p + 1, wide, pdu->offset);
        p = put_text(p + 1 + wide, &pdu->from);
        (void)put_text(p, &pdu->to);
        break;
    case CFDP_NAK:
        cfdp_put_number(p, wide, pdu->offset);
        cfdp_put_number(p + wide, wide, pdu->end);
        break;
    case CFDP_PROMPT: p[0] = (uint8_t)(pdu->keep_alive << 7); break;
    default: /* CFDP_KEEP_ALIVE */ cfdp_put_number(p, wide, pdu->offset); break;
    }
    if (check != 0) {
        ccsds_put16(bytes + n - 2, ccsds_crc16(bytes, n - 2));
    }
    return n;
}

/* ---- TLVs */

int cfdp_tlv_next(CfdpTlv *tlv, const uint8_t **bytes, size_t *n)
{
    if (*n < 2 || (size_t)(*bytes)[1] + 2 > *n) {
        return 0;
    }
    tlv->type = (*bytes)[0];
    tlv->value.n = (*bytes)[1];
    tlv->value.bytes = *bytes + 2;
    *bytes += 2 + tlv->value.n;
    *n -= 2 + (size_t)tlv->value.n;
    return 1;
}

size_t cfdp_tlv_write(uint8_t type, const uint8_t *value, size_t n, uint8_t *bytes, size_t room)
{
    if (n > 255 || n + 2 > room) {
        return 0;
    }
    bytes[0] = type;
    bytes[1] = (uint8_t)n;
    if (n != 0 && value != bytes + 2) {
        memmove(bytes + 2, value, n);
    }
    return n + 2;
}

static int has_second(uint8_t action)
{
    return action == (uint8_t)CFDP_RENAME_FILE || action == (uint8_t)CFDP_APPEND_FILE ||
           action == (uint8_t)CFDP_REPLACE_FILE;
}

CcsdsFault cfdp_filestore_read(CfdpFilestore *operation, const CfdpTlv *tlv)
{
    memset(operation, 0, sizeof *operation);
    if (tlv->type > (uint8_t)CFDP_TLV_RESPONSE) {
        return CCSDS_TYPE;
    }
    if (tlv->value.n == 0u) {
        return CCSDS_LENGTH;
    }
    const uint8_t *p = tlv->value.bytes + 1;
    size_t n = tlv->value.n - 1u;
    operation->response = tlv->type;
    operation->action = tlv->value.bytes[0] >> 4;
    operation->status = tlv->value.bytes[0] & 15u;
    if (operation->action > (uint8_t)CFDP_DENY_DIRECTORY) {
        return CCSDS_TYPE;
    }
    if (!take_text(&operation->first, &p, &n) ||
        (has_second(operation->action) && !take_text(&operation->second, &p, &n)) ||
        (operation->response != 0u && !take_text(&operation->message, &p, &n)) || n != 0) {
        return CCSDS_LENGTH;
    }
    return CCSDS_OK;
}

size_t cfdp_filestore_write(const CfdpFilestore *operation, uint8_t *bytes, size_t room)
{
    uint8_t value[4 + 3 * 255];
    uint8_t *p = value;
    *p++ = (uint8_t)((uint32_t)operation->action << 4 | (operation->response ? operation->status : 0u));
    p = put_text(p, &operation->first);
    if (has_second(operation->action)) {
        p = put_text(p, &operation->second);
    }
    if (operation->response != 0u) {
        p = put_text(p, &operation->message);
    }
    return cfdp_tlv_write(operation->response, value, (size_t)(p - value), bytes, room);
}

/* The fields of each message: e entity with its length, o transaction, t first text, u second text, v value. */
static const char *fields(uint8_t type)
{
    switch (type) {
    case CFDP_PROXY_PUT: return "etu";
    case CFDP_PROXY_MESSAGE:
    case CFDP_PROXY_REQUEST:
    case CFDP_PROXY_FLOW:
    case CFDP_PROXY_RESPONSE: return "t";
    case CFDP_PROXY_HANDLER:
    case CFDP_PROXY_MODE:
    case CFDP_PROXY_RECORDS:
    case CFDP_PROXY_PUT_RESPONSE:
    case CFDP_PROXY_CLOSURE: return "v";
    case CFDP_PROXY_CANCEL: return "";
    case CFDP_ORIGIN: return "o";
    case CFDP_LIST: return "tu";
    case CFDP_LISTED: return "vtu";
    case CFDP_REMOTE_REPORT: return "ot";
    case CFDP_REMOTE_SUSPEND:
    case CFDP_REMOTE_RESUME: return "o";
    case CFDP_REMOTE_REPORTED:
    case CFDP_REMOTE_SUSPENDED:
    case CFDP_REMOTE_RESUMED: return "vo";
    default: return NULL;
    }
}

static const uint8_t mark[4] = {'c', 'f', 'd', 'p'}; /* begins each reserved message */

CcsdsFault cfdp_message_read(CfdpMessage *message, const CfdpTlv *tlv)
{
    memset(message, 0, sizeof *message);
    const uint8_t *p = tlv->value.bytes;
    size_t n = tlv->value.n;
    if (tlv->type != (uint8_t)CFDP_TLV_MESSAGE || n < 5 || memcmp(p, mark, 4) != 0 || fields(p[4]) == NULL) {
        return CCSDS_TYPE;
    }
    message->type = p[4];
    p += 5;
    n -= 5;
    for (const char *field = fields(message->type); *field != '\0'; field++) {
        CfdpText text = {NULL, 0u};
        size_t took = 1;
        switch (*field) {
        case 'v':
            if (n == 0) {
                return CCSDS_LENGTH;
            }
            message->value = *p;
            break;
        case 'o':
            if (n == 0) {
                return CCSDS_LENGTH;
            }
            message->entity_bytes = (uint8_t)((*p >> 4 & 7u) + 1u);
            message->sequence_bytes = (uint8_t)((*p & 7u) + 1u);
            took = 1u + message->entity_bytes + message->sequence_bytes;
            if (n < took) {
                return CCSDS_LENGTH;
            }
            message->entity = cfdp_get(p + 1, message->entity_bytes);
            message->sequence = cfdp_get(p + 1 + message->entity_bytes, message->sequence_bytes);
            break;
        default:
            took = 0;
            if (!take_text(&text, &p, &n) || (*field == 'e' && (text.n == 0u || text.n > 8u))) {
                return CCSDS_LENGTH;
            }
            if (*field == 'e') {
                message->entity_bytes = text.n;
                message->entity = cfdp_get(text.bytes, text.n);
            } else if (*field == 't') {
                message->first = text;
            } else {
                message->second = text;
            }
        }
        p += took;
        n -= took;
    }
    return n == 0 ? CCSDS_OK : CCSDS_LENGTH;
}

size_t cfdp_message_write(const CfdpMessage *message, uint8_t *bytes, size_t room)
{
    uint8_t value[5 + 1 + 9 + 17 + 2 * 256];
    uint8_t *p = value + 5;
    const char *field = fields(message->type);
    if (field == NULL) {
        return 0;
    }
    memcpy(value, mark, 4);
    value[4] = message->type;
    for (; *field != '\0'; field++) {
        switch (*field) {
        case 'v': *p++ = message->value; break;
        case 'o':
            *p++ = (uint8_t)((message->entity_bytes - 1u) << 4 | (message->sequence_bytes - 1u));
            cfdp_put_number(p, message->entity_bytes, message->entity);
            p += message->entity_bytes;
            cfdp_put_number(p, message->sequence_bytes, message->sequence);
            p += message->sequence_bytes;
            break;
        case 'e':
            *p++ = message->entity_bytes;
            cfdp_put_number(p, message->entity_bytes, message->entity);
            p += message->entity_bytes;
            break;
        default: p = put_text(p, *field == 't' ? &message->first : &message->second); break;
        }
    }
    return cfdp_tlv_write(CFDP_TLV_MESSAGE, value, (size_t)(p - value), bytes, room);
}

/* ---- checksums */

uint32_t cfdp_checksum(uint8_t type, uint32_t sum, uint64_t offset, const uint8_t *bytes, size_t n)
{
    static const uint32_t nibbles[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                         0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                         0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};
    size_t i = 0;
    if (type == (uint8_t)CFDP_CRC32) {
        sum = ~sum;
        for (; i < n; i++) {
            sum ^= bytes[i];
            sum = sum >> 4 ^ nibbles[sum & 15u];
            sum = sum >> 4 ^ nibbles[sum & 15u];
        }
        return ~sum;
    }
    if (type == (uint8_t)CFDP_NULL_CHECKSUM) {
        return 0u;
    }
    for (; i < n && (offset + i) % 4 != 0; i++) {
        sum += (uint32_t)bytes[i] << (24 - 8 * ((offset + i) % 4));
    }
    for (; n - i >= 4; i += 4) {
        sum += ccsds_get32(bytes + i);
    }
    for (; i < n; i++) {
        sum += (uint32_t)bytes[i] << (24 - 8 * ((offset + i) % 4));
    }
    return sum;
}
