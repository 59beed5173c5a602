/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

#include <string.h>

static const char unfinished[] = ".cfdp"; /* the names of unfinished files begin so, and no file of a remote entity */

int64_t cfdp_deadline(const Cfdp *cfdp, int64_t timer)
{
    return timer <= 0 || cfdp->live.now > INT64_MAX - timer ? INT64_MAX : cfdp->live.now + timer;
}

CfdpRemote *cfdp_remote(const Cfdp *cfdp, uint64_t entity)
{
    for (uint32_t i = 0u; i < cfdp->set.remotes_n; i++) {
        if (cfdp->set.remotes[i].entity == entity) {
            return &cfdp->set.remotes[i];
        }
    }
    return NULL;
}

const CfdpRemote *cfdp_peer(const Cfdp *cfdp, uint64_t peer)
{
    static const CfdpRemote gone = {.frozen = 1u};
    const CfdpRemote *remote = cfdp_remote(cfdp, peer);
    return remote != NULL ? remote : &gone;
}

CfdpTransaction *cfdp_find(const Cfdp *cfdp, CfdpId id, int receiver)
{
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        if (t->state != (uint8_t)CFDP_FREE && cfdp_receives(t) == receiver && t->id.source == id.source &&
            t->id.sequence == id.sequence) {
            return t;
        }
    }
    return NULL;
}

CfdpTransaction *cfdp_vacant(const Cfdp *cfdp, uint32_t kept)
{
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        if (cfdp->set.transactions[i].state == (uint8_t)CFDP_FREE) {
            if (kept == 0u) {
                return &cfdp->set.transactions[i];
            }
            kept--;
        }
    }
    return NULL;
}

int cfdp_is_past(const Cfdp *cfdp, CfdpId id)
{
    for (uint32_t i = 0u; i < cfdp->set.past_n; i++) {
        const CfdpPast *past = &cfdp->set.past[i];
        if (past->used != 0u && past->id.source == id.source && past->id.sequence == id.sequence) {
            return 1;
        }
    }
    return 0;
}

CfdpText cfdp_text(const char *name)
{
    CfdpText text = {(const uint8_t *)name, 0u};
    while (name[text.n] != '\0' && text.n < 255u) {
        text.n++;
    }
    return text;
}

int cfdp_copy_name(char *to, CfdpText name)
{
    to[0] = '\0';
    const size_t n = sizeof unfinished - 1;
    if (name.n >= (uint8_t)CFDP_NAME || (name.n >= n && memcmp(name.bytes, unfinished, n) == 0)) {
        return 0;
    }
    for (uint32_t i = 0u; i < name.n; i++) {
        if (name.bytes[i] == 0u) {
            to[0] = '\0';
            return 0;
        }
        to[i] = (char)name.bytes[i];
    }
    to[name.n] = '\0';
    return 1;
}

char *cfdp_write_number(char *to, const char *word, uint64_t number, char end)
{
    uint32_t digits = 1u;
    for (uint64_t rest = number / 10u; rest != 0u; rest /= 10u) {
        digits++;
    }
    while (*word != '\0') {
        *to++ = *word++;
    }
    for (uint32_t i = digits; i-- != 0u; number /= 10u) {
        to[i] = (char)('0' + number % 10u);
    }
    to[digits] = end;
    return to + digits + 1;
}

void cfdp_unfinished_name(const Cfdp *cfdp, const CfdpTransaction *t, char name[CFDP_NAME])
{
    (void)cfdp_write_number(name, unfinished, (uint64_t)(t - cfdp->set.transactions), '\0');
}

static CfdpEvent event_of(const CfdpTransaction *t, CfdpEventKind what)
{
    return (CfdpEvent){.what = what,
                       .id = t->id,
                       .peer = t->peer,
                       .progress = t->progress,
                       .size = t->size,
                       .from = t->from,
                       .to = t->to,
                       .receiver = (uint8_t)cfdp_receives(t),
                       .condition = t->condition,
                       .incomplete = t->incomplete,
                       .file_status = t->file_status};
}

void cfdp_notify_text(Cfdp *cfdp, const CfdpTransaction *t, CfdpEventKind what, CfdpText text)
{
    CfdpEvent event = event_of(t, what);
    event.text = text;
    cfdp->set.notify(cfdp->set.user, &event);
}

void cfdp_notify(Cfdp *cfdp, const CfdpTransaction *t, CfdpEventKind what)
{
    cfdp_notify_text(cfdp, t, what, (CfdpText){NULL, 0u});
}

void cfdp_close_file(Cfdp *cfdp, CfdpTransaction *t)
{
    if (t->file >= 0) {
        cfdp->set.store.close(cfdp->set.store.user, t->file);
    }
    t->file = -1;
}

int cfdp_open_file(Cfdp *cfdp, CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    if (t->file < 0) {
        char name[CFDP_NAME];
        cfdp_unfinished_name(cfdp, t, name);
        if (cfdp_receives(t)) {
            t->file = store->open(store->user, name, t->created ? CFDP_OPEN_WRITE : CFDP_OPEN_NEW);
            t->created = t->created || t->file >= 0;
        } else {
            t->file = store->open(store->user, t->from, CFDP_OPEN_READ);
        }
    }
    return t->file;
}

void cfdp_discard_file(Cfdp *cfdp, CfdpTransaction *t)
{
    char name[CFDP_NAME];
    cfdp_close_file(cfdp, t);
    if (t->created != 0u) {
        cfdp_unfinished_name(cfdp, t, name);
        (void)cfdp->set.store.remove(cfdp->set.store.user, name);
        t->created = 0u;
    }
}

/* Returns a handle with *size [bytes], or below 0. */
static int open_source(const CfdpStore *store, const char *name, int64_t *size)
{
    const int file = store->open(store->user, name, CFDP_OPEN_READ);
    if (file >= 0) {
        *size = store->size(store->user, file);
        if (*size < 0) {
            store->close(store->user, file);
            return (int)*size;
        }
    }
    return file;
}

int cfdp_put(Cfdp *cfdp, const CfdpPut *put, CfdpId *id)
{
    const CfdpRemote *remote = cfdp_remote(cfdp, put->destination);
    const CfdpText from = cfdp_text(put->from), to = cfdp_text(put->to);
    CfdpTransaction *t = cfdp_vacant(cfdp, 0u);
    if (remote == NULL || from.n >= (uint8_t)CFDP_NAME || to.n >= (uint8_t)CFDP_NAME ||
        (from.n == 0u) != (to.n == 0u) || put->options_n > (size_t)CFDP_OPTIONS) {
        return CFDP_REFUSED;
    }
    if (t == NULL) {
        return CFDP_FULL;
    }
    int64_t size = 0;
    const int file = from.n != 0u ? open_source(&cfdp->set.store, put->from, &size) : -1;
    if (from.n != 0u && file < 0) {
        return file;
    }
    memset(t, 0, sizeof *t);
    *id = (CfdpId){cfdp->set.entity, cfdp->live.sequence};
    cfdp->live.sequence++;
    t->id = *id;
    t->peer = put->destination;
    t->state = CFDP_SENDING;
    t->size = (uint64_t)size;
    t->large = t->size > UINT32_MAX;
    t->crc = remote->crc;
    t->entity_bytes = cfdp_bytes(t->id.source | t->peer, cfdp->set.entity_bytes);
    t->sequence_bytes = cfdp_bytes(t->id.sequence, cfdp->set.sequence_bytes);
    t->class1 = put->class1;
    t->closure = put->class1 != 0u && put->closure != 0u;
    t->priority = put->priority;
    t->checksum_type = remote->checksum;
    t->file = file;
    t->file_status = CFDP_UNREPORTED;
    t->expires = t->keep_alive = INT64_MAX;
    t->inactive = cfdp_deadline(cfdp, remote->inactivity);
    t->due = (uint8_t)(size == 0 ? DUE_METADATA | DUE_EOF : DUE_METADATA);
    memcpy(t->from, put->from, from.n);
    memcpy(t->to, put->to, to.n);
    t->options_n = (uint16_t)put->options_n;
    if (put->options_n != 0) {
        memcpy(t->options, put->options, put->options_n);
    }
    CfdpTlv tlv;
    const uint8_t *at = t->options;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        cfdp_set_handler(t, &tlv);
    }
    return 0;
}

void cfdp_answer_proxy(Cfdp *cfdp, CfdpId origin, uint8_t value)
{
    uint8_t options[64];
    const CfdpMessage response = {.type = CFDP_PROXY_PUT_RESPONSE, .value = value};
    const CfdpMessage origin_message = {.type = CFDP_ORIGIN,
                                        .entity = origin.source,
                                        .sequence = origin.sequence,
                                        .entity_bytes = 8u,
                                        .sequence_bytes = 8u};
    size_t n = cfdp_message_write(&response, options, sizeof options);
    n += cfdp_message_write(&origin_message, options + n, sizeof options - n);
    const CfdpPut put = {.destination = origin.source, .from = "", .to = "", .options = options, .options_n = n};
    (void)cfdp_put(cfdp, &put, &(CfdpId){0u, 0u});
}

void cfdp_end_transaction(Cfdp *cfdp, CfdpTransaction *t, CfdpEventKind what)
{
    const CfdpId origin = t->origin;
    const int proxy = t->proxy;
    const uint32_t value = (uint32_t)t->condition << 4 | (uint32_t)t->incomplete << 2 | t->file_status;
    cfdp_discard_file(cfdp, t); /* a delivered file has another name already */
    if (cfdp->set.past_n != 0u) {
        cfdp->set.past[cfdp->live.past] = (CfdpPast){t->id, 1u};
        cfdp->live.past = (cfdp->live.past + 1u) % cfdp->set.past_n;
    }
    const CfdpEvent event = event_of(t, what);
    t->state = CFDP_FREE; /* so that the user may put the next */
    cfdp->set.notify(cfdp->set.user, &event);
    if (proxy) {
        cfdp_answer_proxy(cfdp, origin, (uint8_t)value);
    }
}

void cfdp_cancel_transaction(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition)
{
    const int again = t->condition != 0u || t->state == (uint8_t)CFDP_FINISHING;
    t->condition = t->condition != 0u ? t->condition : (uint8_t)condition;
    t->suspended = 0u;
    t->tries = 0u;
    t->expires = INT64_MAX;
    t->ranges = 0u;
    if (again) { /* the other end does not answer */
        cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
    } else if (!cfdp_receives(t)) {
        t->state = CFDP_SENT;
        t->incomplete = 1u;
        t->due = DUE_EOF;
    } else {
        cfdp_discard_file(cfdp, t);
        t->incomplete = 1u;
        t->file_status = condition == CFDP_FILESTORE_REJECTION ? CFDP_REJECTED : CFDP_DISCARDED;
        t->state = CFDP_FINISHING;
        t->due = DUE_FINISHED;
        if (t->class1 != 0u && t->closure == 0u) {
            cfdp_end_transaction(cfdp, t, CFDP_EVENT_ENDED);
        }
    }
}

void cfdp_suspend_transaction(Cfdp *cfdp, CfdpTransaction *t)
{
    t->suspended = 1u;
    cfdp_notify(cfdp, t, CFDP_EVENT_SUSPENDED);
}

void cfdp_set_handler(CfdpTransaction *t, const CfdpTlv *tlv)
{
    if (tlv->type == (uint8_t)CFDP_TLV_HANDLER && tlv->value.n == 1u) {
        t->handlers[tlv->value.bytes[0] >> 4] = tlv->value.bytes[0] & 15u;
    }
}

int cfdp_misses_parts(const CfdpTransaction *t)
{
    return t->metadata == 0u || t->ranges != 0u || (t->eof != 0u && t->progress < t->size);
}

void cfdp_resume_transaction(Cfdp *cfdp, CfdpTransaction *t)
{
    t->suspended = 0u;
    cfdp_notify(cfdp, t, CFDP_EVENT_RESUMED);
    if (t->state == (uint8_t)CFDP_RECEIVING && t->class1 == 0u && cfdp_misses_parts(t)) {
        t->requested = 0;
        t->due |= DUE_NAK;
    }
}

void cfdp_declare_fault(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition)
{
    const uint8_t before = t->condition;
    const int fatal = condition == CFDP_CHECKSUM_FAILURE || condition == CFDP_SIZE_ERROR ||
                      condition == CFDP_FILESTORE_REJECTION || condition == CFDP_UNSUPPORTED_CHECKSUM;
    uint8_t handler = t->handlers[condition];
    if (t->suspended != 0u) {
        return; /* the user knows */
    }
    if (handler == 0u) {
        handler = cfdp_peer(cfdp, t->peer)->handlers[condition];
    }
    if (before != 0u && handler != (uint8_t)CFDP_ABANDON) {
        handler = CFDP_CANCEL; /* it ends already */
    }
    cfdp->live.conditions[condition]++;
    t->condition = (uint8_t)condition;
    cfdp_notify(cfdp, t, CFDP_EVENT_FAULT);
    t->condition = before;
    if (handler == (uint8_t)CFDP_SUSPEND) {
        cfdp_suspend_transaction(cfdp, t);
    } else if (handler == (uint8_t)CFDP_ABANDON) {
        t->condition = (uint8_t)condition;
        t->incomplete = t->state != (uint8_t)CFDP_FINISHING;
        cfdp_end_transaction(cfdp, t, CFDP_EVENT_ABANDONED);
    } else if (handler != (uint8_t)CFDP_IGNORE || fatal) {
        cfdp_cancel_transaction(cfdp, t, condition);
    } else {
        t->tries = 0u;
    }
}

CfdpPdu cfdp_pdu(const Cfdp *cfdp, const CfdpTransaction *t, CfdpKind kind)
{
    return (CfdpPdu){.kind = (uint8_t)kind,
                     .source = t->id.source,
                     .sequence = t->id.sequence,
                     .destination = cfdp_receives(t) ? cfdp->set.entity : t->peer,
                     .to_sender = (uint8_t)cfdp_receives(t),
                     .unacknowledged = t->class1,
                     .crc = t->crc,
                     .large = t->large,
                     .entity_bytes = t->entity_bytes,
                     .sequence_bytes = t->sequence_bytes,
                     .condition = t->condition};
}

void cfdp_add_fault_location(const Cfdp *cfdp, const CfdpTransaction *t, CfdpPdu *pdu, uint8_t *bytes)
{
    if (t->condition != 0u && t->condition != (uint8_t)CFDP_UNSUPPORTED_CHECKSUM) {
        uint8_t entity[8];
        cfdp_put_number(entity, t->entity_bytes, cfdp->set.entity);
        pdu->n += cfdp_tlv_write(CFDP_TLV_ENTITY, entity, t->entity_bytes, bytes + pdu->n, 10);
    }
    pdu->data = bytes;
}

int cfdp_acknowledge(Cfdp *cfdp, const CfdpPdu *pdu, uint64_t peer, CfdpStatus status)
{
    if (pdu->unacknowledged != 0u) {
        return 1;
    }
    if (cfdp->live.answers_n == (uint32_t)CFDP_ANSWERS) {
        cfdp->live.faults[CCSDS_ROOM]++;
        return 0;
    }
    cfdp->live.answers[cfdp->live.answers_n++] = (CfdpAnswer){.id = {pdu->source, pdu->sequence},
                                                              .peer = peer,
                                                              .acknowledged = pdu->kind,
                                                              .condition = pdu->condition,
                                                              .status = (uint8_t)status,
                                                              .crc = pdu->crc,
                                                              .large = pdu->large,
                                                              .entity_bytes = pdu->entity_bytes,
                                                              .sequence_bytes = pdu->sequence_bytes};
    return 1;
}
