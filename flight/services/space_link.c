/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/services/space_link.h"

#include <string.h>

enum { TELEMETRY = LINK_ROLES }; /* the place of its numbers */

static SpaceLinkCraft *craft_of(SpaceLink *m)
{
    return (SpaceLinkCraft *)(void *)m->mem.craft;
}

static SpaceLinkSetup setup_of(const SpaceLink *m)
{
    const uint16_t spacecraft = (uint16_t)m->par.spacecraft;
    const SpaceLinkSetup setup = {
        .commands = {spacecraft, (uint8_t)m->par.command_channel, (uint8_t)m->par.segments, 1u},
        .telemetry = {spacecraft, (uint16_t)(m->par.frame_size > 0u ? m->par.frame_size : 1024u), (uint8_t)m->par.cop1,
                      1u},
        .virtual_channel = (uint8_t)m->par.telemetry_channel,
        .map = (uint8_t)m->par.map,
        .cltu = (uint8_t)m->par.cltu,
        .tc_random = (uint8_t)m->par.tc_random,
        .tm_random = (uint8_t)m->par.tm_random,
        .marker = (uint8_t)m->par.marker,
        .window = (uint8_t)(m->par.window > 0u ? m->par.window : 128u),
        .cop1 = (uint8_t)m->par.cop1};
    return setup;
}

/* ---- security */

/* That of a call. */
typedef struct Security {
    SpaceLinkSecurity link;
    Sdls sdls;
    SdlsAssociation associations[LINK_ROLES + 1];
    uint32_t places[LINK_ROLES + 1];
} Security;

static void add(Security *security, const SpaceLink *m, uint32_t place)
{
    const LinkNumbers *numbers = &m->mem.numbers[place];
    const int telecommand = place != (uint32_t)TELEMETRY;
    SdlsAssociation *association = &security->associations[security->sdls.n];
    memset(association, 0, sizeof *association);
    association->spi = (uint16_t)(place + 1u);
    association->fixed = place + 1u; /* one key may serve several */
    association->free = telecommand ? ~7u : 0u;
    association->telecommand = (uint8_t)telecommand;
    association->virtual_channel = (uint8_t)(telecommand ? m->par.command_channel : m->par.telemetry_channel);
    association->service = (uint8_t)m->par.secured;
    association->window = 200u;
    association->key = (uint16_t)(telecommand ? m->par.roles[place].key : m->par.telemetry_key);
    association->state = SDLS_OPERATIONAL;
    association->next = numbers->next;
    memcpy(association->seen, numbers->seen, sizeof association->seen);
    security->places[security->sdls.n++] = place;
}

/* Returns what the link takes: NULL if frames are not secured. */
static const SpaceLinkSecurity *begin(Security *security, const SpaceLink *m, const SdlsProvider *keys)
{
    memset(security, 0, sizeof *security);
    if (m->par.secured == 0u) {
        return NULL;
    }
    security->sdls.cipher = keys->cipher;
    security->sdls.associations = security->associations;
    for (uint32_t i = 0u; i < (uint32_t)LINK_ROLES; i++) {
        if (m->par.roles[i].key != 0u) {
            add(security, m, i);
        }
    }
    add(security, m, TELEMETRY);
    security->link.sdls = &security->sdls;
    security->link.functions = keys->functions;
    return &security->link;
}

static void end(const Security *security, SpaceLink *m)
{
    for (uint32_t i = 0u; i < security->sdls.n; i++) {
        const SdlsAssociation *association = &security->associations[i];
        LinkNumbers *numbers = &m->mem.numbers[security->places[i]];
        numbers->next = association->next;
        memcpy(numbers->seen, association->seen, sizeof numbers->seen);
        numbers->accepted += association->accepted;
    }
}

/* Until flight's first instant no number is new. */
static void forget(SpaceLink *m)
{
    for (uint32_t i = 0u; i <= (uint32_t)LINK_ROLES; i++) {
        m->mem.numbers[i].next = UINT64_MAX;
        memset(m->mem.numbers[i].seen, 0xFF, sizeof m->mem.numbers[i].seen);
    }
}

/* Telemetry has numbers of the time, and the ground takes those of commands from there. So what came before a reset
 * that forgot the numbers is old, whatever it was. */
static void number(SpaceLink *m, const SdlsProvider *keys, int64_t t)
{
    LinkNumbers *numbers = m->mem.numbers;
    const uint64_t now = keys->since + (uint64_t)t;
    for (uint32_t i = 0u; numbers[TELEMETRY].next == UINT64_MAX && i < (uint32_t)LINK_ROLES; i++) {
        numbers[i].next = now;
    }
    if (numbers[TELEMETRY].next == UINT64_MAX || numbers[TELEMETRY].next < now) {
        numbers[TELEMETRY].next = now;
    }
}

/* ---- what it does for flight */

/* At the first call since the computer began. Returns 0 if nothing can pass: the parameters make no link, or the keys
 * are missing. */
static int is_ready(const CommandContext *context, SpaceLink *m, const SpaceLinkSetup *setup)
{
    const SdlsProvider *keys = context->table->services->keys;
    if (context->state->framed == 0u) {
        context->state->framed = 1u;
        memset(&m->mem, 0, sizeof m->mem);
        space_link_craft_begin(craft_of(m), setup);
        forget(m);
    }
    return space_link_is_possible(setup, m->par.secured != 0u) && (m->par.secured == 0u || keys != NULL);
}

/* The receiver of the commands of a unit. */
typedef struct Commands {
    SpaceLink *m;
    CommandPackets sink;
    void *user;
} Commands;

static void give(void *user, const uint8_t *packet, size_t n, uint16_t spi)
{
    const Commands *commands = user;
    commands->sink(commands->user, packet, (uint32_t)n, spi > 0u ? commands->m->par.roles[spi - 1u].barred : 0u);
}

static void unwrap(const CommandContext *context, void *module, const uint8_t *bytes, uint32_t n, CommandPackets sink,
                   void *user)
{
    SpaceLink *m = module;
    const SpaceLinkSetup setup = setup_of(m);
    const CommandTable *table = context->table;
    Commands commands = {m, sink, user};
    Security security;
    if (!is_ready(context, m, &setup)) {
        craft_of(m)->faults[CCSDS_ASSOCIATION]++;
        return;
    }
    const SpaceLinkSecurity *link = begin(&security, m, table->services->keys);
    space_link_craft_take(craft_of(m), &setup, link, bytes, n,
                          table->room - context->state->waiting >= (uint32_t)COMMAND_MAX, give, &commands);
    end(&security, m);
}

/* Where frames go. */
typedef struct Frames {
    CommandBytes sink;
    void *user;
} Frames;

static void put(void *user, const uint8_t *frame, size_t n)
{
    const Frames *frames = user;
    frames->sink(frames->user, frame, (uint32_t)n);
}

static void wrap(const CommandContext *context, void *module, const uint8_t *packet, uint32_t n, CommandBytes sink,
                 void *user)
{
    SpaceLink *m = module;
    const SpaceLinkSetup setup = setup_of(m);
    Frames frames = {sink, user};
    Security security;
    if (!is_ready(context, m, &setup)) {
        return;
    }
    if (m->par.secured != 0u) {
        number(m, context->table->services->keys, context->t);
    }
    const SpaceLinkSecurity *link = begin(&security, m, context->table->services->keys);
    if (n > 0u) {
        space_link_craft_send(craft_of(m), &setup, link, packet, n, put, &frames);
    } else {
        const SpaceLinkCraft *craft = craft_of(m);
        const int idle = craft->frames == m->mem.frames && m->par.idle > 0.0 &&
                         (double)(context->t - m->mem.sent) * 1e-9 >= m->par.idle;
        space_link_craft_flush(craft_of(m), &setup, link, idle, put, &frames);
        if (craft->frames != m->mem.frames) {
            m->mem.sent = context->t;
            m->mem.frames = craft->frames;
        }
    }
    end(&security, m);
}

static int64_t next(const void *module)
{
    const SpaceLink *m = module;
    const SpaceLinkCraft *craft = (const SpaceLinkCraft *)(const void *)m->mem.craft;
    if (craft->received != 0u || craft->filled != 0u) {
        return 0; /* at the next instant */
    }
    return m->par.idle > 0.0 && m->par.idle < 9e9 ? m->mem.sent + (int64_t)(m->par.idle * 1e9) : INT64_MAX;
}

const CommandService space_link_service = {.next = next, .unwrap = unwrap, .wrap = wrap};

/* ---- the module */

void space_link_reset(SpaceLink *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void space_link_update(SpaceLink *m, Tick t)
{
    const SpaceLinkCraft *craft = craft_of(m);
    LinkState *s = &m->out.state;
    s->accepted = craft->farm.accepted;
    s->discarded = craft->farm.discarded;
    s->packets = craft->packets;
    s->sent = craft->frames;
    s->unsent = craft->unprotected;
    s->corrected = craft->corrected;
    s->farm = craft->farm.state;
    s->next = craft->farm.next;
    for (uint32_t i = 0u; i < (uint32_t)CCSDS_FAULTS; i++) {
        s->faults[i] = craft->faults[i];
    }
    s->head = head_next(s->head, t.t, QUALITY_GOOD);
}
