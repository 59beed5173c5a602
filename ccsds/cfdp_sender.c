/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

#include <string.h>

static void take_nak(const Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    const size_t wide = cfdp_wide(pdu->large);
    for (size_t i = 0; i < pdu->n && t->condition == 0u; i += 2 * wide) {
        CfdpRange range = {cfdp_get(pdu->data + i, wide), cfdp_get(pdu->data + i + wide, wide)};
        if (range.end == 0) {
            t->due |= DUE_METADATA;
        }
        range.end = range.end < t->progress ? range.end : t->progress; /* the rest comes anyway */
        if (range.begin < range.end) {
            cfdp_range_add(cfdp, t, range);
        }
    }
}

static void take_finished(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    CfdpTlv tlv;
    const uint8_t *at = pdu->data;
    if (!cfdp_acknowledge(cfdp, pdu, t->peer, CFDP_TERMINATED)) {
        return;
    }
    t->condition = t->condition != 0u ? t->condition : pdu->condition;
    t->incomplete = pdu->incomplete;
    t->file_status = pdu->file_status;
    for (size_t n = pdu->n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_RESPONSE) {
            cfdp_notify_text(cfdp, t, CFDP_EVENT_RESPONSE, tlv.value);
        }
    }
    cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
}

static size_t write_data(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    const CfdpStore *store = &cfdp->set.store;
    CfdpRange *ranges = cfdp_ranges(cfdp, t);
    const int again = t->ranges != 0u;
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_FILE_DATA);
    const size_t head = cfdp_pdu_head(&pdu);
    const uint64_t stop = again ? ranges[0].end : t->size;
    pdu.offset = again ? ranges[0].begin : t->progress;
    pdu.n = room - head - 2 < remote->segment ? room - head - 2 : remote->segment;
    pdu.n = stop - pdu.offset < pdu.n ? (size_t)(stop - pdu.offset) : pdu.n;
    pdu.data = bytes + head;
    if (cfdp_open_file(cfdp, t) < 0 || store->read(store->user, t->file, pdu.offset, bytes + head, pdu.n) < 0) {
        cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return 0;
    }
    if (again) {
        ranges[0].begin += pdu.n;
        if (ranges[0].begin == ranges[0].end) {
            cfdp_range_remove(t, ranges, 0u);
        }
        t->inactive = cfdp_deadline(cfdp, remote->inactivity);
    } else {
        t->sum = cfdp_checksum(t->checksum_type, t->sum, pdu.offset, bytes + head, pdu.n);
        t->progress += pdu.n;
        if (t->progress == t->size) {
            t->due |= DUE_EOF;
        }
    }
    return cfdp_pdu_write(&pdu, bytes, room);
}

static size_t write_eof(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_EOF);
    pdu.checksum = t->sum;
    pdu.offset = t->progress;
    cfdp_add_fault_location(cfdp, t, &pdu, bytes + cfdp_pdu_head(&pdu));
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    t->state = CFDP_SENT;
    t->tries++;
    t->expires = cfdp_deadline(cfdp, remote->ack_timer);
    if (t->class1 != 0u) {
        t->state = CFDP_WAITING;
        t->tries = 0u;
        t->inactive = INT64_MAX;
        t->expires = cfdp_deadline(cfdp, remote->check_timer);
        if (t->closure == 0u || t->condition != 0u) {
            cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
        }
    }
    return n;
}

static size_t write_metadata(Cfdp *cfdp, CfdpTransaction *t, uint8_t *bytes, size_t room)
{
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_METADATA);
    pdu.closure = t->closure;
    pdu.checksum_type = t->checksum_type;
    pdu.offset = t->size;
    pdu.from = cfdp_text(t->from);
    pdu.to = cfdp_text(t->to);
    pdu.data = t->options;
    pdu.n = t->options_n;
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    if (n == 0) { /* the options are too long for the link */
        cfdp_cancel_transaction(cfdp, t, CFDP_INVALID_STRUCTURE);
    }
    return n;
}

void cfdp_sender_take(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu)
{
    switch (pdu->kind) {
    case CFDP_FINISHED: take_finished(cfdp, t, pdu); break;
    case CFDP_ACK:
        if (t->condition != 0u) { /* CFDP_SENT, or its EOF is to be sent */
            if ((t->due & DUE_EOF) == 0u) {
                cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
            }
        } else if (t->state == (uint8_t)CFDP_SENT) {
            t->state = CFDP_WAITING;
            t->expires = INT64_MAX;
            t->due = (uint8_t)(t->due & ~(uint32_t)DUE_EOF);
        }
        break;
    case CFDP_NAK: take_nak(cfdp, t, pdu); break;
    default: /* CFDP_KEEP_ALIVE */
        if (remote->keep_alive_limit != 0 && t->condition == 0u && t->progress > pdu->offset &&
            t->progress - pdu->offset > remote->keep_alive_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_KEEP_ALIVE_LIMIT);
        }
        break;
    }
}

void cfdp_sender_expire(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote)
{
    t->expires = INT64_MAX;
    if (t->state == (uint8_t)CFDP_SENT) {
        t->due |= DUE_EOF;
        if (t->tries >= remote->ack_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_ACK_LIMIT);
        }
    } else { /* CFDP_WAITING, in class 1 with closure */
        t->expires = cfdp_deadline(cfdp, remote->check_timer);
        if (++t->tries >= remote->check_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_CHECK_LIMIT);
        }
    }
}

size_t cfdp_sender_next(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    if (t->due == 0u) {
        return write_data(cfdp, t, remote, bytes, room);
    }
    const uint32_t bit = t->due & (0u - t->due);
    t->due = (uint8_t)(t->due & ~bit);
    if (bit == (uint32_t)DUE_METADATA) {
        return write_metadata(cfdp, t, bytes, room);
    }
    if (bit == (uint32_t)DUE_EOF) {
        return write_eof(cfdp, t, remote, bytes, room);
    }
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_PROMPT);
    pdu.keep_alive = bit == (uint32_t)DUE_PROMPT_KEEP_ALIVE;
    return cfdp_pdu_write(&pdu, bytes, room);
}
