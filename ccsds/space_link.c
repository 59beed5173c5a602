/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/space_link.h"

#include <string.h>

int space_link_is_possible(const SpaceLinkSetup *setup, int secured)
{
    TmSender sender;
    const size_t overhead = secured ? (size_t)SDLS_OVERHEAD : 0u;
    Farm farm;
    return tm_sender_begin(&sender, &setup->telemetry, NULL, NULL) &&
           tm_zone(&setup->telemetry) >= overhead + (size_t)SPACE_PACKET_MIN &&
           setup->commands.spacecraft == setup->telemetry.spacecraft &&
           setup->commands.virtual_channel < (uint8_t)TC_CHANNELS && setup->virtual_channel < (uint8_t)TM_CHANNELS &&
           setup->map < (uint8_t)(setup->commands.segments ? TC_MAPS : 1) && farm_begin(&farm, setup->window);
}

/* ---- the spacecraft: commands */

/* What takes commands, for the time of a call. */
typedef struct Taking {
    SpaceLinkCraft *craft;
    const SpaceLinkSetup *setup;
    const SpaceLinkSecurity *security;
    int room;
    SpaceLinkCommands sink;
    void *user;
} Taking;

void space_link_craft_begin(SpaceLinkCraft *craft, const SpaceLinkSetup *setup)
{
    memset(craft, 0, sizeof *craft);
    (void)farm_begin(&craft->farm, setup->window);
    craft->first = PACKET_ZONE_NONE;
}

/* The packets of a unit of data. */
static CcsdsFault give(const Taking *taking, const uint8_t *bytes, size_t n, uint16_t spi)
{
    while (n != 0) {
        uint32_t size;
        const CcsdsFault fault = packet_size(bytes, n, &size);
        if (fault != CCSDS_OK) {
            return fault;
        }
        if (bytes[0] >> 5 == 0u) {
            taking->craft->packets++;
            taking->sink(taking->user, bytes, size, spi);
        } else if (!packet_is_idle(bytes)) {
            taking->craft->faults[CCSDS_VERSION]++; /* an encapsulation packet: those behind it are found */
        }
        bytes += size;
        n -= size;
    }
    return CCSDS_OK;
}

/* The data of a frame that FARM-1 accepted. */
static CcsdsFault join(const Taking *taking, const TcFrame *frame, uint16_t spi)
{
    SpaceLinkCraft *craft = taking->craft;
    if (frame->part == (uint8_t)SPACE_PACKET_WHOLE && craft->open == 0u) {
        return give(taking, frame->data, frame->n, spi);
    }
    PartJoiner joiner = {craft->unit, sizeof craft->unit, craft->joined, craft->open, {0u}};
    const int whole = tc_join(&joiner, frame);
    craft->joined = (uint32_t)joiner.n;
    craft->open = joiner.open;
    for (uint32_t i = 0u; i < (uint32_t)CCSDS_FAULTS; i++) {
        craft->faults[i] += joiner.faults[i];
    }
    return whole ? give(taking, joiner.memory, joiner.n, spi) : CCSDS_OK;
}

static CcsdsFault take_frame(const Taking *taking, TcFrame *frame)
{
    const SpaceLinkSecurity *security = taking->security;
    SpaceLinkCraft *craft = taking->craft;
    uint8_t memory[TC_FRAME_MAX];
    SdlsReceipt receipt = {NULL, 0u};
    craft->received = 1u;
    if (frame->type != (uint8_t)TC_BC && frame->map != taking->setup->map) {
        return CCSDS_CHANNEL;
    }
    if (security != NULL) {
        const CcsdsFault fault =
            security->functions->tc_check(security->sdls, &taking->setup->commands, frame, memory, &receipt);
        if (fault != CCSDS_OK) {
            return fault;
        }
    }
    if (!farm_frame(&craft->farm, frame, taking->room) || frame->type == (uint8_t)TC_BC) {
        return CCSDS_OK; /* FARM-1 counts what it discards */
    }
    if (receipt.association != NULL) {
        security->functions->accept(&receipt);
    }
    return join(taking, frame, receipt.association != NULL ? receipt.association->spi : 0u);
}

/* Frames one behind the other. What is shorter than a codeblock behind the first fills the CLTU. */
static void take_frames(void *user, uint8_t *bytes, size_t n)
{
    const Taking *taking = user;
    CcsdsFault fault = CCSDS_OK;
    if (taking->setup->tc_random != 0u) {
        sync_randomise_tc(bytes, n);
    }
    for (size_t at = 0; fault == CCSDS_OK && (at == 0 || n - at >= (size_t)CLTU_DATA);) {
        TcFrame frame;
        fault = tc_frame_read(&taking->setup->commands, bytes + at, n - at, &frame);
        if (fault == CCSDS_OK) {
            at += frame.size;
            fault = take_frame(taking, &frame);
        }
        taking->craft->faults[fault] += fault != CCSDS_OK;
    }
}

void space_link_craft_take(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                           const uint8_t *bytes, size_t n, int room, SpaceLinkCommands sink, void *user)
{
    Taking taking = {craft, setup, security, room, sink, user};
    uint8_t memory[SPACE_LINK_UNIT];
    if (setup->cltu != 0u) {
        CltuReader reader;
        cltu_begin(&reader, memory, sizeof memory, take_frames, &taking);
        cltu_take(&reader, bytes, n);
        craft->corrected += reader.corrected;
        craft->faults[CCSDS_ROOM] += reader.faults[CCSDS_ROOM];
        craft->faults[CCSDS_SHORT] += reader.inside != 0u || reader.units == 0u; /* no CLTU, or its end is missing */
    } else if (n > sizeof memory) {
        craft->faults[CCSDS_ROOM]++;
    } else {
        memcpy(memory, bytes, n);
        take_frames(&taking, memory, n);
    }
}

/* ---- the spacecraft: telemetry */

/* What sends, for the time of a call. */
typedef struct Sending {
    const SpaceLinkSetup *setup;
    TmSink sink;
    void *user;
    TmSender sender;
    TmVirtual vc;
} Sending;

/* A frame as it goes out. */
static void send_frame(void *user, const uint8_t *frame, size_t n)
{
    const Sending *sending = user;
    uint8_t bytes[SPACE_LINK_FRAME];
    const size_t at = sending->setup->marker != 0u ? (size_t)SYNC_MARKER_BYTES : 0u;
    if (at == 0 && sending->setup->tm_random == 0u) {
        sending->sink(sending->user, frame, n);
        return;
    }
    ccsds_put32(bytes, SYNC_MARKER);
    memcpy(bytes + at, frame, n);
    if (sending->setup->tm_random != 0u) {
        sync_randomise_tm(bytes + at, n);
    }
    sending->sink(sending->user, bytes, at + n);
}

static void begin_sending(Sending *sending, SpaceLinkCraft *craft, const SpaceLinkSetup *setup,
                          const SpaceLinkSecurity *security, TmSink sink, void *user)
{
    const Clcw clcw = farm_clcw(&craft->farm, setup->commands.virtual_channel);
    sending->setup = setup;
    sending->sink = sink;
    sending->user = user;
    (void)tm_sender_begin(&sending->sender, &setup->telemetry, send_frame, sending);
    sending->sender.control = clcw_word(&clcw);
    sending->sender.count = craft->master_count;
    tm_virtual_begin(&sending->vc, setup->virtual_channel, craft->frame);
    sending->vc.n = craft->filled;
    sending->vc.first = craft->first;
    sending->vc.count = craft->count;
    if (security != NULL) {
        security->functions->tm_protect(security->sdls, &sending->vc);
    }
}

static void end_sending(const Sending *sending, SpaceLinkCraft *craft)
{
    const uint8_t sent = (uint8_t)(sending->sender.count - craft->master_count);
    if (sent != 0u) {
        craft->received = 0u;
        craft->reported = sending->sender.control;
    }
    craft->frames += sent;
    craft->unprotected += sending->sender.unprotected;
    craft->master_count = sending->sender.count;
    craft->count = sending->vc.count;
    craft->filled = (uint32_t)sending->vc.n;
    craft->first = sending->vc.first;
}

void space_link_craft_send(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                           const uint8_t *packet, size_t n, TmSink sink, void *user)
{
    Sending sending;
    begin_sending(&sending, craft, setup, security, sink, user);
    tm_send(&sending.sender, &sending.vc, packet, n);
    end_sending(&sending, craft);
}

void space_link_craft_flush(SpaceLinkCraft *craft, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                            int idle, TmSink sink, void *user)
{
    Sending sending;
    farm_room(&craft->farm);
    begin_sending(&sending, craft, setup, security, sink, user);
    const int answers = setup->telemetry.control != 0u || security != NULL;
    const int news = answers && (craft->received != 0u || sending.sender.control != craft->reported); /* none: 0 */
    if (craft->filled != 0u) {
        tm_flush(&sending.sender, &sending.vc);
    } else if (idle || news) {
        tm_idle(&sending.sender, &sending.vc);
    }
    end_sending(&sending, craft);
}

/* ---- the ground: commands */

#define SERVICE 0xFFFFFFFFu /* the tag of directives */

/* A unit of FOP-1 has the part in front of the data: how it goes out. */
static int send_unit(void *user, TcType type, uint8_t number, const uint8_t *data, size_t n)
{
    SpaceLinkGround *ground = user;
    const TcChannel *channel = &ground->setup.commands;
    uint8_t frame[TC_FRAME_MAX], cltu[SPACE_LINK_UNIT];
    size_t size;
    if (type == TC_BC) {
        size = tc_control_write(channel, (TcControl)data[0], data[1], frame);
    } else {
        const TcFrame written = {.data = data + 1,
                                 .n = n - 1,
                                 .type = (uint8_t)type,
                                 .number = number,
                                 .part = data[0],
                                 .map = ground->setup.map};
        size = tc_frame_write(channel, &written, frame);
    }
    if (ground->setup.tc_random != 0u) {
        sync_randomise_tc(frame, size);
    }
    if (ground->setup.cltu != 0u) {
        ground->sinks.unit(ground->sinks.user, cltu, cltu_write(frame, size, cltu));
    } else {
        ground->sinks.unit(ground->sinks.user, frame, size);
    }
    return 1;
}

static void fail(SpaceLinkGround *ground, uint32_t tag)
{
    if (ground->failed != tag + 1u) { /* of several segments one answer */
        ground->failed = tag + 1u;
        ground->sinks.answer(ground->sinks.user, SPACE_LINK_FAILED, tag);
    }
}

/* An answer of FOP-1. A tag is that of the command, and whether it is the last segment. */
static void hear(void *user, FopAnswer answer, uint32_t tag, uint32_t what)
{
    SpaceLinkGround *ground = user;
    if (answer == FOP_ALERT) {
        if (what != (uint32_t)FOP_ALERT_TERM) {
            ground->alerts++;
            ground->alert = (uint8_t)what;
        }
        if (ground->at != 0) { /* the segments that are left go nowhere */
            ground->n = ground->at = 0;
            fail(ground, ground->tag);
        }
    } else if (tag == SERVICE) {
        return;
    } else if (answer == FOP_CONFIRMED && (tag & 1u) != 0u && ground->failed != (tag >> 1) + 1u) {
        ground->sinks.answer(ground->sinks.user, SPACE_LINK_CONFIRMED, tag >> 1);
    } else if (answer == FOP_FAILED) {
        fail(ground, tag >> 1);
    }
}

/* Hand over the next segment of the packet. */
static void send_segment(SpaceLinkGround *ground)
{
    const TcChannel *channel = &ground->setup.commands;
    const SpaceLinkSecurity *security = &ground->security;
    const size_t room = tc_room(channel) - (security->sdls != NULL ? (size_t)SDLS_OVERHEAD : 0u);
    const size_t left = ground->n - ground->at, n = left < room ? left : room;
    const uint32_t first = ground->at == 0, last = n == left;
    uint8_t memory[1 + TC_FRAME_MAX];
    TcFrame frame = {.data = ground->packet + ground->at,
                     .n = n,
                     .type = (uint8_t)(ground->setup.cop1 != 0u ? TC_AD : TC_BD),
                     .part = (uint8_t)(first | last << 1), /* SpacePacketPart */
                     .map = ground->setup.map};
    const uint32_t tag = ground->tag << 1 | last;
    CcsdsFault fault = CCSDS_OK;
    if (security->sdls != NULL) {
        fault = security->functions->tc_protect(security->sdls, channel, &frame, memory + 1);
    } else {
        memcpy(memory + 1, frame.data, n);
    }
    memory[0] = frame.part;
    ground->at = last ? 0u : ground->at + n;
    ground->n = last ? 0u : ground->n;
    if (fault != CCSDS_OK) {
        ground->n = ground->at = 0;
        fail(ground, ground->tag);
    } else if (ground->setup.cop1 != 0u) {
        fop_transfer(&ground->fop, tag, memory, frame.n + 1u);
    } else {
        fop_bypass(&ground->fop, tag, memory, frame.n + 1u);
        if (last) {
            ground->sinks.answer(ground->sinks.user, SPACE_LINK_SENT, ground->tag);
        }
    }
}

/* Secured: whether it knows which numbers the spacecraft takes. */
static int has_number(const SpaceLinkGround *ground)
{
    return ground->security.sdls == NULL || ground->authentic != 0u;
}

/* Whether a segment would go out at once: then FOP-1 never has one that it rejects later. */
static int takes_segment(const SpaceLinkGround *ground)
{
    const Fop *fop = &ground->fop;
    return has_number(ground) &&
           (ground->setup.cop1 == 0u || (fop->state <= (uint8_t)FOP_RETRANSMIT && fop->sent < fop->window));
}

/* Whether a command waits for a frame of telemetry: for a number, or a CLCW with which the service may start. */
static int is_mute(const SpaceLinkGround *ground)
{
    return ground->n != 0 && (!has_number(ground) || ground->fop.state == (uint8_t)FOP_INITIAL);
}

/* After anything that happened: go on. */
static void settle(SpaceLinkGround *ground)
{
    Fop *fop = &ground->fop;
    if (ground->moves != 0u && fop->state == (uint8_t)FOP_ACTIVE) { /* unlocked: now its number */
        const int same = fop->number == ground->next;
        ground->moves = 0u;
        if (!same) {
            fop_directive(fop, SERVICE, FOP_TERMINATE, 0u);
            fop_directive(fop, SERVICE, FOP_INITIATE_SET, ground->next);
        }
    }
    while (ground->n != 0 && takes_segment(ground)) {
        send_segment(ground);
    }
    if (fop->state <= (uint8_t)FOP_RETRANSMIT_WAIT) {
        ground->known = 1u;
        ground->next = fop->number;
    }
    if (is_mute(ground) && fop->now >= ground->asks) { /* the spacecraft answers any frame */
        const uint8_t unlock[] = {TC_UNLOCK, 0u};
        ground->asks = fop->now + fop->timer;
        (void)send_unit(ground, TC_BC, 0u, unlock, sizeof unlock);
    }
}

/* The service does not run. Of a spacecraft that it knows, what failed may come late: it goes on behind that. */
static void start(SpaceLinkGround *ground)
{
    Fop *fop = &ground->fop;
    const Clcw *clcw = &ground->clcw;
    if (clcw->lockout != 0u || (clcw->retransmit != 0u && ground->known == 0u)) {
        ground->moves = ground->known;
        fop_directive(fop, SERVICE, FOP_SET_NUMBER, clcw->next);
        fop_directive(fop, SERVICE, FOP_INITIATE_UNLOCK, 0u);
    } else if (ground->known != 0u) {
        fop_directive(fop, SERVICE, FOP_INITIATE_SET, ground->next);
    } else {
        fop_directive(fop, SERVICE, FOP_SET_NUMBER, clcw->next);
        fop_directive(fop, SERVICE, FOP_INITIATE_CHECK, 0u);
        fop_clcw(fop, clcw);
    }
}

static void take_clcw(SpaceLinkGround *ground, uint32_t word)
{
    Clcw clcw;
    if (!clcw_read(word, &clcw)) {
        ground->faults[CCSDS_TYPE]++;
        return;
    }
    if (clcw.virtual_channel != ground->setup.commands.virtual_channel) {
        return;
    }
    ground->clcw = clcw;
    ground->clcws++;
    if (ground->setup.cop1 == 0u) {
        return;
    }
    if (ground->fop.state == (uint8_t)FOP_INITIAL) {
        start(ground);
    } else {
        fop_clcw(&ground->fop, &clcw);
    }
}

void space_link_ground_begin(SpaceLinkGround *ground, const SpaceLinkSetup *setup, const SpaceLinkSecurity *security,
                             const SpaceLinkSinks *sinks, int64_t timer, uint8_t limit)
{
    const uint32_t half = setup->window / 2u;
    memset(ground, 0, sizeof *ground);
    ground->setup = *setup;
    ground->sinks = *sinks;
    if (security != NULL) {
        ground->security = *security;
    }
    fop_begin(&ground->fop, ground->units, ground->memory, TC_FRAME_MAX, SPACE_LINK_WINDOW, timer, send_unit, hear,
              ground);
    fop_directive(&ground->fop, SERVICE, FOP_SET_WINDOW, half < (uint32_t)SPACE_LINK_WINDOW ? half : SPACE_LINK_WINDOW);
    fop_directive(&ground->fop, SERVICE, FOP_SET_LIMIT, limit);
    (void)tm_receiver_begin(&ground->receiver, 256, ground->whole, sizeof ground->whole, sinks->packet, sinks->user);
}

int space_link_ground_is_ready(const SpaceLinkGround *ground)
{
    return ground->n == 0;
}

int space_link_ground_send(SpaceLinkGround *ground, uint32_t tag, const uint8_t *packet, size_t n)
{
    if (ground->n != 0 || n == 0 || n > sizeof ground->packet ||
        (ground->setup.commands.segments == 0u &&
         n > tc_room(&ground->setup.commands) - (ground->security.sdls != NULL ? (size_t)SDLS_OVERHEAD : 0u))) {
        return 0;
    }
    memcpy(ground->packet, packet, n);
    ground->n = n;
    ground->at = 0;
    ground->tag = tag;
    settle(ground);
    return 1;
}

void space_link_ground_time(SpaceLinkGround *ground, int64_t t)
{
    fop_time(&ground->fop, t);
    settle(ground);
}

int64_t space_link_ground_due(const SpaceLinkGround *ground)
{
    return is_mute(ground) ? ground->asks : ground->fop.expires;
}

/* ---- the ground: telemetry */

/* Telemetry was authentic: the next command has a number behind its own, as the spacecraft requires after a reset. */
static void follow(SpaceLinkGround *ground)
{
    const Sdls *sdls = ground->security.sdls;
    uint64_t newest = 0u;
    for (uint32_t i = 0u; i < sdls->n; i++) {
        const SdlsAssociation *association = &sdls->associations[i];
        newest = association->telecommand == 0u && association->next > newest ? association->next : newest;
    }
    for (uint32_t i = 0u; i < sdls->n; i++) {
        SdlsAssociation *association = &sdls->associations[i];
        association->next = association->telecommand != 0u && association->next < newest ? newest : association->next;
    }
    ground->authentic = 1u;
}

static CcsdsFault take_telemetry(SpaceLinkGround *ground, const uint8_t *bytes, size_t n)
{
    uint8_t memory[TM_FRAME_MAX];
    const SpaceLinkSecurity *security = &ground->security;
    TmFrame frame;
    CcsdsFault fault = tm_frame_read(&ground->setup.telemetry, bytes, n, &frame);
    if (fault == CCSDS_OK && frame.virtual_channel != ground->setup.virtual_channel) {
        return CCSDS_CHANNEL;
    }
    if (fault == CCSDS_OK && security->sdls != NULL) {
        fault = security->functions->tm_open(security->sdls, &frame, memory);
        if (fault == CCSDS_OK) {
            follow(ground);
        }
    }
    if (fault == CCSDS_OK) {
        tm_receive(&ground->receiver, &frame);
        if (frame.has_control != 0u) {
            take_clcw(ground, frame.control);
        }
        settle(ground);
    }
    return fault;
}

/* A frame behind a marker. */
static void take_marked(void *user, uint8_t *frame, size_t n)
{
    SpaceLinkGround *ground = user;
    if (ground->setup.tm_random != 0u) {
        sync_randomise_tm(frame, n);
    }
    const CcsdsFault fault = take_telemetry(ground, frame, n);
    ground->faults[fault] += fault != CCSDS_OK;
}

/* A frame may begin with these two bytes. */
static int begins(const SpaceLinkGround *ground, const uint8_t *bytes, size_t n)
{
    const uint32_t spacecraft = ground->setup.telemetry.spacecraft;
    return bytes[0] == (uint8_t)(spacecraft >> 4) && (n < 2u || bytes[1] >> 4 == (spacecraft & 15u));
}

/* As many bytes as a frame has, where one should begin. Returns how many of them are done with. */
static size_t take_bytes(SpaceLinkGround *ground)
{
    const size_t size = ground->setup.telemetry.size;
    uint8_t memory[TM_FRAME_MAX];
    const uint8_t *bytes = ground->frame;
    if (ground->setup.tm_random != 0u) {
        memcpy(memory, bytes, size);
        sync_randomise_tm(memory, size);
        bytes = memory;
    }
    const CcsdsFault fault = take_telemetry(ground, bytes, size);
    size_t at = size;
    if (fault == CCSDS_CRC) { /* damaged; or frames begin elsewhere in the stream */
        if (ground->setup.tm_random == 0u) {
            for (at = 1u; at < size && !begins(ground, ground->frame + at, size - at); at++) {
            }
        }
        ground->faults[fault] += ground->searches == 0u;
        ground->skipped += (uint32_t)at;
        ground->searches = 1u;
    } else {
        ground->faults[fault] += fault != CCSDS_OK;
        ground->searches = 0u;
    }
    return at;
}

void space_link_ground_take(SpaceLinkGround *ground, const uint8_t *bytes, size_t n)
{
    const size_t size = ground->setup.telemetry.size;
    if (ground->setup.marker != 0u) {
        if (ground->sync.memory == NULL) {
            sync_begin(&ground->sync, ground->frame, size, 2u, take_marked, ground);
        }
        sync_take(&ground->sync, bytes, n);
        return;
    }
    while (n != 0) {
        const size_t part = size - ground->had < n ? size - ground->had : n;
        memcpy(ground->frame + ground->had, bytes, part);
        ground->had += part;
        bytes += part;
        n -= part;
        while (ground->had == size) {
            const size_t done = take_bytes(ground);
            memmove(ground->frame, ground->frame + done, size - done);
            ground->had -= done;
        }
    }
}
