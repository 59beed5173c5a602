/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp.h"

#include <string.h>

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

static const char own[] = ".cfdp"; /* the names of unfinished files begin so, and no file of a remote entity */

/* ---- small things */

static int64_t after(const Cfdp *cfdp, int64_t timer)
{
    return timer <= 0 || cfdp->live.now > INT64_MAX - timer ? INT64_MAX : cfdp->live.now + timer;
}

static CfdpRemote *remote_of(const Cfdp *cfdp, uint64_t entity)
{
    for (uint32_t i = 0u; i < cfdp->set.remotes_n; i++) {
        if (cfdp->set.remotes[i].entity == entity) {
            return &cfdp->set.remotes[i];
        }
    }
    return NULL;
}

static int receives(const CfdpTransaction *t)
{
    return t->state >= (uint8_t)CFDP_RECEIVING;
}

static CfdpTransaction *find(const Cfdp *cfdp, CfdpId id, int receiver)
{
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        if (t->state != (uint8_t)CFDP_FREE && receives(t) == receiver && t->id.source == id.source &&
            t->id.sequence == id.sequence) {
            return t;
        }
    }
    return NULL;
}

/* A place, if there are more than those that are kept. */
static CfdpTransaction *vacant(const Cfdp *cfdp, uint32_t kept)
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

static int is_past(const Cfdp *cfdp, CfdpId id)
{
    for (uint32_t i = 0u; i < cfdp->set.past_n; i++) {
        const CfdpPast *one = &cfdp->set.past[i];
        if (one->used != 0u && one->id.source == id.source && one->id.sequence == id.sequence) {
            return 1;
        }
    }
    return 0;
}

static CfdpText text_of(const char *name)
{
    CfdpText text = {(const uint8_t *)name, 0u};
    while (name[text.n] != '\0' && text.n < 255u) {
        text.n++;
    }
    return text;
}

/* A name from outside. Returns 0 if it is too long, has a NUL, or is that of an unfinished file. */
static int copy_name(char *to, CfdpText name)
{
    to[0] = '\0';
    if (name.n >= (uint8_t)CFDP_NAME || (name.n >= sizeof own - 1 && memcmp(name.bytes, own, sizeof own - 1) == 0)) {
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

/* A word, a number and an end, behind a text. Returns where they end. */
static char *write_number(char *to, const char *word, uint64_t number, char end)
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

/* The name of a transaction's unfinished file: that of its place, so that a reset leaves no more files than places. */
static void own_name(const Cfdp *cfdp, const CfdpTransaction *t, char name[CFDP_NAME])
{
    (void)write_number(name, own, (uint64_t)(t - cfdp->set.transactions), '\0');
}

static CfdpEvent event_of(const CfdpTransaction *t, CfdpTold what)
{
    return (CfdpEvent){.what = what,
                       .id = t->id,
                       .peer = t->peer,
                       .progress = t->progress,
                       .size = t->size,
                       .from = t->from,
                       .to = t->to,
                       .receiver = (uint8_t)receives(t),
                       .condition = t->condition,
                       .incomplete = t->incomplete,
                       .file_status = t->file_status};
}

static void tell_text(Cfdp *cfdp, const CfdpTransaction *t, CfdpTold what, CfdpText text)
{
    CfdpEvent event = event_of(t, what);
    event.text = text;
    cfdp->set.tell(cfdp->set.user, &event);
}

static void tell(Cfdp *cfdp, const CfdpTransaction *t, CfdpTold what)
{
    tell_text(cfdp, t, what, (CfdpText){NULL, 0u});
}

/* ---- ranges: sorted, apart from one another */

static CfdpRange *ranges_of(const Cfdp *cfdp, const CfdpTransaction *t)
{
    return cfdp->set.ranges + (size_t)(t - cfdp->set.transactions) * cfdp->set.ranges_n + t->first;
}

/* The first range that ends behind an offset. */
static uint32_t range_at(const CfdpRange *ranges, uint32_t n, uint64_t offset)
{
    uint32_t low = 0u;
    while (low < n) {
        const uint32_t middle = low + (n - low) / 2u;
        if (ranges[middle].end > offset) {
            n = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

/* Ranges are filled from the front: that moves none. */
static void remove_range(CfdpTransaction *t, CfdpRange *ranges, uint32_t i)
{
    t->ranges--;
    if (i == 0u) {
        t->first++;
    } else {
        memmove(ranges + i, ranges + i + 1, (t->ranges - i) * sizeof *ranges);
    }
}

static int full(const Cfdp *cfdp, const CfdpTransaction *t)
{
    return t->ranges == cfdp->set.ranges_n;
}

/* There is room for it. */
static void insert_range(const Cfdp *cfdp, CfdpTransaction *t, uint32_t i, CfdpRange one)
{
    CfdpRange *ranges = ranges_of(cfdp, t);
    if (t->first + t->ranges == cfdp->set.ranges_n) {
        memmove(ranges - t->first, ranges, t->ranges * sizeof *ranges);
        ranges -= t->first;
        t->first = 0u;
    }
    memmove(ranges + i + 1, ranges + i, (t->ranges - i) * sizeof *ranges);
    ranges[i] = one;
    t->ranges++;
}

/* Add what is to be sent again. What there is no room for is left out: the receiver asks again. */
static void add_range(const Cfdp *cfdp, CfdpTransaction *t, CfdpRange one)
{
    CfdpRange *ranges = ranges_of(cfdp, t);
    const uint32_t i = range_at(ranges, t->ranges, one.begin == 0 ? 0 : one.begin - 1); /* also one that ends there */
    if (i == t->ranges || ranges[i].begin > one.end) {
        if (!full(cfdp, t)) {
            insert_range(cfdp, t, i, one);
        }
        return;
    }
    ranges[i].begin = one.begin < ranges[i].begin ? one.begin : ranges[i].begin;
    while (i + 1u < t->ranges && ranges[i + 1u].begin <= one.end) {
        ranges[i].end = ranges[i + 1u].end;
        remove_range(t, ranges, i + 1u);
    }
    ranges[i].end = one.end > ranges[i].end ? one.end : ranges[i].end;
}

/* ---- the end of a transaction, and faults */

static void close_file(Cfdp *cfdp, CfdpTransaction *t)
{
    if (t->file >= 0) {
        cfdp->set.store.close(cfdp->set.store.user, t->file);
    }
    t->file = -1;
}

/* The file that is read, or received. Returns below 0 if the store refuses. */
static int open_file(Cfdp *cfdp, CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    if (t->file < 0) {
        char name[CFDP_NAME];
        own_name(cfdp, t, name);
        if (receives(t)) {
            t->file = store->open(store->user, name, t->created ? CFDP_OPEN_WRITE : CFDP_OPEN_NEW);
            t->created = t->created || t->file >= 0;
        } else {
            t->file = store->open(store->user, t->from, CFDP_OPEN_READ);
        }
    }
    return t->file;
}

static void discard(Cfdp *cfdp, CfdpTransaction *t)
{
    char name[CFDP_NAME];
    close_file(cfdp, t);
    if (t->created != 0u) {
        own_name(cfdp, t, name);
        (void)cfdp->set.store.remove(cfdp->set.store.user, name);
        t->created = 0u;
    }
}

/* Answer a transaction that asked by proxy, with messages alone. */
static void answer_origin(Cfdp *cfdp, CfdpId origin, uint8_t value)
{
    uint8_t options[64];
    const CfdpMessage response = {.type = CFDP_PROXY_PUT_RESPONSE, .value = value};
    const CfdpMessage asked = {.type = CFDP_ORIGIN,
                               .entity = origin.source,
                               .sequence = origin.sequence,
                               .entity_bytes = 8u,
                               .sequence_bytes = 8u};
    size_t n = cfdp_message_write(&response, options, sizeof options);
    n += cfdp_message_write(&asked, options + n, sizeof options - n);
    const CfdpPut put = {.destination = origin.source, .from = "", .to = "", .options = options, .options_n = n};
    CfdpId id;
    (void)cfdp_put(cfdp, &put, &id);
}

static void end(Cfdp *cfdp, CfdpTransaction *t, CfdpTold what)
{
    const CfdpId origin = t->origin;
    const int proxy = t->proxy;
    const uint32_t value = (uint32_t)t->condition << 4 | (uint32_t)t->incomplete << 2 | t->file_status;
    discard(cfdp, t); /* a delivered file has another name already */
    if (cfdp->set.past_n != 0u) {
        cfdp->set.past[cfdp->live.past] = (CfdpPast){t->id, 1u};
        cfdp->live.past = (cfdp->live.past + 1u) % cfdp->set.past_n;
    }
    const CfdpEvent event = event_of(t, what);
    t->state = CFDP_FREE; /* so that the user may put the next */
    cfdp->set.tell(cfdp->set.user, &event);
    if (proxy) {
        answer_origin(cfdp, origin, (uint8_t)value);
    }
}

/* End a transaction for a reason that is known here, and tell the other end. */
static void cancel(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition)
{
    const int again = t->condition != 0u || t->state == (uint8_t)CFDP_FINISHING;
    t->condition = t->condition != 0u ? t->condition : (uint8_t)condition;
    t->suspended = 0u;
    t->tries = 0u;
    t->expires = INT64_MAX;
    t->ranges = 0u;
    if (again) { /* the other end does not answer */
        end(cfdp, t, CFDP_TOLD_ENDED);
    } else if (!receives(t)) {
        t->state = CFDP_SENT;
        t->incomplete = 1u;
        t->due = DUE_EOF;
    } else {
        discard(cfdp, t);
        t->incomplete = 1u;
        t->file_status = condition == CFDP_FILESTORE_REJECTION ? CFDP_REJECTED : CFDP_DISCARDED;
        t->state = CFDP_FINISHING;
        t->due = DUE_FINISHED;
        if (t->class1 != 0u && t->closure == 0u) {
            end(cfdp, t, CFDP_TOLD_ENDED);
        }
    }
}

static void suspend(Cfdp *cfdp, CfdpTransaction *t)
{
    t->suspended = 1u;
    tell(cfdp, t, CFDP_TOLD_SUSPENDED);
}

static int missing(const CfdpTransaction *t)
{
    return t->metadata == 0u || t->ranges != 0u || (t->eof != 0u && t->progress < t->size);
}

static void resume(Cfdp *cfdp, CfdpTransaction *t)
{
    t->suspended = 0u;
    tell(cfdp, t, CFDP_TOLD_RESUMED);
    if (t->state == (uint8_t)CFDP_RECEIVING && t->class1 == 0u && missing(t)) {
        t->asked = 0;
        t->due |= DUE_NAK;
    }
}

static void fault(Cfdp *cfdp, CfdpTransaction *t, CfdpCondition condition)
{
    const uint8_t before = t->condition;
    const int fatal = condition == CFDP_CHECKSUM_FAILURE || condition == CFDP_SIZE_ERROR ||
                      condition == CFDP_FILESTORE_REJECTION || condition == CFDP_UNSUPPORTED_CHECKSUM;
    uint8_t handler = t->handlers[condition];
    if (t->suspended != 0u) {
        return; /* the user knows */
    }
    if (handler == 0u) {
        handler = remote_of(cfdp, t->peer)->handlers[condition];
    }
    if (before != 0u && handler != (uint8_t)CFDP_ABANDON) {
        handler = CFDP_CANCEL; /* it ends already */
    }
    cfdp->live.conditions[condition]++;
    t->condition = (uint8_t)condition;
    tell(cfdp, t, CFDP_TOLD_FAULT);
    t->condition = before;
    if (handler == (uint8_t)CFDP_SUSPEND) {
        suspend(cfdp, t);
    } else if (handler == (uint8_t)CFDP_ABANDON) {
        t->condition = (uint8_t)condition;
        t->incomplete = t->state != (uint8_t)CFDP_FINISHING;
        end(cfdp, t, CFDP_TOLD_ABANDONED);
    } else if (handler != (uint8_t)CFDP_IGNORE || fatal) {
        cancel(cfdp, t, condition);
    } else {
        t->tries = 0u;
    }
}

/* ---- delivery */

/* Append a file to one that is open. */
static int copy(Cfdp *cfdp, const char *name, int to, uint64_t *at)
{
    const CfdpStore *store = &cfdp->set.store;
    const int from = store->open(store->user, name, CFDP_OPEN_READ);
    if (from < 0) {
        return from;
    }
    const int64_t size = store->size(store->user, from);
    int result = size < 0 ? CFDP_BROKEN : 0;
    for (int64_t done = 0; done < size && result >= 0;) {
        const uint64_t left = (uint64_t)(size - done);
        const size_t n = left < cfdp->set.work_n ? (size_t)left : cfdp->set.work_n;
        result = store->read(store->user, from, (uint64_t)done, cfdp->set.work, n);
        if (result >= 0) {
            result = store->write(store->user, to, *at, cfdp->set.work, n);
        }
        done += (int64_t)n;
        *at += n;
    }
    store->close(store->user, from);
    return result;
}

static int exists(const CfdpStore *store, const char *name)
{
    const int file = store->open(store->user, name, CFDP_OPEN_READ);
    if (file >= 0) {
        store->close(store->user, file);
    }
    return file >= 0 ? 1 : file == CFDP_ABSENT ? 0 : file;
}

/* What a remote entity asks of the store. Returns the status of the response (727.0-B-5, table 5-18). */
static uint8_t perform(Cfdp *cfdp, const CfdpTransaction *t, const CfdpFilestore *one)
{
    static const uint8_t refused[] = {1, 2, 3, 3, 3, 1, 2, 2, 2};
    const CfdpStore *store = &cfdp->set.store;
    char first[CFDP_NAME], second[CFDP_NAME], made[CFDP_NAME];
    int result = CFDP_REFUSED;
    if ((remote_of(cfdp, t->peer)->allowed & CFDP_ALLOW_FILESTORE) == 0u || !copy_name(first, one->first) ||
        !copy_name(second, one->second)) {
        return refused[one->action];
    }
    const int is = exists(store, first), other = exists(store, second);
    switch (one->action) {
    case CFDP_CREATE_FILE:
        result = is == 0 ? store->open(store->user, first, CFDP_OPEN_NEW) : CFDP_REFUSED;
        if (result >= 0) {
            store->close(store->user, result);
        }
        break;
    case CFDP_DELETE_FILE:
    case CFDP_DENY_FILE: result = store->remove(store->user, first); break;
    case CFDP_RENAME_FILE:
        if (is == 1 && other == 1) {
            return 2u;
        }
        result = is == 1 && other == 0 ? store->rename(store->user, first, second)
                 : is == 0             ? CFDP_ABSENT
                                       : CFDP_REFUSED;
        break;
    case CFDP_APPEND_FILE:
    case CFDP_REPLACE_FILE:
        if (is == 1 && other == 0) {
            return 2u;
        }
        result = is == 0 ? CFDP_ABSENT : CFDP_REFUSED;
        if (is == 1 && other == 1) { /* whole or not at all */
            own_name(cfdp, t, made);
            const int file = store->open(store->user, made, CFDP_OPEN_NEW);
            uint64_t at = 0;
            result = file;
            if (file >= 0) {
                result = one->action == (uint8_t)CFDP_APPEND_FILE ? copy(cfdp, first, file, &at) : 0;
                result = result >= 0 ? copy(cfdp, second, file, &at) : result;
                store->close(store->user, file);
                result = result >= 0 ? store->rename(store->user, made, first) : result;
                if (result < 0) {
                    (void)store->remove(store->user, made);
                    result = CFDP_REFUSED;
                }
            }
        }
        break;
    case CFDP_CREATE_DIRECTORY: result = store->make_directory(store->user, first); break;
    default: /* CFDP_REMOVE_DIRECTORY, CFDP_DENY_DIRECTORY */
        result = store->remove_directory(store->user, first);
        break;
    }
    const int deny = one->action == (uint8_t)CFDP_DENY_FILE || one->action == (uint8_t)CFDP_DENY_DIRECTORY;
    return result >= 0 || (deny && result == CFDP_ABSENT) ? 0u : result == CFDP_ABSENT ? 1u : refused[one->action];
}

/* Make a file for an answer. Returns a handle. */
static int make(const Cfdp *cfdp)
{
    const CfdpTransaction *place = vacant(cfdp, 0u);
    char name[CFDP_NAME];
    if (place == NULL) {
        return CFDP_FULL;
    }
    own_name(cfdp, place, name);
    return cfdp->set.store.open(cfdp->set.store.user, name, CFDP_OPEN_NEW);
}

/* Answer a message with another one, and, where `to` names one, with the file that was made. */
static void reply(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *answer, const char *to)
{
    const CfdpTransaction *place = vacant(cfdp, 0u);
    char name[CFDP_NAME];
    uint8_t options[CFDP_OPTIONS];
    if (place == NULL) {
        return;
    }
    own_name(cfdp, place, name);
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
        find(cfdp, id, 0)->created = 1u; /* the file is removed at the end */
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

/* Send the list of a directory to the entity that asks. */
static void list(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *asked)
{
    const CfdpStore *store = &cfdp->set.store;
    char directory[CFDP_NAME], to[CFDP_NAME];
    const int named = asked->second.n != 0u && copy_name(to, asked->second) && copy_name(directory, asked->first);
    const int file = named ? make(cfdp) : CFDP_REFUSED;
    int result = file;
    if (file >= 0) {
        Listing listing = {store, file, 0u};
        result = store->list(store->user, directory, write_line, &listing);
        store->close(store->user, file);
    }
    const CfdpMessage listed = {
        .type = CFDP_LISTED, .value = result < 0 ? 0x80u : 0u, .first = asked->first, .second = asked->second};
    reply(cfdp, t, &listed, result < 0 ? "" : to);
}

/* Suspend, resume or report a transaction for the entity at its other end, or for which it is done by proxy. */
static void control(Cfdp *cfdp, const CfdpTransaction *t, const CfdpMessage *asked)
{
    const CfdpStore *store = &cfdp->set.store;
    const CfdpId id = {asked->entity, asked->sequence};
    CfdpTransaction *one = find(cfdp, id, id.source != cfdp->set.entity);
    if (one == t || (one != NULL && one->peer != t->peer && (one->proxy == 0u || one->origin.source != t->peer))) {
        one = NULL;
    }
    const uint32_t status = one != NULL ? CFDP_ACTIVE : is_past(cfdp, id) ? CFDP_TERMINATED : CFDP_UNRECOGNIZED;
    CfdpMessage answer = *asked; /* about the same transaction */
    char to[CFDP_NAME] = "";
    answer.type++;
    if (asked->type == (uint8_t)CFDP_REMOTE_REPORT) {
        const int named = one != NULL && asked->first.n != 0u && copy_name(to, asked->first);
        const int file = named ? make(cfdp) : CFDP_REFUSED;
        int result = file;
        if (file >= 0) {
            char text[128];
            char *end = write_number(text, "progress ", one->progress, '\n');
            end = write_number(end, "size ", one->size, '\n');
            end = write_number(end, "state ", one->state, '\n');
            end = write_number(end, "condition ", one->condition, '\n');
            end = write_number(end, "suspended ", one->suspended, '\n');
            result = store->write(store->user, file, 0, (const uint8_t *)text, (size_t)(end - text));
            store->close(store->user, file);
        }
        if (result < 0) {
            to[0] = '\0';
        }
        answer.value = (uint8_t)(status << 6 | (result < 0));
    } else {
        const int suspends = asked->type == (uint8_t)CFDP_REMOTE_SUSPEND;
        if (one != NULL && one->condition == 0u && suspends != one->suspended) {
            (suspends ? suspend : resume)(cfdp, one);
        }
        answer.value = (uint8_t)((one != NULL && one->suspended != 0u ? 0x80u : 0u) | status << 5);
    }
    reply(cfdp, t, &answer, to);
}

/* The messages of a delivered transaction: the user has them all, those of proxies and directories are done here. */
static void serve(Cfdp *cfdp, const CfdpTransaction *t)
{
    const uint8_t allowed = remote_of(cfdp, t->peer)->allowed, *at = t->options;
    CfdpMessage message, wanted = {.type = CFDP_ORIGIN}, listing = wanted, remote = wanted;
    CfdpId origin = t->id;
    CfdpPut put = {.class1 = t->class1, .priority = t->priority};
    CfdpTlv tlv;
    uint8_t options[CFDP_OPTIONS];
    int cancels = 0;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type != (uint8_t)CFDP_TLV_MESSAGE) {
            continue;
        }
        tell_text(cfdp, t, CFDP_TOLD_MESSAGE, tlv.value);
        if (cfdp_message_read(&message, &tlv) != CCSDS_OK) {
            continue;
        }
        uint8_t *rest = options + put.options_n;
        const size_t room = sizeof options - put.options_n;
        switch (message.type) {
        case CFDP_PROXY_PUT: wanted = message; break;
        case CFDP_PROXY_MESSAGE:
            put.options_n += cfdp_tlv_write(CFDP_TLV_MESSAGE, message.first.bytes, message.first.n, rest, room);
            break;
        case CFDP_PROXY_REQUEST:
            put.options_n += cfdp_tlv_write(CFDP_TLV_REQUEST, message.first.bytes, message.first.n, rest, room);
            break;
        case CFDP_PROXY_HANDLER:
            put.options_n += cfdp_tlv_write(CFDP_TLV_HANDLER, &message.value, 1, rest, room);
            break;
        case CFDP_PROXY_FLOW:
            put.options_n += cfdp_tlv_write(CFDP_TLV_FLOW, message.first.bytes, message.first.n, rest, room);
            break;
        case CFDP_PROXY_MODE: put.class1 = message.value & 1u; break;
        case CFDP_PROXY_CLOSURE: put.closure = message.value & 1u; break;
        case CFDP_ORIGIN: origin = (CfdpId){message.entity, message.sequence}; break;
        case CFDP_PROXY_CANCEL: cancels = 1; break;
        case CFDP_LIST: listing = message; break;
        case CFDP_REMOTE_REPORT:
        case CFDP_REMOTE_SUSPEND:
        case CFDP_REMOTE_RESUME: remote = message; break;
        default: break;
        }
    }
    if (wanted.type == (uint8_t)CFDP_PROXY_PUT) {
        char from[CFDP_NAME], to[CFDP_NAME];
        CfdpId id;
        put.destination = wanted.entity;
        put.from = from;
        put.to = to;
        put.options = options;
        if ((allowed & CFDP_ALLOW_PROXY) != 0u && copy_name(from, wanted.first) && copy_name(to, wanted.second) &&
            cfdp_put(cfdp, &put, &id) >= 0) {
            CfdpTransaction *made = find(cfdp, id, 0);
            made->proxy = 1u;
            made->origin = origin;
        } else {
            answer_origin(cfdp, origin, CFDP_FILESTORE_REJECTION << 4 | 1 << 2 | CFDP_REJECTED);
        }
    }
    if (listing.type == (uint8_t)CFDP_LIST && (allowed & CFDP_ALLOW_LIST) != 0u) {
        list(cfdp, t, &listing);
    }
    if (remote.type != (uint8_t)CFDP_ORIGIN && (allowed & CFDP_ALLOW_REMOTE) != 0u) {
        control(cfdp, t, &remote);
    }
    for (uint32_t i = 0u; cancels && i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *one = &cfdp->set.transactions[i];
        if (one->state != (uint8_t)CFDP_FREE && !receives(one) && one->proxy != 0u && one->condition == 0u &&
            one->origin.source == t->id.source && one->origin.sequence == origin.sequence) {
            cancel(cfdp, one, CFDP_CANCEL_REQUEST);
        }
    }
}

/* All is there. */
static void deliver(Cfdp *cfdp, CfdpTransaction *t)
{
    const CfdpStore *store = &cfdp->set.store;
    if (t->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM && t->sum != t->checksum) {
        fault(cfdp, t, CFDP_CHECKSUM_FAILURE);
        return;
    }
    t->file_status = CFDP_UNREPORTED;
    if (t->to[0] != '\0') {
        char name[CFDP_NAME];
        own_name(cfdp, t, name);
        if (open_file(cfdp, t) < 0) {
            fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        close_file(cfdp, t);
        if (store->rename(store->user, name, t->to) < 0) {
            fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        t->file_status = CFDP_RETAINED;
    }
    discard(cfdp, t);
    t->state = CFDP_FINISHING;
    t->incomplete = 0u;
    t->due = DUE_FINISHED;
    t->tries = 0u;
    CfdpTlv tlv;
    CfdpFilestore one;
    const uint8_t *at = t->options;
    int failed = 0;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST && cfdp_filestore_read(&one, &tlv) == CCSDS_OK) {
            const uint8_t status = failed ? (uint8_t)CFDP_NOT_PERFORMED : perform(cfdp, t, &one);
            t->results[t->results_n++] = status;
            failed = failed || status != 0u;
        }
    }
    serve(cfdp, t);
    if (t->class1 != 0u && t->closure == 0u) {
        end(cfdp, t, CFDP_TOLD_ENDED);
    }
}

/* Go on with the checksum, by a part of the file if `read`. */
static void check(Cfdp *cfdp, CfdpTransaction *t, int read)
{
    const CfdpStore *store = &cfdp->set.store;
    const int whole = t->state == (uint8_t)CFDP_CHECKING;
    const uint64_t solid = t->ranges != 0u ? ranges_of(cfdp, t)[0].begin : t->progress;
    if (t->metadata != 0u && t->ordered == 0u) {
        t->checked = solid;
    }
    if (read && t->metadata != 0u && t->checked < solid) {
        const uint64_t left = solid - t->checked;
        const size_t n = left < cfdp->set.work_n ? (size_t)left : cfdp->set.work_n;
        if (open_file(cfdp, t) < 0 || store->read(store->user, t->file, t->checked, cfdp->set.work, n) < 0) {
            fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            return;
        }
        t->sum = cfdp_checksum(t->checksum_type, t->sum, t->checked, cfdp->set.work, n);
        t->checked += n;
    }
    if (whole && t->checked == t->size) {
        deliver(cfdp, t);
    }
}

/* ---- receiving */

/* Something came: is all there? */
static void step(Cfdp *cfdp, CfdpTransaction *t)
{
    if (t->state != (uint8_t)CFDP_RECEIVING || t->suspended != 0u || t->eof == 0u) {
        return;
    }
    if (t->progress > t->size) {
        fault(cfdp, t, CFDP_SIZE_ERROR);
    } else if (!missing(t)) {
        t->state = CFDP_CHECKING;
        t->due = 0u;
        t->expires = INT64_MAX;
        check(cfdp, t, 0);
    } else if (t->class1 != 0u && t->expires == INT64_MAX) {
        t->expires = after(cfdp, remote_of(cfdp, t->peer)->check_timer);
    }
}

/* Write new bytes of the file. Returns 0 if the store refuses. */
static int keep(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const uint8_t *data, CfdpRange one)
{
    const CfdpStore *store = &cfdp->set.store;
    const size_t n = (size_t)(one.end - one.begin);
    if (open_file(cfdp, t) < 0 || store->write(store->user, t->file, one.begin, data, n) < 0) {
        fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return 0;
    }
    if (t->metadata != 0u && (t->ordered == 0u || one.begin == t->checked)) { /* as it is at hand */
        t->sum = cfdp_checksum(t->checksum_type, t->sum, one.begin, data, n);
        t->checked = one.end;
    }
    if (t->eof != 0u && t->class1 == 0u) { /* the NAK works */
        t->tries = 0u;
        if (t->expires != INT64_MAX) {
            t->expires = after(cfdp, remote->nak_timer);
        }
    }
    return 1;
}

/* Data that cannot be noted is dropped; what is known to be missing is asked for, to make room. */
static void no_room(Cfdp *cfdp, CfdpTransaction *t)
{
    cfdp->live.faults[CCSDS_ROOM]++;
    if (t->class1 == 0u && t->expires == INT64_MAX && t->due == 0u) {
        t->asked = 0;
        t->due = DUE_NAK;
    }
}

static void take_data(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, const CfdpPdu *pdu)
{
    const uint64_t limit = t->eof != 0u || (t->metadata != 0u && t->size != 0u) ? t->size : UINT64_MAX >> 1;
    uint64_t at = pdu->offset;
    if (t->state != (uint8_t)CFDP_RECEIVING || pdu->n == 0) {
        return;
    }
    if (pdu->offset > limit || pdu->n > limit - pdu->offset) {
        fault(cfdp, t, CFDP_SIZE_ERROR);
        return;
    }
    const uint64_t stop = pdu->offset + pdu->n;
    while (at < stop) {
        CfdpRange one = {at, stop};
        const uint8_t *data = pdu->data + (at - pdu->offset);
        if (at >= t->progress) { /* behind all that came */
            const int gap = at > t->progress;
            if (gap && full(cfdp, t)) {
                no_room(cfdp, t);
                return;
            }
            if (!keep(cfdp, t, remote, data, one)) {
                return;
            }
            if (gap) {
                insert_range(cfdp, t, t->ranges, (CfdpRange){t->progress, at});
                if (remote->immediate != 0u && t->class1 == 0u) {
                    t->due |= DUE_NAK;
                }
            }
            t->progress = stop;
            break;
        }
        CfdpRange *ranges = ranges_of(cfdp, t);
        const uint32_t i = range_at(ranges, t->ranges, at);
        const CfdpRange gap = i < t->ranges ? ranges[i] : (CfdpRange){t->progress, t->progress};
        if (gap.begin > at || i == t->ranges) { /* came before */
            at = gap.begin;
            continue;
        }
        one.end = stop < gap.end ? stop : gap.end;
        if (one.begin != gap.begin && one.end != gap.end && full(cfdp, t)) {
            no_room(cfdp, t);
            return;
        }
        if (!keep(cfdp, t, remote, data, one)) {
            return;
        }
        if (one.begin == gap.begin && one.end == gap.end) {
            remove_range(t, ranges, i);
        } else if (one.begin == gap.begin) {
            ranges[i].begin = one.end;
        } else {
            ranges[i].end = one.begin;
            if (one.end != gap.end) {
                insert_range(cfdp, t, i + 1u, (CfdpRange){one.end, gap.end});
            }
        }
        at = one.end;
    }
    if (t->metadata == 0u && remote->immediate != 0u && t->class1 == 0u && t->expires == INT64_MAX) {
        t->due |= DUE_NAK;
    }
    step(cfdp, t);
}

static void take_metadata(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    CfdpTlv tlv;
    CfdpFilestore one;
    const uint8_t *at = pdu->data;
    uint32_t requests = 0u;
    if (t->state != (uint8_t)CFDP_RECEIVING || t->metadata != 0u) {
        return;
    }
    for (size_t n = pdu->n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST) {
            requests += cfdp_filestore_read(&one, &tlv) == CCSDS_OK ? 1u : (uint32_t)CFDP_REQUESTS + 1u;
        } else if (tlv.type == (uint8_t)CFDP_TLV_HANDLER && tlv.value.n == 1u) {
            t->handlers[tlv.value.bytes[0] >> 4] = tlv.value.bytes[0] & 15u;
        }
    }
    (void)copy_name(t->from, pdu->from);
    if (!copy_name(t->to, pdu->to) || (pdu->to.n == 0u) != (pdu->from.n == 0u) || pdu->n > (size_t)CFDP_OPTIONS ||
        requests > (uint32_t)CFDP_REQUESTS) {
        fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return;
    }
    if (pdu->checksum_type != (uint8_t)CFDP_MODULAR && pdu->checksum_type != (uint8_t)CFDP_CRC32 &&
        pdu->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM) {
        fault(cfdp, t, CFDP_UNSUPPORTED_CHECKSUM);
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
    tell(cfdp, t, CFDP_TOLD_STARTED);
    step(cfdp, t);
}

/* Note an acknowledgement. Returns 0 if there is no room: the PDU counts as not received. */
static int acknowledge(Cfdp *cfdp, const CfdpPdu *pdu, uint64_t peer, CfdpStatus status)
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

static void take_eof(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    if (!acknowledge(cfdp, pdu, t->peer, CFDP_ACTIVE) || t->state != (uint8_t)CFDP_RECEIVING) {
        return;
    }
    if (pdu->condition != (uint8_t)CFDP_NO_ERROR) {
        t->condition = pdu->condition;
        t->incomplete = 1u;
        end(cfdp, t, CFDP_TOLD_ENDED);
    } else if (t->eof == 0u) {
        t->eof = 1u;
        t->size = pdu->offset;
        t->checksum = pdu->checksum;
        t->tries = 0u;
        if (t->class1 == 0u && missing(t)) {
            t->due |= DUE_NAK;
        }
        step(cfdp, t);
    }
}

/* Where there is no place: that of what is received and has been silent longest, for longer than what is missing takes
 * to be asked for. So transactions that begin and say no more, as others may forge them, keep no file away for long. */
static CfdpTransaction *give_up(Cfdp *cfdp)
{
    CfdpTransaction *found = NULL;
    int64_t longest = 0;
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        if (t->state == (uint8_t)CFDP_FREE || !receives(t) || t->suspended != 0u || t->inactive == INT64_MAX) {
            continue;
        }
        const CfdpRemote *remote = remote_of(cfdp, t->peer);
        const int64_t silent = cfdp->live.now - (t->inactive - remote->inactivity);
        if (remote->frozen == 0u && silent > 2 * remote->nak_timer && silent > longest) {
            found = t;
            longest = silent;
        }
    }
    if (found != NULL) {
        if (found->state != (uint8_t)CFDP_FINISHING) {
            found->condition = CFDP_INACTIVITY;
            found->incomplete = 1u;
            cfdp->live.conditions[CFDP_INACTIVITY]++;
        }
        end(cfdp, found, CFDP_TOLD_ENDED);
    }
    return found != NULL && found->state == (uint8_t)CFDP_FREE ? found : NULL; /* the user may have put the next */
}

static CfdpTransaction *begin_receiver(Cfdp *cfdp, const CfdpPdu *pdu, const CfdpRemote *remote)
{
    CfdpTransaction *t = vacant(cfdp, cfdp->set.kept);
    if (t == NULL) {
        t = give_up(cfdp);
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
    t->keep_alive = after(cfdp, remote->keep_alive);
    return t;
}

/* ---- sending */

static void take_nak(const Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    const size_t wide = cfdp_wide(pdu->large);
    for (size_t i = 0; i < pdu->n && t->condition == 0u; i += 2 * wide) {
        CfdpRange one = {cfdp_get(pdu->data + i, wide), cfdp_get(pdu->data + i + wide, wide)};
        if (one.end == 0) {
            t->due |= DUE_METADATA;
        }
        one.end = one.end < t->progress ? one.end : t->progress; /* the rest comes anyway */
        if (one.begin < one.end) {
            add_range(cfdp, t, one);
        }
    }
}

static void take_finished(Cfdp *cfdp, CfdpTransaction *t, const CfdpPdu *pdu)
{
    CfdpTlv tlv;
    const uint8_t *at = pdu->data;
    if (!acknowledge(cfdp, pdu, t->peer, CFDP_TERMINATED)) {
        return;
    }
    t->condition = t->condition != 0u ? t->condition : pdu->condition;
    t->incomplete = pdu->incomplete;
    t->file_status = pdu->file_status;
    for (size_t n = pdu->n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_RESPONSE) {
            tell_text(cfdp, t, CFDP_TOLD_RESPONSE, tlv.value);
        }
    }
    end(cfdp, t, CFDP_TOLD_ENDED);
}

/* The PDU of a transaction that is not known here. */
static CfdpTransaction *take_unknown(Cfdp *cfdp, const CfdpPdu *pdu, uint64_t peer, const CfdpRemote *remote)
{
    const int past = is_past(cfdp, (CfdpId){pdu->source, pdu->sequence});
    if (!past && (pdu->kind == (uint8_t)CFDP_FILE_DATA || pdu->kind == (uint8_t)CFDP_METADATA ||
                  (pdu->kind == (uint8_t)CFDP_EOF && pdu->condition == 0u))) {
        return begin_receiver(cfdp, pdu, remote);
    }
    cfdp->live.faults[CCSDS_STRAY]++;
    if (pdu->kind == (uint8_t)CFDP_EOF || pdu->kind == (uint8_t)CFDP_FINISHED) {
        (void)acknowledge(cfdp, pdu, peer, past ? CFDP_TERMINATED : CFDP_UNRECOGNIZED);
    }
    return NULL;
}

void cfdp_take(Cfdp *cfdp, const uint8_t *bytes, size_t n)
{
    CfdpPdu pdu;
    CcsdsFault wrong = cfdp_pdu_read(&pdu, bytes, n);
    const uint64_t peer = pdu.to_sender ? pdu.destination : pdu.source;
    const CfdpRemote *remote = wrong == CCSDS_OK ? remote_of(cfdp, peer) : NULL;
    CfdpTransaction *t = NULL;
    if (wrong == CCSDS_OK) {
        t = find(cfdp, (CfdpId){pdu.source, pdu.sequence}, pdu.to_sender == 0u);
        if ((pdu.to_sender ? pdu.source : pdu.destination) != cfdp->set.entity) {
            wrong = CCSDS_SPACECRAFT;
        } else if (remote == NULL || (t != NULL && t->peer != peer)) {
            wrong = CCSDS_CHANNEL;
        } else if (t != NULL && (t->class1 != pdu.unacknowledged || t->large != pdu.large)) {
            wrong = CCSDS_TYPE;
        }
    }
    if (wrong != CCSDS_OK) {
        cfdp->live.faults[wrong]++;
        return;
    }
    cfdp->live.taken++;
    if (t == NULL) {
        t = take_unknown(cfdp, &pdu, peer, remote);
        if (t == NULL) {
            return;
        }
    }
    t->inactive = after(cfdp, remote->inactivity);
    switch (pdu.kind) {
    case CFDP_FILE_DATA: take_data(cfdp, t, remote, &pdu); break;
    case CFDP_METADATA: take_metadata(cfdp, t, &pdu); break;
    case CFDP_EOF: take_eof(cfdp, t, &pdu); break;
    case CFDP_FINISHED: take_finished(cfdp, t, &pdu); break;
    case CFDP_ACK:
        if (receives(t)) {
            if (t->state == (uint8_t)CFDP_FINISHING) {
                end(cfdp, t, CFDP_TOLD_ENDED);
            }
        } else if (t->condition != 0u && t->state == (uint8_t)CFDP_SENT && (t->due & DUE_EOF) == 0u) {
            end(cfdp, t, CFDP_TOLD_ENDED);
        } else if (t->condition == 0u && t->state == (uint8_t)CFDP_SENT) {
            t->state = CFDP_WAITING;
            t->expires = INT64_MAX;
            t->due = (uint8_t)(t->due & ~(uint32_t)DUE_EOF);
        }
        break;
    case CFDP_NAK: take_nak(cfdp, t, &pdu); break;
    case CFDP_PROMPT:
        if (t->state == (uint8_t)CFDP_RECEIVING && t->class1 == 0u) {
            t->due |= pdu.keep_alive ? DUE_KEEP_ALIVE : DUE_NAK;
            t->asked = pdu.keep_alive ? t->asked : 0;
        }
        break;
    default: /* CFDP_KEEP_ALIVE */
        if (remote->keep_alive_limit != 0 && t->condition == 0u && t->progress > pdu.offset &&
            t->progress - pdu.offset > remote->keep_alive_limit) {
            fault(cfdp, t, CFDP_KEEP_ALIVE_LIMIT);
        }
        break;
    }
}

/* ---- time */

static void expire(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote)
{
    t->expires = INT64_MAX;
    switch (t->state) {
    case CFDP_SENT:
        t->due |= DUE_EOF;
        if (t->tries >= remote->ack_limit) {
            fault(cfdp, t, CFDP_ACK_LIMIT);
        }
        break;
    case CFDP_FINISHING:
        t->due |= DUE_FINISHED;
        if (t->tries >= remote->ack_limit) {
            fault(cfdp, t, CFDP_ACK_LIMIT);
        }
        break;
    case CFDP_WAITING: /* class 1 with closure */
        t->expires = after(cfdp, remote->check_timer);
        if (++t->tries >= remote->check_limit) {
            fault(cfdp, t, CFDP_CHECK_LIMIT);
        }
        break;
    case CFDP_RECEIVING:
        if (t->class1 != 0u) {
            t->expires = after(cfdp, remote->check_timer);
            if (++t->tries >= remote->check_limit) {
                fault(cfdp, t, CFDP_CHECK_LIMIT);
            }
        } else if (missing(t) && (t->eof != 0u || remote->immediate != 0u || full(cfdp, t))) {
            t->asked = 0;
            t->due |= DUE_NAK;
            if (t->eof != 0u && t->tries++ >= remote->nak_limit) {
                fault(cfdp, t, CFDP_NAK_LIMIT);
            }
        }
        break;
    default: break;
    }
}

/* Move the timers that run. */
static void shift(CfdpTransaction *t, int64_t passed)
{
    int64_t *timers[] = {&t->expires, &t->inactive, &t->keep_alive};
    for (uint32_t i = 0u; i < 3u; i++) {
        if (*timers[i] != INT64_MAX && (passed < 0 || *timers[i] <= INT64_MAX - passed)) {
            *timers[i] += passed;
        }
    }
}

void cfdp_time(Cfdp *cfdp, int64_t now)
{
    const int64_t passed = now > cfdp->live.now ? now - cfdp->live.now : 0;
    cfdp->live.now = now;
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        if (t->state == (uint8_t)CFDP_FREE) {
            continue;
        }
        const CfdpRemote *remote = remote_of(cfdp, t->peer);
        if (t->suspended != 0u || remote->frozen != 0u) { /* its timers rest */
            shift(t, passed);
            continue;
        }
        if (receives(t) && t->class1 == 0u && t->state != (uint8_t)CFDP_FINISHING && now >= t->keep_alive) {
            t->keep_alive = after(cfdp, remote->keep_alive);
            t->due |= DUE_KEEP_ALIVE;
        }
        if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_WAITING) {
            if (now >= t->inactive) {
                t->inactive = after(cfdp, remote->inactivity);
                if (t->metadata != 0u && t->eof == 0u && t->to[0] == '\0') {
                    t->eof = 1u; /* metadata alone, whose sender gives no EOF: all of it is here */
                } else {
                    fault(cfdp, t, CFDP_INACTIVITY);
                    continue;
                }
            }
        }
        if (now >= t->expires) {
            expire(cfdp, t, remote);
            continue;
        }
        step(cfdp, t); /* a remote entity may have resumed it */
        if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_CHECKING) {
            check(cfdp, t, 1);
        }
    }
}

/* ---- the next PDU */

static CfdpPdu pdu_of(const Cfdp *cfdp, const CfdpTransaction *t, CfdpKind kind)
{
    return (CfdpPdu){.kind = (uint8_t)kind,
                     .source = t->id.source,
                     .sequence = t->id.sequence,
                     .destination = receives(t) ? cfdp->set.entity : t->peer,
                     .to_sender = (uint8_t)receives(t),
                     .unacknowledged = t->class1,
                     .crc = t->crc,
                     .large = t->large,
                     .entity_bytes = t->entity_bytes,
                     .sequence_bytes = t->sequence_bytes,
                     .condition = t->condition};
}

static void write_fault_location(const Cfdp *cfdp, const CfdpTransaction *t, CfdpPdu *pdu, uint8_t *bytes)
{
    if (t->condition != 0u && t->condition != (uint8_t)CFDP_UNSUPPORTED_CHECKSUM) {
        uint8_t entity[8];
        cfdp_put_number(entity, t->entity_bytes, cfdp->set.entity);
        pdu->n += cfdp_tlv_write(CFDP_TLV_ENTITY, entity, t->entity_bytes, bytes + pdu->n, 10);
    }
    pdu->data = bytes;
}

static size_t write_data(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    const CfdpStore *store = &cfdp->set.store;
    CfdpRange *ranges = ranges_of(cfdp, t);
    const int again = t->ranges != 0u;
    CfdpPdu pdu = pdu_of(cfdp, t, CFDP_FILE_DATA);
    const size_t head = cfdp_pdu_head(&pdu);
    const uint64_t stop = again ? ranges[0].end : t->size;
    pdu.offset = again ? ranges[0].begin : t->progress;
    pdu.n = room - head - 2 < remote->segment ? room - head - 2 : remote->segment;
    pdu.n = stop - pdu.offset < pdu.n ? (size_t)(stop - pdu.offset) : pdu.n;
    pdu.data = bytes + head;
    if (open_file(cfdp, t) < 0 || store->read(store->user, t->file, pdu.offset, bytes + head, pdu.n) < 0) {
        fault(cfdp, t, CFDP_FILESTORE_REJECTION);
        return 0;
    }
    if (again) {
        ranges[0].begin += pdu.n;
        if (ranges[0].begin == ranges[0].end) {
            remove_range(t, ranges, 0u);
        }
        t->inactive = after(cfdp, remote->inactivity);
    } else {
        t->sum = cfdp_checksum(t->checksum_type, t->sum, pdu.offset, bytes + head, pdu.n);
        t->progress += pdu.n;
        if (t->progress == t->size) {
            t->due |= DUE_EOF;
        }
    }
    return cfdp_pdu_write(&pdu, bytes, room);
}

/* As many missing ranges as there is room for; the next PDU goes on behind them. */
static size_t write_nak(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    const CfdpRange *ranges = ranges_of(cfdp, t);
    CfdpPdu pdu = pdu_of(cfdp, t, CFDP_NAK);
    const size_t head = cfdp_pdu_head(&pdu), wide = cfdp_wide(t->large);
    const size_t most = room - head - 2 < remote->segment ? room - head - 2 : remote->segment;
    const uint64_t last = t->eof != 0u ? t->size : t->progress;
    uint8_t *p = bytes + head;
    pdu.offset = t->asked;
    if (t->metadata == 0u && t->asked == 0) {
        memset(p, 0, 2 * wide);
        pdu.n = 2 * wide;
    }
    uint32_t i = range_at(ranges, t->ranges, t->asked);
    for (; i <= t->ranges && (pdu.n == 0 || t->asked == 0 || pdu.n + 2 * wide <= most); i++) {
        CfdpRange one = i < t->ranges ? ranges[i] : (CfdpRange){t->progress, last};
        one.begin = one.begin < t->asked ? t->asked : one.begin;
        if (one.begin < one.end) {
            cfdp_put_number(p + pdu.n, wide, one.begin);
            cfdp_put_number(p + pdu.n + wide, wide, one.end);
            pdu.n += 2 * wide;
            t->asked = one.end;
        }
    }
    if (i > t->ranges || (i == t->ranges && (t->progress >= last || t->asked >= last))) {
        t->asked = last;
        t->due = (uint8_t)(t->due & ~(uint32_t)DUE_NAK);
        if (t->expires == INT64_MAX && missing(t)) {
            t->expires = after(cfdp, remote->nak_timer);
        }
    }
    pdu.end = t->asked;
    pdu.data = p;
    return cfdp_pdu_write(&pdu, bytes, room);
}

static size_t write_finished(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    CfdpPdu pdu = pdu_of(cfdp, t, CFDP_FINISHED);
    const size_t head = cfdp_pdu_head(&pdu);
    const uint8_t *at = t->options;
    CfdpTlv tlv;
    uint32_t i = 0u;
    pdu.incomplete = t->incomplete;
    pdu.file_status = t->file_status;
    for (size_t n = t->options_n; i < t->results_n && cfdp_tlv_next(&tlv, &at, &n);) {
        CfdpFilestore one;
        if (tlv.type == (uint8_t)CFDP_TLV_REQUEST && cfdp_filestore_read(&one, &tlv) == CCSDS_OK) {
            one.response = 1u;
            one.status = t->results[i++];
            pdu.n += cfdp_filestore_write(&one, bytes + head + pdu.n, room - head - pdu.n - FAULT_LOCATION);
        }
    }
    write_fault_location(cfdp, t, &pdu, bytes + head);
    t->tries++;
    t->expires = after(cfdp, remote->ack_timer);
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    if (t->class1 != 0u) {
        end(cfdp, t, CFDP_TOLD_ENDED);
    }
    return n;
}

static size_t write_eof(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    CfdpPdu pdu = pdu_of(cfdp, t, CFDP_EOF);
    pdu.checksum = t->sum;
    pdu.offset = t->progress;
    write_fault_location(cfdp, t, &pdu, bytes + cfdp_pdu_head(&pdu));
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    t->state = CFDP_SENT;
    t->tries++;
    t->expires = after(cfdp, remote->ack_timer);
    if (t->class1 != 0u) {
        t->state = CFDP_WAITING;
        t->tries = 0u;
        t->inactive = INT64_MAX;
        t->expires = after(cfdp, remote->check_timer);
        if (t->closure == 0u || t->condition != 0u) {
            end(cfdp, t, CFDP_TOLD_ENDED);
        }
    }
    return n;
}

static size_t write_next(Cfdp *cfdp, CfdpTransaction *t, const CfdpRemote *remote, uint8_t *bytes, size_t room)
{
    uint32_t bit = 1u;
    while (bit <= (uint32_t)DUE_PROMPT_KEEP_ALIVE && (t->due & bit) == 0u) {
        bit <<= 1;
    }
    if (bit == (uint32_t)DUE_NAK) {
        return write_nak(cfdp, t, remote, bytes, room);
    }
    t->due = (uint8_t)(t->due & ~bit);
    CfdpPdu pdu = pdu_of(cfdp, t, CFDP_METADATA);
    switch (bit) {
    case DUE_METADATA:
        pdu.closure = t->closure;
        pdu.checksum_type = t->checksum_type;
        pdu.offset = t->size;
        pdu.from = text_of(t->from);
        pdu.to = text_of(t->to);
        pdu.data = t->options;
        pdu.n = t->options_n;
        break;
    case DUE_EOF: return write_eof(cfdp, t, remote, bytes, room);
    case DUE_FINISHED: return write_finished(cfdp, t, remote, bytes, room);
    case DUE_KEEP_ALIVE:
        pdu.kind = CFDP_KEEP_ALIVE;
        pdu.offset = t->progress;
        break;
    case DUE_PROMPT_NAK:
    case DUE_PROMPT_KEEP_ALIVE:
        pdu.kind = CFDP_PROMPT;
        pdu.keep_alive = bit == (uint32_t)DUE_PROMPT_KEEP_ALIVE;
        break;
    default: return write_data(cfdp, t, remote, bytes, room);
    }
    const size_t n = cfdp_pdu_write(&pdu, bytes, room);
    if (n == 0) { /* the options of Metadata are too long for the link */
        cancel(cfdp, t, CFDP_INVALID_STRUCTURE);
    }
    return n;
}

/* Whether a remote entity is the one that is asked for, and can be reached. */
static CfdpRemote *reached(const Cfdp *cfdp, uint64_t peer, const CfdpRemote *asked)
{
    CfdpRemote *remote = remote_of(cfdp, peer);
    return remote != NULL && remote->frozen == 0u && (asked == NULL || asked == remote) ? remote : NULL;
}

size_t cfdp_next(Cfdp *cfdp, const CfdpRemote *asked, uint8_t *bytes, size_t room)
{
    CfdpLive *live = &cfdp->live;
    size_t n = 0;
    if (room < (size_t)CFDP_ROOM) {
        return 0;
    }
    for (uint32_t i = 0u; i < live->answers_n; i++) {
        const CfdpAnswer one = live->answers[i];
        if (reached(cfdp, one.peer, asked) == NULL) {
            continue;
        }
        const int eof = one.acknowledged == (uint8_t)CFDP_EOF;
        const CfdpPdu pdu = {.kind = CFDP_ACK,
                             .source = one.id.source,
                             .sequence = one.id.sequence,
                             .destination = eof ? cfdp->set.entity : one.peer,
                             .to_sender = (uint8_t)eof,
                             .crc = one.crc,
                             .large = one.large,
                             .entity_bytes = one.entity_bytes,
                             .sequence_bytes = one.sequence_bytes,
                             .acknowledged = one.acknowledged,
                             .condition = one.condition,
                             .status = one.status};
        live->answers_n--;
        memmove(live->answers + i, live->answers + i + 1, (live->answers_n - i) * sizeof *live->answers);
        live->sent++;
        return cfdp_pdu_write(&pdu, bytes, room);
    }
    for (uint32_t tries = 0u; n == 0 && tries <= cfdp->set.transactions_n; tries++) { /* a file may not be readable */
        CfdpTransaction *best = NULL;
        const CfdpRemote *remote = NULL;
        for (uint32_t k = 0u; k < cfdp->set.transactions_n; k++) {
            CfdpTransaction *t = &cfdp->set.transactions[(live->turn + k) % cfdp->set.transactions_n];
            const int data = t->state == (uint8_t)CFDP_SENDING ? t->progress < t->size || t->ranges != 0u
                                                               : !receives(t) && t->ranges != 0u;
            if (t->state != (uint8_t)CFDP_FREE && t->suspended == 0u && (t->due != 0u || data) &&
                (best == NULL || t->priority > best->priority) && reached(cfdp, t->peer, asked) != NULL) {
                best = t;
                remote = reached(cfdp, t->peer, asked);
            }
        }
        if (best == NULL) {
            return 0;
        }
        live->turn = (uint32_t)(best - cfdp->set.transactions) + 1u;
        n = write_next(cfdp, best, remote, bytes, room);
    }
    live->sent += n != 0;
    return n;
}

/* ---- requests of the user */

void cfdp_begin(Cfdp *cfdp, const CfdpSetup *setup, uint64_t sequence)
{
    memset(cfdp, 0, sizeof *cfdp);
    cfdp->set = *setup;
    cfdp->live.sequence = sequence;
    memset(setup->transactions, 0, setup->transactions_n * sizeof *setup->transactions);
    memset(setup->past, 0, setup->past_n * sizeof *setup->past);
}

void cfdp_restart(Cfdp *cfdp, int64_t now)
{
    const int64_t passed = now - cfdp->live.now;
    const CfdpStore *store = &cfdp->set.store;
    cfdp->live.now = now;
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        shift(t, passed);
        t->file = -1;
        if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_CHECKING) {
            t->checked = 0;
            t->sum = 0u;
            t->ordered = t->checksum_type != (uint8_t)CFDP_NULL_CHECKSUM;
            if (t->created != 0u &&
                (open_file(cfdp, t) < 0 || store->size(store->user, t->file) < (int64_t)t->progress)) {
                fault(cfdp, t, CFDP_FILESTORE_REJECTION);
            }
        }
    }
}

int cfdp_put(Cfdp *cfdp, const CfdpPut *put, CfdpId *id)
{
    const CfdpStore *store = &cfdp->set.store;
    const CfdpRemote *remote = remote_of(cfdp, put->destination);
    const CfdpText from = text_of(put->from), to = text_of(put->to);
    CfdpTransaction *t = vacant(cfdp, 0u);
    if (remote == NULL || from.n >= (uint8_t)CFDP_NAME || to.n >= (uint8_t)CFDP_NAME ||
        (from.n == 0u) != (to.n == 0u) || put->options_n > (size_t)CFDP_OPTIONS) {
        return CFDP_REFUSED;
    }
    if (t == NULL) {
        return CFDP_FULL;
    }
    int64_t size = 0;
    int file = -1;
    if (from.n != 0u) {
        file = store->open(store->user, put->from, CFDP_OPEN_READ);
        if (file < 0) {
            return file;
        }
        size = store->size(store->user, file);
        if (size < 0) {
            store->close(store->user, file);
            return (int)size;
        }
    }
    memset(t, 0, sizeof *t);
    *id = (CfdpId){cfdp->set.entity, cfdp->live.sequence++};
    t->id = *id;
    t->peer = put->destination;
    t->state = CFDP_SENDING;
    t->size = (uint64_t)size;
    t->large = t->size > UINT32_MAX;
    t->crc = remote->crc;
    t->entity_bytes = cfdp->set.entity_bytes;
    t->sequence_bytes = cfdp->set.sequence_bytes;
    t->class1 = put->class1;
    t->closure = put->class1 != 0u && put->closure != 0u;
    t->priority = put->priority;
    t->checksum_type = remote->checksum;
    t->file = file;
    t->file_status = CFDP_UNREPORTED;
    t->expires = t->keep_alive = INT64_MAX;
    t->inactive = after(cfdp, remote->inactivity);
    t->due = (uint8_t)(size == 0 ? DUE_METADATA | DUE_EOF : DUE_METADATA);
    memcpy(t->from, put->from, from.n);
    memcpy(t->to, put->to, to.n);
    t->options_n = (uint16_t)put->options_n;
    CfdpTlv tlv;
    if (put->options_n != 0) {
        memcpy(t->options, put->options, put->options_n);
    }
    const uint8_t *at = t->options;
    for (size_t n = t->options_n; cfdp_tlv_next(&tlv, &at, &n);) {
        if (tlv.type == (uint8_t)CFDP_TLV_HANDLER && tlv.value.n == 1u) {
            t->handlers[tlv.value.bytes[0] >> 4] = tlv.value.bytes[0] & 15u;
        }
    }
    return 0;
}

/* The transaction that a user names: one that goes on. */
static CfdpTransaction *named(const Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = find(cfdp, id, id.source != cfdp->set.entity);
    return t == NULL || t->condition != 0u ? NULL : t;
}

int cfdp_suspend(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = named(cfdp, id);
    if (t == NULL || t->suspended != 0u) {
        return 0;
    }
    suspend(cfdp, t);
    return 1;
}

int cfdp_resume(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = named(cfdp, id);
    if (t == NULL || t->suspended == 0u) {
        return 0;
    }
    resume(cfdp, t);
    step(cfdp, t);
    return 1;
}

int cfdp_cancel(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = named(cfdp, id);
    if (t == NULL || (t->state == (uint8_t)CFDP_FINISHING && t->suspended == 0u)) {
        return 0;
    }
    cancel(cfdp, t, CFDP_CANCEL_REQUEST);
    return 1;
}

int cfdp_report(Cfdp *cfdp, CfdpId id)
{
    const CfdpTransaction *t = find(cfdp, id, id.source != cfdp->set.entity);
    if (t == NULL) {
        return 0;
    }
    tell(cfdp, t, CFDP_TOLD_REPORT);
    return 1;
}

int cfdp_prompt(Cfdp *cfdp, CfdpId id, int keep_alive)
{
    CfdpTransaction *t = named(cfdp, id);
    if (t == NULL || receives(t) || t->class1 != 0u) {
        return 0;
    }
    t->due |= keep_alive ? DUE_PROMPT_KEEP_ALIVE : DUE_PROMPT_NAK;
    return 1;
}
