/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/cfdp_transaction.h"

#include <string.h>

/* Move the timers that run. */
static void shift_timers(CfdpTransaction *t, int64_t passed)
{
    int64_t *timers[] = {&t->expires, &t->inactive, &t->keep_alive};
    for (uint32_t i = 0u; i < 3u; i++) {
        if (*timers[i] != INT64_MAX && (passed < 0 || *timers[i] <= INT64_MAX - passed)) {
            *timers[i] += passed;
        }
    }
}

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
    cfdp->live.now = now;
    for (uint32_t i = 0u; i < cfdp->set.transactions_n; i++) {
        CfdpTransaction *t = &cfdp->set.transactions[i];
        shift_timers(t, passed);
        t->file = -1;
        if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_CHECKING) {
            cfdp_receiver_restart(cfdp, t);
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
        const CfdpRemote *remote = cfdp_peer(cfdp, t->peer);
        if (t->suspended != 0u || remote->frozen != 0u) { /* its timers rest */
            shift_timers(t, passed);
            continue;
        }
        if (cfdp_receives(t) && t->class1 == 0u && t->state != (uint8_t)CFDP_FINISHING && now >= t->keep_alive) {
            t->keep_alive = cfdp_deadline(cfdp, remote->keep_alive);
            t->due |= DUE_KEEP_ALIVE;
        }
        if (t->state == (uint8_t)CFDP_RECEIVING || t->state == (uint8_t)CFDP_WAITING) {
            if (now >= t->inactive) {
                t->inactive = cfdp_deadline(cfdp, remote->inactivity);
                if (t->metadata != 0u && t->eof == 0u && t->to[0] == '\0') {
                    t->eof = 1u; /* metadata alone, whose sender gives no EOF: all of it is here */
                } else {
                    cfdp_declare_fault(cfdp, t, CFDP_INACTIVITY);
                    continue;
                }
            }
        }
        if (cfdp_receives(t)) {
            if (now >= t->expires) {
                cfdp_receiver_expire(cfdp, t, remote);
            } else {
                cfdp_receiver_tick(cfdp, t);
            }
        } else if (now >= t->expires) {
            cfdp_sender_expire(cfdp, t, remote);
        }
    }
}

/* The PDU of a transaction that is not known here. */
static CfdpTransaction *take_unknown(Cfdp *cfdp, const CfdpPdu *pdu, uint64_t peer, const CfdpRemote *remote)
{
    const int past = cfdp_is_past(cfdp, (CfdpId){pdu->source, pdu->sequence});
    if (!past && (pdu->kind == (uint8_t)CFDP_FILE_DATA || pdu->kind == (uint8_t)CFDP_METADATA ||
                  (pdu->kind == (uint8_t)CFDP_EOF && pdu->condition == 0u))) {
        return cfdp_receiver_begin(cfdp, pdu, remote);
    }
    cfdp->live.faults[CCSDS_STRAY]++;
    if (pdu->kind == (uint8_t)CFDP_EOF || pdu->kind == (uint8_t)CFDP_FINISHED) {
        (void)cfdp_acknowledge(cfdp, pdu, peer, past ? CFDP_TERMINATED : CFDP_UNRECOGNIZED);
    }
    return NULL;
}

void cfdp_take(Cfdp *cfdp, const uint8_t *bytes, size_t n)
{
    CfdpPdu pdu;
    CcsdsFault wrong = cfdp_pdu_read(&pdu, bytes, n);
    const uint64_t peer = pdu.to_sender ? pdu.destination : pdu.source;
    const CfdpRemote *remote = wrong == CCSDS_OK ? cfdp_remote(cfdp, peer) : NULL;
    CfdpTransaction *t = NULL;
    if (wrong == CCSDS_OK) {
        t = cfdp_find(cfdp, (CfdpId){pdu.source, pdu.sequence}, pdu.to_sender == 0u);
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
    t->inactive = cfdp_deadline(cfdp, remote->inactivity);
    if (pdu.to_sender) {
        cfdp_sender_take(cfdp, t, remote, &pdu);
    } else {
        cfdp_receiver_take(cfdp, t, remote, &pdu);
    }
}

/* Whether the PDU may be for this remote entity, and it can be reached. */
static int is_reachable(const Cfdp *cfdp, uint64_t peer, const CfdpRemote *wanted)
{
    const CfdpRemote *remote = cfdp_peer(cfdp, peer);
    return remote->frozen == 0u && (wanted == NULL || wanted == remote);
}

/* The first acknowledgement that may go. */
static size_t write_answer(Cfdp *cfdp, const CfdpRemote *wanted, uint8_t *bytes, size_t room)
{
    CfdpLive *live = &cfdp->live;
    for (uint32_t i = 0u; i < live->answers_n; i++) {
        const CfdpAnswer answer = live->answers[i];
        if (!is_reachable(cfdp, answer.peer, wanted)) {
            continue;
        }
        const int eof = answer.acknowledged == (uint8_t)CFDP_EOF;
        const CfdpPdu pdu = {.kind = CFDP_ACK,
                             .source = answer.id.source,
                             .sequence = answer.id.sequence,
                             .destination = eof ? cfdp->set.entity : answer.peer,
                             .to_sender = (uint8_t)eof,
                             .crc = answer.crc,
                             .large = answer.large,
                             .entity_bytes = answer.entity_bytes,
                             .sequence_bytes = answer.sequence_bytes,
                             .acknowledged = answer.acknowledged,
                             .condition = answer.condition,
                             .status = answer.status};
        live->answers_n--;
        memmove(live->answers + i, live->answers + i + 1, (live->answers_n - i) * sizeof *live->answers);
        return cfdp_pdu_write(&pdu, bytes, room);
    }
    return 0;
}

/* The transaction that sends next: of the highest priority, in turn. */
static CfdpTransaction *choose(const Cfdp *cfdp, const CfdpRemote *wanted)
{
    CfdpTransaction *best = NULL;
    for (uint32_t k = 0u; k < cfdp->set.transactions_n; k++) {
        CfdpTransaction *t = &cfdp->set.transactions[(cfdp->live.turn + k) % cfdp->set.transactions_n];
        const int data = t->state == (uint8_t)CFDP_SENDING ? t->progress < t->size || t->ranges != 0u
                                                           : !cfdp_receives(t) && t->ranges != 0u;
        if (t->state != (uint8_t)CFDP_FREE && t->suspended == 0u && (t->due != 0u || data) &&
            (best == NULL || t->priority > best->priority) && is_reachable(cfdp, t->peer, wanted)) {
            best = t;
        }
    }
    return best;
}

size_t cfdp_next(Cfdp *cfdp, const CfdpRemote *wanted, uint8_t *bytes, size_t room)
{
    if (room < (size_t)CFDP_ROOM) {
        return 0;
    }
    size_t n = write_answer(cfdp, wanted, bytes, room);
    /* undecided: a guard; a transaction fails to write once, and is then free, suspended, or has an EOF to send */
    for (uint32_t tries = 0u; n == 0 && tries <= cfdp->set.transactions_n; tries++) { /* a file may not be readable */
        CfdpTransaction *t = choose(cfdp, wanted);
        if (t == NULL) {
            return 0;
        }
        const CfdpRemote *remote = cfdp_peer(cfdp, t->peer);
        cfdp->live.turn = (uint32_t)(t - cfdp->set.transactions) + 1u;
        n = cfdp_receives(t) ? cfdp_receiver_next(cfdp, t, remote, bytes, room)
                             : cfdp_sender_next(cfdp, t, remote, bytes, room);
    }
    cfdp->live.sent += n != 0;
    return n;
}

/* The transaction that a user names, if it goes on. */
static CfdpTransaction *active(const Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = cfdp_find(cfdp, id, id.source != cfdp->set.entity);
    return t == NULL || t->condition != 0u ? NULL : t;
}

int cfdp_suspend(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = active(cfdp, id);
    if (t == NULL || t->suspended != 0u) {
        return 0;
    }
    cfdp_suspend_transaction(cfdp, t);
    return 1;
}

int cfdp_resume(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = active(cfdp, id);
    if (t == NULL || t->suspended == 0u) {
        return 0;
    }
    cfdp_resume_transaction(cfdp, t);
    cfdp_receiver_step(cfdp, t);
    return 1;
}

int cfdp_cancel(Cfdp *cfdp, CfdpId id)
{
    CfdpTransaction *t = active(cfdp, id);
    if (t == NULL || (t->state == (uint8_t)CFDP_FINISHING && t->suspended == 0u)) {
        return 0;
    }
    cfdp_cancel_transaction(cfdp, t, CFDP_CANCEL_REQUEST);
    return 1;
}

int cfdp_report(Cfdp *cfdp, CfdpId id)
{
    const CfdpTransaction *t = cfdp_find(cfdp, id, id.source != cfdp->set.entity);
    if (t == NULL) {
        return 0;
    }
    cfdp_notify(cfdp, t, CFDP_EVENT_REPORT);
    return 1;
}

int cfdp_prompt(Cfdp *cfdp, CfdpId id, int keep_alive)
{
    CfdpTransaction *t = active(cfdp, id);
    if (t == NULL || cfdp_receives(t) || t->class1 != 0u) {
        return 0;
    }
    t->due |= keep_alive ? DUE_PROMPT_KEEP_ALIVE : DUE_PROMPT_NAK;
    return 1;
}
