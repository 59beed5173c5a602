/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/sdls.h"

#include <string.h>

/* ---- associations */

static int change(SdlsAssociation *association, SdlsState from, SdlsState to)
{
    if (association->state != (uint8_t)from) {
        return 0;
    }
    association->state = (uint8_t)to;
    return 1;
}

int sdls_rekey(SdlsAssociation *association, uint16_t key, uint64_t next)
{
    const int possible = association->spi >= 1u && association->spi <= 65534u && association->window >= 1u &&
                         association->window <= (uint16_t)SDLS_WINDOW;
    if (!possible || !change(association, SDLS_UNKEYED, SDLS_KEYED)) {
        return 0;
    }
    association->key = key;
    association->next = next;
    memset(association->seen, 0xFF, sizeof association->seen); /* a receiver: what was before does not come again */
    return 1;
}

int sdls_start(SdlsAssociation *association)
{
    return change(association, SDLS_KEYED, SDLS_OPERATIONAL);
}

int sdls_stop(SdlsAssociation *association)
{
    return change(association, SDLS_OPERATIONAL, SDLS_KEYED);
}

int sdls_expire(SdlsAssociation *association)
{
    return change(association, SDLS_KEYED, SDLS_UNKEYED);
}

/* The association of a channel that is in operation; spi 0: the first. */
static SdlsAssociation *find(Sdls *sdls, int telecommand, uint8_t virtual_channel, uint32_t spi)
{
    for (uint32_t i = 0u; i < sdls->n; i++) {
        SdlsAssociation *candidate = &sdls->associations[i];
        if (candidate->state == (uint8_t)SDLS_OPERATIONAL && (candidate->telecommand != 0u) == (telecommand != 0) &&
            candidate->virtual_channel == virtual_channel && (spi == 0u || candidate->spi == spi)) {
            return candidate;
        }
    }
    return NULL;
}

/* ---- numbers that came */

static uint32_t *word_of(SdlsAssociation *association, uint64_t number)
{
    return &association->seen[number / 32u % (SDLS_WINDOW / 32u)];
}

static uint32_t bit_of(uint64_t number)
{
    return 1u << number % 32u;
}

static int is_new(SdlsAssociation *association, uint64_t number)
{
    if (number >= association->next) {
        return number != UINT64_MAX; /* behind which there is none */
    }
    return association->next - number <= association->window && (*word_of(association, number) & bit_of(number)) == 0u;
}

void sdls_accept(const SdlsReceipt *receipt)
{
    SdlsAssociation *association = receipt->association;
    if (association == NULL) {
        return;
    }
    for (uint32_t i = 0u; association->next <= receipt->number; i++) { /* the numbers between were not seen */
        if (i == (uint32_t)SDLS_WINDOW) {
            association->next = receipt->number + 1u;
            break;
        }
        *word_of(association, association->next) &= ~bit_of(association->next);
        association->next++;
    }
    *word_of(association, receipt->number) |= bit_of(receipt->number);
    association->accepted++;
}

/* ---- the field */

/* What is authenticated in front of the data: the frame's header, where all but the virtual channel is 0, the segment
 * header, and the security header, where all but the association is 0: the vector has its part in the code anyway. */
typedef struct Head {
    uint8_t bytes[TM_FRAME_HEADER + SDLS_HEADER];
    size_t n;
} Head;

static void add_security_header(Head *head, uint16_t spi)
{
    ccsds_put16(head->bytes + head->n, spi);
    head->n += (size_t)SDLS_HEADER;
}

static Head head_of_command(const TcChannel *channel, const TcFrame *frame)
{
    Head head = {{0u}, TC_FRAME_HEADER};
    head.bytes[2] = (uint8_t)(channel->virtual_channel << 2);
    if (channel->segments) {
        head.bytes[head.n++] = (uint8_t)((uint32_t)frame->part << 6 | frame->map);
    }
    return head;
}

static Head head_of_telemetry(uint8_t virtual_channel)
{
    Head head = {{0u}, TM_FRAME_HEADER};
    head.bytes[1] = (uint8_t)(virtual_channel << 1);
    return head;
}

static int run(const Sdls *sdls, const SdlsAssociation *association, Head *head, uint8_t *field, size_t n, int opening,
               uint8_t *tag)
{
    add_security_header(head, association->spi);
    const SdlsText text = {head->bytes,
                           head->n,
                           field + SDLS_HEADER,
                           n - (size_t)SDLS_OVERHEAD,
                           association->service == (uint8_t)SDLS_ENCRYPT,
                           opening != 0};
    return sdls->cipher.run(sdls->cipher.user, association->key, field + 2, &text, tag);
}

/* The field has n bytes; those of its header and its code are free. */
static CcsdsFault protect(Sdls *sdls, SdlsAssociation *association, Head *head, uint8_t *field, size_t n)
{
    if (association == NULL || association->next == UINT64_MAX) {
        return CCSDS_ASSOCIATION;
    }
    ccsds_put16(field, association->spi);
    ccsds_put32(field + 2, association->fixed);
    ccsds_put64(field + 6, association->next++); /* no number is used twice, whatever follows */
    return run(sdls, association, head, field, n, 0, field + n - SDLS_TAG) ? CCSDS_OK : CCSDS_ASSOCIATION;
}

static CcsdsFault check(Sdls *sdls, SdlsAssociation *association, Head *head, uint8_t *field, size_t n,
                        SdlsReceipt *receipt)
{
    uint8_t tag[SDLS_TAG], wrong = 0u;
    if (association == NULL || ((ccsds_get32(field + 2) ^ association->fixed) & ~association->free) != 0u ||
        !run(sdls, association, head, field, n, 1, tag)) {
        return CCSDS_ASSOCIATION;
    }
    for (size_t i = 0; i < sizeof tag; i++) { /* all of them: the time says nothing about the code */
        wrong |= (uint8_t)(tag[i] ^ field[n - SDLS_TAG + i]);
    }
    if (wrong != 0u) {
        return CCSDS_TAG;
    }
    const uint64_t number = ccsds_get64(field + 6);
    if (!is_new(association, number)) {
        return CCSDS_REPLAY;
    }
    receipt->association = association;
    receipt->number = number;
    return CCSDS_OK;
}

/* Take the protection off a field of n bytes, in memory. What is refused leaves nothing there. */
static CcsdsFault open(Sdls *sdls, int telecommand, uint8_t virtual_channel, Head *head, const uint8_t **field,
                       size_t *n, uint8_t *memory, size_t room, SdlsReceipt *receipt)
{
    CcsdsFault fault = CCSDS_SHORT;
    if (*n > room) {
        fault = CCSDS_ROOM;
    } else if (*n > (size_t)SDLS_OVERHEAD) {
        memmove(memory, *field, *n);
        const uint32_t spi = ccsds_get16(memory);
        fault =
            check(sdls, spi == 0u ? NULL : find(sdls, telecommand, virtual_channel, spi), head, memory, *n, receipt);
    }
    if (fault != CCSDS_OK) {
        sdls->faults[fault]++;
        memset(memory, 0, room);
        return fault;
    }
    *field = memory + SDLS_HEADER;
    *n -= (size_t)SDLS_OVERHEAD;
    return CCSDS_OK;
}

/* ---- telecommands */

CcsdsFault sdls_tc_protect(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory)
{
    Head head = head_of_command(channel, frame);
    const size_t n = frame->n + (size_t)SDLS_OVERHEAD;
    CcsdsFault fault = CCSDS_ROOM;
    if (frame->n != 0 && n <= tc_room(channel)) {
        memmove(memory + SDLS_HEADER, frame->data, frame->n);
        fault = protect(sdls, find(sdls, 1, channel->virtual_channel, 0u), &head, memory, n);
    }
    if (fault != CCSDS_OK) {
        sdls->faults[fault]++;
        return fault;
    }
    frame->data = memory;
    frame->n = n;
    return CCSDS_OK;
}

CcsdsFault sdls_tc_check(Sdls *sdls, const TcChannel *channel, TcFrame *frame, uint8_t *memory, SdlsReceipt *receipt)
{
    Head head = head_of_command(channel, frame);
    receipt->association = NULL;
    if (frame->type == (uint8_t)TC_BC) {
        return CCSDS_OK;
    }
    return open(sdls, 1, channel->virtual_channel, &head, &frame->data, &frame->n, memory, TC_FRAME_MAX, receipt);
}

/* ---- telemetry */

static int protect_zone(void *user, uint8_t virtual_channel, uint8_t *zone, size_t n)
{
    Sdls *sdls = user;
    Head head = head_of_telemetry(virtual_channel);
    const CcsdsFault fault = protect(sdls, find(sdls, 0, virtual_channel, 0u), &head, zone, n);
    sdls->faults[fault] += fault != CCSDS_OK;
    return fault == CCSDS_OK;
}

void sdls_tm_protect(Sdls *sdls, TmVirtual *vc)
{
    vc->before = SDLS_HEADER;
    vc->behind = SDLS_TAG;
    vc->protect = protect_zone;
    vc->protector = sdls;
}

CcsdsFault sdls_tm_open(Sdls *sdls, TmFrame *frame, uint8_t *memory)
{
    Head head = head_of_telemetry(frame->virtual_channel);
    SdlsReceipt receipt = {NULL, 0u};
    const CcsdsFault fault =
        open(sdls, 0, frame->virtual_channel, &head, &frame->zone, &frame->n, memory, TM_FRAME_MAX, &receipt);
    if (fault == CCSDS_OK) {
        sdls_accept(&receipt);
    }
    return fault;
}

const SdlsFunctions sdls_functions = {sdls_tc_protect, sdls_tc_check, sdls_accept, sdls_tm_protect, sdls_tm_open};
