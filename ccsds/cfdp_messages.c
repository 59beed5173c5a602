/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

/* Make a file for an answer. Returns a handle. */
static int create_reply_file(const Cfdp *cfdp)
{
    const CfdpTransaction *place = cfdp_vacant(cfdp, 0u);
    char name[CFDP_NAME];
    if (place == NULL) {
        return CFDP_FULL;
    }
    cfdp_unfinished_name(cfdp, place, name);
    return cfdp->set.store.open(cfdp->set.store.user, name, CFDP_OPEN_NEW);
}

/* Answer a message with another one, and, if `to` is not empty, with the file of create_reply_file(). */
static void send_reply(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *answer, const char *to)
{
    const CfdpTransaction *place = cfdp_vacant(cfdp, 0u);
    char name[CFDP_NAME];
    uint8_t options[CFDP_OPTIONS];
    if (place == NULL) {
        return;
    }
    cfdp_unfinished_name(cfdp, place, name);
    const CfdpMessage origin = {.type = CFDP_ORIGIN,
                                .entity = t->id.source,
                                .sequence = t->id.sequence,
                                .entity_bytes = t->entity_bytes,
                                .sequence_bytes = t->sequence_bytes};
    size_t n = cfdp_message_write(answer, options, sizeof options);
    n += cfdp_message_write(&origin, options + n, sizeof options - n);
    const CfdpPut put = {.destination = t->peer,
                         .from = to[0] != '\0' ? name : "",
                         .to = to,
                         .options = options,
                         .options_n = n,
                         .class1 = t->class1,
                         .priority = t->priority};
    CfdpId id;
    if (cfdp_put(cfdp, &put, &id) >= 0) {
        cfdp_find(cfdp, id, 0)->created = 1u; /* the file is removed at the end */
    } else {
        (void)cfdp->set.store.remove(cfdp->set.store.user, name);
    }
}

typedef struct Listing {
    const CfdpStore *store;
    int file;
    uint64_t at;
} Listing;

static int write_line(void *to, const char *name)
{
    Listing *listing = to;
    const CfdpStore *store = listing->store;
    size_t n = 0u;
    while (n < (size_t)CFDP_ROOM && name[n] != '\0') {
        n++;
    }
    int result = store->write(store->user, listing->file, listing->at, (const uint8_t *)name, n);
    if (result >= 0) {
        result = store->write(store->user, listing->file, listing->at + n, (const uint8_t *)"\n", 1u);
    }
    listing->at += n + 1u;
    return result;
}

/* Send the list of a directory to the entity that requested it. */
static void send_listing(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *request)
{
    const CfdpStore *store = &cfdp->set.store;
    char directory[CFDP_NAME], to[CFDP_NAME];
    const int has_names =
        request->second.n != 0u && cfdp_copy_name(to, request->second) && cfdp_copy_name(directory, request->first);
    const int file = has_names ? create_reply_file(cfdp) : CFDP_REFUSED;
    int result = file;
    if (file >= 0) {
        Listing listing = {store, file, 0u};
        result = store->list(store->user, directory, write_line, &listing);
        store->close(store->user, file);
    }
    const CfdpMessage answer = {
        .type = CFDP_LISTED, .value = result < 0 ? 0x80u : 0u, .first = request->first, .second = request->second};
    send_reply(cfdp, t, &answer, result < 0 ? "" : to);
}

/* Write the report of a transaction. Returns below 0 if the store refuses. */
static int write_report(const Cfdp *cfdp, const CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    const int file = create_reply_file(cfdp);
    if (file < 0) {
        return file;
    }
    char text[128];
    char *end = cfdp_write_number(text, "progress ", t->progress, '\n');
    end = cfdp_write_number(end, "size ", t->size, '\n');
    end = cfdp_write_number(end, "state ", t->state, '\n');
    end = cfdp_write_number(end, "condition ", t->condition, '\n');
    end = cfdp_write_number(end, "suspended ", t->suspended, '\n');
    const int result = store->write(store->user, file, 0, (const uint8_t *)text, (size_t)(end - text));
    store->close(store->user, file);
    return result;
}

/* Suspend, resume or report a transaction for the entity at its other end, or for which it is done by proxy. */
static void control_transaction(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *request)
{
    const CfdpId id = {request->entity, request->sequence};
    CfdpTransaction *named = cfdp_find(cfdp, id, id.source != cfdp->set.entity);
    if (named == t ||
        (named != NULL && named->peer != t->peer && (named->proxy == 0u || named->origin.source != t->peer))) {
        named = NULL;
    }
    const uint32_t status = named != NULL ? CFDP_ACTIVE : cfdp_is_past(cfdp, id) ? CFDP_TERMINATED : CFDP_UNRECOGNIZED;
    CfdpMessage answer = *request; /* about the same transaction */
    char to[CFDP_NAME] = "";
    answer.type++;
    if (request->type == (uint8_t)CFDP_REMOTE_REPORT) {
        const int may_write = named != NULL && request->first.n != 0u && cfdp_copy_name(to, request->first);
        const int result = may_write ? write_report(cfdp, named) : CFDP_REFUSED;
        if (result < 0) {
            to[0] = '\0';
        }
        answer.value = (uint8_t)(status << 6 | (result < 0));
    } else {
        const int suspends = request->type == (uint8_t)CFDP_REMOTE_SUSPEND;
        if (named != NULL && named->condition == 0u && suspends != named->suspended) {
            (suspends ? cfdp_suspend_transaction : cfdp_resume_transaction)(cfdp, named);
        }
        answer.value = (uint8_t)((named != NULL && named->suspended != 0u ? 0x80u : 0u) | status << 5);
    }
    send_reply(cfdp, t, &answer, to);
}

/* What the messages of a transaction request. A message without its own type is not there. */
typedef struct Requests {
    CfdpMessage put;     ///< CFDP_PROXY_PUT
    CfdpMessage listing; ///< CFDP_LIST
    CfdpMessage remote;  ///< CFDP_REMOTE_...
    CfdpId origin;
    CfdpPut options; ///< of the proxy's transaction
    uint8_t tlvs[CFDP_OPTIONS];
    int cancels;
} Requests;

static void add_request(Requests *to, const CfdpMessage *message)
{
    static const uint8_t tlvs[] = {[CFDP_PROXY_MESSAGE] = CFDP_TLV_MESSAGE,
                                   [CFDP_PROXY_REQUEST] = CFDP_TLV_REQUEST,
                                   [CFDP_PROXY_HANDLER] = CFDP_TLV_HANDLER,
                                   [CFDP_PROXY_FLOW] = CFDP_TLV_FLOW};
    const int handler = message->type == (uint8_t)CFDP_PROXY_HANDLER;
    switch (message->type) {
    case CFDP_PROXY_PUT: to->put = *message; break;
    case CFDP_PROXY_MESSAGE:
    case CFDP_PROXY_REQUEST:
    case CFDP_PROXY_HANDLER:
    case CFDP_PROXY_FLOW:
        to->options.options_n += cfdp_tlv_write(tlvs[message->type], handler ? &message->value : message->first.bytes,
                                                handler ? 1u : message->first.n, to->tlvs + to->options.options_n,
                                                sizeof to->tlvs - to->options.options_n);
        break;
    case CFDP_PROXY_MODE: to->options.class1 = message->value & 1u; break;
    case CFDP_PROXY_CLOSURE: to->options.closure = message->value & 1u; break;
    case CFDP_ORIGIN: to->origin = (CfdpId){message->entity, message->sequence}; break;
    case CFDP_PROXY_CANCEL: to->cancels = 1; break;
    case CFDP_LIST: to->listing = *message; break;
    case CFDP_REMOTE_REPORT:
    case CFDP_REMOTE_SUSPEND:
    case CFDP_REMOTE_RESUME: to->remote = *message; break;
    default: break;
    }
}

static void put_by_proxy(Cfdp *cfdp, Requests *requests, int allowed)
{
    char from[CFDP_NAME], to[CFDP_NAME];
    CfdpPut *put = &requests->options;
    CfdpId id;
    put->destination = requests->put.entity;
    put->from = from;
    put->to = to;
    put->options = requests->tlvs;
    if (allowed && cfdp_copy_name(from, requests->put.first) && cfdp_copy_name(to, requests->put.second) &&
        cfdp_put(cfdp, put, &id) >= 0) {
        CfdpTransaction *t = cfdp_find(cfdp, id, 0);
        t->proxy = 1u;
        t->origin = requests->origin;
    } else {
        cfdp_answer_proxy(cfdp, requests->origin, CFDP_FILESTORE_REJECTION << 4 | 1 << 2 | CFDP_REJECTED);
    }
}

void cfdp_serve_messages(Cfdp *cfdp, const CfdpTransaction *t)
{
    const uint8_t allowed = cfdp_peer(cfdp, t->peer)->allowed, *at = t->options;
    const CfdpMessage none = {.type = CFDP_ORIGIN};
    Requests requests = {.put = none,
                         .listing = none,
                         .remote = none,
                         .origin = t->id,
                         .options = {.class1 = t->class1, .priority = t->priority}};
    CfdpMessage message;
    CfdpTlv tlv;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_MESSAGE) {
            cfdp_notify_text(cfdp, t, CFDP_EVENT_MESSAGE, tlv.value);
            if (cfdp_message_read(&message, &tlv) == CCSDS_OK) {
                add_request(&requests, &message);
            }
        }
    }
    if (requests.put.type == (uint8_t)CFDP_PROXY_PUT) {
        put_by_proxy(cfdp, &requests, (allowed & CFDP_ALLOW_PROXY) != 0u);
    }
    if (requests.listing.type == (uint8_t)CFDP_LIST && (allowed & CFDP_ALLOW_LIST) != 0u) {
        send_listing(cfdp, t, &requests.listing);
    }
    if (requests.remote.type != (uint8_t)CFDP_ORIGIN && (allowed & CFDP_ALLOW_REMOTE) != 0u) {
        control_transaction(cfdp, t, &requests.remote);
    }
    for (uint32_t i = 0u; requests.cancels && i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *other = &cfdp->set.transactions[i];
        if (other->state != (uint8_t)CFDP_FREE && !cfdp_receives(other) && other->proxy != 0u &&
            other->condition == 0u && other->origin.source == t->id.source &&
            other->origin.sequence == requests.origin.sequence) {
            cfdp_cancel_transaction(cfdp, other, CFDP_CANCEL_REQUEST);
        }
    }
}
