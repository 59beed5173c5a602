/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

#include <string.h>

/* All is there: give the file its name, do what the transaction requests, and finish. */
static void deliver(Cfdp *cfdp, CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    if (t->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM && t->sum != t->checksum) {
        cfdp_declare_fault(cfdp, t, CFDP_CHECKSUM_FAILURE);
        return;
    }
    t->file_status = CFDP_UNREPORTED;
    if (t->to[0] != '\0') {
        char name[CFDP_NAME];
        cfdp_unfinished_name(cfdp, t, name);
        if (cfdp_open_file(cfdp, t) < 0) {
            cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        cfdp_close_file(cfdp, t);
        if (store->rename(store->user, name, t->to) < 0) {
            cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        t->file_status = CFDP_RETAINED;
    }
    cfdp_discard_file(cfdp, t);
    t->state = CFDP_FINISHING;
    t->incomplete = 0u;
    t->due = DUE_FINISHED;
    t->tries = 0u;
    CfdpTlv tlv;
    CfdpFilestore request;
    const uint8_t *at = t->options;
    int failed = 0;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        /* undecided: Metadata with a request that cannot be read was refused */
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST && cfdp_filestore_read(&request, &tlv) == CCSDS_OK) {
            const uint8_t status = failed ? (uint8_t)CFDP_NOT_PERFORMED : cfdp_perform(cfdp, t, &request);
            t->results[t->results_n++] = status;
            failed = failed || status != 0u;
        }
    }
    cfdp_serve_messages(cfdp, t);
    if (t->class1 != 0u && t->closure == 0u) {
        cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
    }
}

/* Go on with the checksum, by a part of the file if `read`. */
static void update_checksum(Cfdp *cfdp, CfdpTransaction *t, int read)
{
    const CfdpStore *store = &cfdp->set.store;
    const int whole = t->state == (uint8_t)CFDP_CHECKING;
    const uint64_t solid = t->ranges != 0u ? cfdp_ranges(cfdp, t)[0].begin : t->progress;
    if (t->metadata != 0u && t->ordered == 0u) {
        t->checked = solid;
    }
    if (read && t->metadata != 0u && t->checked < solid) {
        const uint64_t left = solid - t->checked;
        const size_t n = left < cfdp->set.work_n ? (size_t)left : cfdp->set.work_n;
        if (cfdp_open_file(cfdp, t) < 0 || store->read(store->user, t->file, t->checked, cfdp->set.work, n) < 0) {
            cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        t->sum = cfdp_checksum(t->checksum_type, t->sum, t->checked, cfdp->set.work, n);
        t->checked += n;
    }
    if (whole && t->checked == t->size) {
        deliver(cfdp, t);
    }
}

void cfdp_receiver_step(Cfdp *cfdp, CfdpTransaction *t)
{
    if (t->state != (uint8_t)CFDP_RECEIVING || t->suspended != 0u || t->eof == 0u) {
        return;
    }
    if (t->progress > t->size) {
        cfdp_declare_fault(cfdp, t, CFDP_SIZE_ERROR);
    } else if (!cfdp_misses_parts(t)) {
        t->state = CFDP_CHECKING;
        t->due = 0u;
        t->expires = INT64_MAX;
        update_checksum(cfdp, t, 0);
    } else if (t->class1 != 0u && t->expires == INT64_MAX) {
        t->expires = cfdp_deadline(cfdp, cfdp_peer(cfdp, t->peer)->check_timer);
    }
}

void cfdp_receiver_tick(Cfdp *cfdp, CfdpTransaction *t)
{
    cfdp_receiver_step(cfdp, t); /* a remote entity may have resumed it */
    if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_CHECKING) {
        update_checksum(cfdp, t, 1);
    }
}

/* Write new bytes of the file. Returns 0 if the store refuses. */
static int write_bytes(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const uint8_t *data, CfdpRange part)
{
    const CfdpStore *store = &cfdp->set.store;
    const size_t n = (size_t)(part.end - part.begin);
    if (cfdp_open_file(cfdp, t) < 0 || store->write(store->user, t->file, part.begin, data, n) < 0) {
        cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return 0;
    }
    if (t->metadata != 0u && (t->ordered == 0u || part.begin == t->checked)) { /* as it is at hand */
        t->sum = cfdp_checksum(t->checksum_type, t->sum, part.begin, data, n);
        t->checked = part.end;
    }
    if (t->eof != 0u && t->class1 == 0u) { /* the NAK works */
        t->tries = 0u;
        if (t->expires != INT64_MAX) {
            t->expires = cfdp_deadline(cfdp, remote->nak_timer);
        }
    }
    return 1;
}

/* Data for which there is no range is dropped; what is known to be missing is requested, to make room. */
static void drop_data(Cfdp *cfdp, CfdpTransaction *t)
{
    cfdp->live.faults[CCSDS_ROOM]++;
    if (t->class1 == 0u && t->expires == INT64_MAX && t->due == 0u) {
        t->requested = 0;
        t->due = DUE_NAK;
    }
}

/* Data behind all that came. Returns 0 if it is not kept. */
static int append_data(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const uint8_t *data, CfdpRange part)
{
    const int gap = part.begin > t->progress;
    if (gap && cfdp_ranges_full(cfdp, t)) {
        drop_data(cfdp, t);
        return 0;
    }
    if (!write_bytes(cfdp, t, remote, data, part)) {
        return 0;
    }
    if (gap) {
        cfdp_range_insert(cfdp, t, t->ranges, (CfdpRange){t->progress, part.begin});
        if (remote->immediate != 0u && t->class1 == 0u) {
            t->due |= DUE_NAK;
        }
    }
    t->progress = part.end;
    return 1;
}

/* Data within the missing range i. Returns 0 if it is not kept. */
static int fill_range(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const uint8_t *data, CfdpRange part,
                      uint32_t i)
{
    CfdpRange *ranges = cfdp_ranges(cfdp, t);
    const CfdpRange gap = ranges[i];
    const int from_begin = part.begin == gap.begin, to_end = part.end == gap.end;
    if (!from_begin && !to_end && cfdp_ranges_full(cfdp, t)) {
        drop_data(cfdp, t);
        return 0;
    }
    if (!write_bytes(cfdp, t, remote, data, part)) {
        return 0;
    }
    if (from_begin && to_end) {
        cfdp_range_remove(t, ranges, i);
    } else if (from_begin) {
        ranges[i].begin = part.end;
    } else {
        ranges[i].end = part.begin;
        if (!to_end) {
            cfdp_range_insert(cfdp, t, i + 1u, (CfdpRange){part.end, gap.end});
        }
    }
    return 1;
}

static void take_data(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu)
{
    const uint64_t most = t->large != 0u ? UINT64_MAX >> 1 : UINT32_MAX; /* that its PDUs can name */
    const uint64_t limit = t->eof != 0u || (t->metadata != 0u && t->size != 0u) ? t->size : most;
    if (t->state != (uint8_t)CFDP_RECEIVING || pdu->n == 0) {
        return;
    }
    if (pdu->offset > limit || pdu->n > limit - pdu->offset) {
        cfdp_declare_fault(cfdp, t, CFDP_SIZE_ERROR);
        return;
    }
    CfdpRange part = {pdu->offset, pdu->offset + pdu->n};
    for (const uint64_t stop = part.end; part.begin < stop; part.begin = part.end) {
        const uint8_t *data = pdu->data + (part.begin - pdu->offset);
        part.end = stop;
        if (part.begin >= t->progress) {
            if (!append_data(cfdp, t, remote, data, part)) {
                return;
            }
            break;
        }
        const CfdpRange *ranges = cfdp_ranges(cfdp, t);
        const uint32_t i = cfdp_range_at(ranges, t->ranges, part.begin);
        if (i == t->ranges || ranges[i].begin > part.begin) { /* came before */
            part.end = i == t->ranges ? t->progress : ranges[i].begin;
            continue;
        }
        part.end = stop < ranges[i].end ? stop : ranges[i].end;
        if (!fill_range(cfdp, t, remote, data, part, i)) {
            return;
        }
    }
    if (t->metadata == 0u && remote->immediate != 0u && t->class1 == 0u && t->expires == INT64_MAX) {
        t->due |= DUE_NAK;
    }
    cfdp_receiver_step(cfdp, t);
}

static void take_metadata(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    CfdpTlv tlv;
    CfdpFilestore request;
    const uint8_t *at = pdu->data;
    uint32_t requests = 0u;
    if (t->state != (uint8_t)CFDP_RECEIVING || t->metadata != 0u) {
        return;
    }
    for (size_t n = pdu->n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST) {
            requests += cfdp_filestore_read(&request, &tlv) == CCSDS_OK ? 1u : (uint32_t)CFDP_REQUESTS + 1u;
        }
        cfdp_set_handler(t, &tlv);
    }
    (void)cfdp_copy_name(t->from, pdu->from);
    if (!cfdp_copy_name(t->to, pdu->to) || (pdu->to.n == 0u) != (pdu->from.n == 0u) || pdu->n > (size_t)CFDP_OPTIONS ||
        requests > (uint32_t)CFDP_REQUESTS) {
        cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return;
    }
    if (pdu->checksum_type != (uint8_t)CFDP_MODULAR && pdu->checksum_type != (uint8_t)CFDP_CRC32 &&
        pdu->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM) {
        cfdp_declare_fault(cfdp, t, CFDP_UNSUPPORTED_CHECKSUM);
        return;
    }
    t->metadata = 1u;
    t->closure = pdu->closure;
    t->checksum_type = pdu->checksum_type;
    t->ordered =
        t->checksum_type == (uint8_t)CFDP_CRC32 || (t->checksum_type == (uint8_t)CFDP_MODULAR && t->progress != 0);
    t->size = t->eof != 0u ? t->size : pdu->offset;
    t->options_n = (uint16_t)pdu->n;
    memcpy(t->options, pdu->data, pdu->n);
    cfdp_notify(cfdp, t, CFDP_EVENT_STARTED);
    cfdp_receiver_step(cfdp, t);
}

static void take_eof(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    if (!cfdp_acknowledge(cfdp, pdu, t->peer, CFDP_ACTIVE) || t->state != (uint8_t)CFDP_RECEIVING) {
        return;
    }
    if (pdu->condition != (uint8_t)CFDP_NO_ERROR) {
        t->condition = pdu->condition;
        t->incomplete = 1u;
        cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
    } else if (t->eof == 0u) {
        t->eof = 1u;
        t->size = pdu->offset;
        t->checksum = pdu->checksum;
        t->tries = 0u;
        if (t->class1 == 0u && cfdp_misses_parts(t)) {
            t->due |= DUE_NAK;
        }
        cfdp_receiver_step(cfdp, t);
    }
}

/* Where there is no place: that of what is received and has been silent longest, for longer than what is missing takes
 * to be requested. So transactions that begin and say no more, as others may forge them, keep no file away for long. */
static CfdpTransaction *replace_silent(Cfdp *cfdp)
{
    CfdpTransaction *silentest = NULL;
    int64_t longest = 0;
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        if (t->state == (uint8_t)CFDP_FREE || !cfdp_receives(t) || t->suspended != 0u || t->inactive == INT64_MAX) {
            continue;
        }
        const CfdpRemote *remote = cfdp_peer(cfdp, t->peer);
        const int64_t silent = cfdp->live.now - (t->inactive - remote->inactivity);
        if (remote->frozen == 0u && silent > 2 * remote->nak_timer && silent > longest) {
            silentest = t;
            longest = silent;
        }
    }
    if (silentest != NULL) {
        if (silentest->state != (uint8_t)CFDP_FINISHING) {
            silentest->condition = CFDP_INACTIVITY;
            silentest->incomplete = 1u;
            cfdp->live.conditions[CFDP_INACTIVITY]++;
        }
        cfdp_end_transaction(cfdp, silentest, CFDP_EVENT_ENDED);
    }
    return silentest != NULL && silentest->state == (uint8_t)CFDP_FREE ? silentest
                                                                       : NULL; /* the user may have put the next */
}

CfdpTransaction *cfdp_receiver_begin(Cfdp *cfdp, const CfdpPdu *pdu, const CfdpRemote *remote)
{
    CfdpTransaction *t = cfdp_vacant(cfdp, cfdp->set.kept);
    if (t == NULL) {
        t = replace_silent(cfdp);
    }
    if (t == NULL) {
        cfdp->live.faults[CCSDS_ROOM]++;
        return NULL;
    }
    memset(t, 0, sizeof *t);
    t->id = (CfdpId){pdu->source, pdu->sequence};
    t->peer = pdu->source;
    t->state = CFDP_RECEIVING;
    t->class1 = pdu->unacknowledged;
    t->large = pdu->large;
    t->crc = pdu->crc;
    t->entity_bytes = pdu->entity_bytes;
    t->sequence_bytes = pdu->sequence_bytes;
    t->file = -1;
    t->expires = INT64_MAX;
    t->keep_alive = cfdp_deadline(cfdp, remote->keep_alive);
    return t;
}

/* As many missing ranges as there is room for; the next PDU goes on behind them. */
static size_t write_nak(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    const CfdpRange *ranges = cfdp_ranges(cfdp, t);
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_NAK);
    const size_t head = cfdp_pdu_head(&pdu), wide = cfdp_wide(t->large);
    const size_t most = room - head - 2 < remote->segment ? room - head - 2 : remote->segment;
    const uint64_t last = t->eof != 0u ? t->size : t->progress;
    uint8_t *p = bytes + head;
    pdu.offset = t->requested;
    if (t->metadata == 0u && t->requested == 0) {
        memset(p, 0, 2 * wide);
        pdu.n = 2 * wide;
    }
    uint32_t i = cfdp_range_at(ranges, t->ranges, t->requested);
    for (; i <= t->ranges && (pdu.n == 0 || t->requested == 0 || pdu.n + 2 * wide <= most); i++) {
        CfdpRange gap = i < t->ranges ? ranges[i] : (CfdpRange){t->progress, last};
        gap.begin = gap.begin < t->requested ? t->requested : gap.begin;
        if (gap.begin < gap.end) {
            cfdp_put_number(p + pdu.n, wide, gap.begin);
            cfdp_put_number(p + pdu.n + wide, wide, gap.end);
            pdu.n += 2 * wide;
            t->requested = gap.end;
        }
    }
    if (i > t->ranges || (i == t->ranges && t->progress >= last)) {
        t->requested = last;
        t->due = (uint8_t)(t->due & ~(uint32_t)DUE_NAK);
        if (t->expires == INT64_MAX && cfdp_misses_parts(t)) {
            t->expires = cfdp_deadline(cfdp, remote->nak_timer);
        }
    }
    pdu.end = t->requested;
    pdu.data = p;
    return cfdp_pdu_write(&pdu, bytes, room);
}

static size_t write_finished(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_FINISHED);
    const size_t head = cfdp_pdu_head(&pdu);
    const uint8_t *at = t->options;
    CfdpTlv tlv;
    uint32_t i = 0u;
    pdu.incomplete = t->incomplete;
    pdu.file_status = t->file_status;
    /* undecided: the requests that have results are among the options */
    for (size_t n = t->options_n; i < t->results_n && cfdp_tlv_next(&tlv, &at, &n);) {
        CfdpFilestore response;
        /* undecided: a request that has a result was read before */
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST && cfdp_filestore_read(&response, &tlv) == CCSDS_OK) {
            response.response = 1u;
            response.status = t->results[i++];
            pdu.n += cfdp_filestore_write(&response, bytes + head + pdu.n, room - head - pdu.n - FAULT_LOCATION);
        }
    }
    cfdp_add_fault_location(cfdp, t, &pdu, bytes + head);
    t->tries++;
    t->expires = cfdp_deadline(cfdp, remote->ack_timer);
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    if (t->class1 != 0u) {
        cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
    }
    return n;
}

void cfdp_receiver_restart(Cfdp *cfdp, CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    t->checked = 0;
    t->sum = 0u;
    t->ordered = t->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM;
    if (t->created != 0u && (cfdp_open_file(cfdp, t) < 0 || store->size(store->user, t->file) < (int64_t)t->progress)) {
        cfdp_declare_fault(cfdp, t, CFDP_FILESTORE_REJECTION);
    }
}

void cfdp_receiver_take(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu)
{
    switch (pdu->kind) {
    case CFDP_FILE_DATA: take_data(cfdp, t, remote, pdu); break;
    case CFDP_METADATA: take_metadata(cfdp, t, pdu); break;
    case CFDP_EOF: take_eof(cfdp, t, pdu); break;
    case CFDP_ACK:
        if (t->state == (uint8_t)CFDP_FINISHING) {
            cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
        }
        break;
    default: /* CFDP_PROMPT */
        if (t->state == (uint8_t)CFDP_RECEIVING && t->class1 == 0u) {
            t->due |= pdu->keep_alive ? DUE_KEEP_ALIVE : DUE_NAK;
            t->requested = pdu->keep_alive ? t->requested : 0;
        }
        break;
    }
}

void cfdp_receiver_expire(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote)
{
    t->expires = INT64_MAX;
    if (t->state == (uint8_t)CFDP_FINISHING) {
        t->due |= DUE_FINISHED;
        if (t->tries >= remote->ack_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_ACK_LIMIT);
        }
    } else if (t->class1 != 0u) { /* CFDP_RECEIVING: in CFDP_CHECKING it does not run */
        t->expires = cfdp_deadline(cfdp, remote->check_timer);
        if (++t->tries >= remote->check_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_CHECK_LIMIT);
        }
    } else if (cfdp_misses_parts(t) && (t->eof != 0u || remote->immediate != 0u || cfdp_ranges_full(cfdp, t))) {
        t->requested = 0;
        t->due |= DUE_NAK;
        if (t->eof != 0u && t->tries++ >= remote->nak_limit) {
            cfdp_declare_fault(cfdp, t, CFDP_NAK_LIMIT);
        }
    }
}

size_t cfdp_receiver_next(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    if ((t->due & DUE_FINISHED) != 0u) {
        t->due = (uint8_t)(t->due & ~(uint32_t)DUE_FINISHED);
        return write_finished(cfdp, t, remote, bytes, room);
    }
    if ((t->due & DUE_NAK) != 0u) {
        return write_nak(cfdp, t, remote, bytes, room);
    }
    t->due = (uint8_t)(t->due & ~(uint32_t)DUE_KEEP_ALIVE);
    CfdpPdu pdu = cfdp_pdu(cfdp, t, CFDP_KEEP_ALIVE);
    pdu.offset = t->progress;
    return cfdp_pdu_write(&pdu, bytes, room);
}
