/* SPDX-License-Identifier: Apache-2.0 */
#include "record/mcap.h"

#include <string.h>

enum {
    OP_HEADER = 0x01,
    OP_FOOTER = 0x02,
    OP_SCHEMA = 0x03,
    OP_CHANNEL = 0x04,
    OP_MESSAGE = 0x05,
    OP_CHUNK = 0x06,
    OP_MESSAGE_INDEX = 0x07,
    OP_CHUNK_INDEX = 0x08,
    OP_STATISTICS = 0x0B,
    OP_METADATA = 0x0C,
    OP_METADATA_INDEX = 0x0D,
    OP_SUMMARY_OFFSET = 0x0E,
    OP_DATA_END = 0x0F
};

/* Bytes: an operation code and a length stand before every record. */
#define PREFIX 9u
#define CHUNK_HEAD (PREFIX + 3u * 8u + 4u + 4u + 8u)
#define MESSAGE_HEAD (PREFIX + 2u + 4u + 2u * 8u)
#define CDR_HEAD 4u
#define ENTRY 16u

static const uint8_t MAGIC[8] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
static const char SCHEMA_ENCODING[] = "ros2msg";
static const char MESSAGE_ENCODING[] = "cdr";

/* ---- bytes: all integers of the container are little-endian, on every machine ---- */

static uint8_t *put_u16(uint8_t *p, uint16_t v)
{
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
    return p + 2;
}

static uint8_t *put_u32(uint8_t *p, uint32_t v)
{
    return put_u16(put_u16(p, (uint16_t)v), (uint16_t)(v >> 16));
}

static uint8_t *put_u64(uint8_t *p, uint64_t v)
{
    return put_u32(put_u32(p, (uint32_t)v), (uint32_t)(v >> 32));
}

static uint8_t *put_prefix(uint8_t *p, uint8_t op, uint64_t length)
{
    *p = op;
    return put_u64(p + 1, length);
}

static uint64_t text_size(const char *s)
{
    return 4u + strlen(s);
}

static uint64_t pairs_size(const McapPair *pairs, size_t n)
{
    uint64_t size = 0;
    for (size_t i = 0; i < n; i++) {
        size += text_size(pairs[i].key) + text_size(pairs[i].value);
    }
    return size;
}

static bool pairs_valid(const McapPair *pairs, size_t n)
{
    if (n > 0u && pairs == NULL) {
        return false;
    }
    for (size_t i = 0; i < n; i++) {
        if (pairs[i].key == NULL || pairs[i].value == NULL) {
            return false;
        }
    }
    return true;
}

static bool little_endian_machine(void)
{
    const uint16_t word = 1;
    uint8_t first;
    memcpy(&first, &word, 1);
    return first == 1u;
}

/* ---- output ---- */

/* Pass bytes to the sink; the CRC includes them already. After a failure of the sink it gets no more bytes. */
static void deliver(McapWriter *w, const void *bytes, size_t n)
{
    if (w->status != MCAP_OK || n == 0u) {
        return;
    }
    int error = w->config.write(w->config.user, bytes, n);
    if (error != 0) {
        w->status = MCAP_WRITE_FAILED;
        w->sink_error = error;
        return;
    }
    w->position += n;
}

static void send(McapWriter *w, const void *bytes, size_t n)
{
    w->crc = mcap_crc_update(&w->crc_tables, w->crc, bytes, n);
    deliver(w, bytes, n);
}

static void send_stage(McapWriter *w)
{
    send(w, w->stage, w->stage_used);
    w->stage_used = 0;
}

/* The position in the file of the next byte that passes through the stage. */
static uint64_t tell(const McapWriter *w)
{
    return w->position + w->stage_used;
}

/* Append bytes to the open chunk, in which make_room has made room, or through the stage to the sink. */
static void put(McapWriter *w, const void *bytes, size_t n)
{
    if (n == 0u) {
        return;
    }
    if (w->in_chunk) {
        memcpy(w->config.chunk + w->chunk_used, bytes, n);
        w->chunk_used += n;
        return;
    }
    if (n > sizeof w->stage - w->stage_used) {
        send_stage(w);
    }
    if (n > sizeof w->stage) {
        send(w, bytes, n);
        return;
    }
    memcpy(w->stage + w->stage_used, bytes, n);
    w->stage_used += n;
}

/* An integer of n bytes. */
static void put_int(McapWriter *w, uint64_t v, size_t n)
{
    uint8_t b[8];
    put_u64(b, v);
    put(w, b, n);
}

static void put_record(McapWriter *w, uint8_t op, uint64_t length)
{
    put(w, &op, 1);
    put_int(w, length, 8);
}

static void put_text(McapWriter *w, const char *s)
{
    size_t n = strlen(s);
    put_int(w, n, 4);
    put(w, s, n);
}

static void put_pairs(McapWriter *w, const McapPair *pairs, size_t n)
{
    put_int(w, pairs_size(pairs, n), 4);
    for (size_t i = 0; i < n; i++) {
        put_text(w, pairs[i].key);
        put_text(w, pairs[i].value);
    }
}

/* ---- chunks ---- */

static bool chunked(const McapWriter *w)
{
    return w->config.chunk_size > 0u;
}

/* The index entry of message k of the open chunk: {log time u64, offset u32, next entry u32}. The entries of one
 * channel form a list. */
static uint8_t *entry_at(const McapWriter *w, uint32_t k)
{
    return w->config.chunk + (w->config.chunk_size - ENTRY * ((size_t)k + 1u));
}

static uint32_t get_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static size_t chunk_free(const McapWriter *w)
{
    return w->config.chunk_size - ENTRY * (size_t)w->chunk_messages - w->chunk_used;
}

static void begin_chunk(McapWriter *w)
{
    w->chunk_used = CHUNK_HEAD;
    w->chunk_messages = 0;
    w->chunk_t_first = 0;
    w->chunk_t_last = 0;
    w->chunk_ahead = CHUNK_HEAD;
    w->crc_ahead = 0;
    for (uint16_t c = 0; c < w->n_channels; c++) {
        w->config.channels[c].chunk_count = 0;
    }
}

/* Serialize the MessageIndex records into the chunk buffer, whose records the sink has already taken, and the
 * ChunkIndex record into the index. A message record takes at least 35 bytes and its index at most 16 + 15, so this
 * never overwrites the entries at the end of the buffer. */
static void index_chunk(McapWriter *w, uint64_t start, uint64_t size)
{
    uint32_t present = 0;
    for (uint16_t c = 0; c < w->n_channels; c++) {
        present += w->config.channels[c].chunk_count > 0u ? 1u : 0u;
    }
    const uint64_t length = 3u * 8u + 8u + 4u + 10u * (uint64_t)present + 8u + 4u + 8u + 8u;
    if (PREFIX + length > w->index_floor - w->index_used) {
        w->index_full = true;
    }
    const bool indexed = !w->index_full;
    uint8_t *x = w->config.index;
    if (indexed) {
        x = put_prefix(x + w->index_used, OP_CHUNK_INDEX, length);
        x = put_u64(x, w->chunk_t_first);
        x = put_u64(x, w->chunk_t_last);
        x = put_u64(x, start);
        x = put_u64(x, size);
        x = put_u32(x, 10u * present);
    }

    uint8_t *p = w->config.chunk;
    for (uint16_t c = 0; c < w->n_channels; c++) {
        const McapChannel *channel = &w->config.channels[c];
        const uint32_t n = channel->chunk_count;
        if (n == 0u) {
            continue;
        }
        if (indexed) {
            x = put_u16(x, (uint16_t)(c + 1u));
            x = put_u64(x, start + size + (uint64_t)(p - w->config.chunk));
        }
        p = put_prefix(p, OP_MESSAGE_INDEX, 2u + 4u + ENTRY * (uint64_t)n);
        p = put_u16(p, (uint16_t)(c + 1u));
        p = put_u32(p, ENTRY * n);
        uint32_t k = channel->first;
        for (uint32_t i = 0; i < n; i++) {
            const uint8_t *entry = entry_at(w, k);
            k = get_u32(entry + 12);
            memcpy(p, entry, 8);
            p = put_u64(p + 8, get_u32(entry + 8));
        }
    }
    const size_t index_size = (size_t)(p - w->config.chunk);
    if (indexed) {
        x = put_u64(x, index_size);
        x = put_u32(x, 0); /* not compressed */
        x = put_u64(x, size - CHUNK_HEAD);
        x = put_u64(x, size - CHUNK_HEAD);
        w->index_used = (size_t)(x - w->config.index);
    }
    send(w, w->config.chunk, index_size);
}

/* The CRC of the records in the chunk buffer. */
static uint32_t chunk_crc(const McapWriter *w)
{
    return mcap_crc_update(&w->crc_tables, w->crc_ahead, w->config.chunk + w->chunk_ahead,
                           w->chunk_used - w->chunk_ahead);
}

/* The head of the open chunk, with so many bytes of records. */
static void put_chunk_head(McapWriter *w, uint64_t size, uint32_t crc)
{
    uint8_t *p = put_prefix(w->config.chunk, OP_CHUNK, CHUNK_HEAD - PREFIX + size);
    p = put_u64(p, w->chunk_t_first);
    p = put_u64(p, w->chunk_t_last);
    p = put_u64(p, size);
    p = put_u32(p, crc);
    p = put_u32(p, 0); /* not compressed */
    put_u64(p, size);
}

/* Pass the open chunk to the sink. The n bytes of `tail` belong to its last record, and need no room in the buffer. */
static void end_chunk_with(McapWriter *w, const void *tail, size_t n)
{
    if (w->chunk_used == CHUNK_HEAD) {
        return;
    }
    const uint64_t size = (uint64_t)(w->chunk_used - CHUNK_HEAD) + n;
    uint32_t crc = chunk_crc(w);
    if (n > 0u) {
        crc = mcap_crc_update(&w->crc_tables, crc, tail, n);
    }
    const uint64_t start = w->position;
    put_chunk_head(w, size, crc);

    /* The CRC of the section continues with the CRC of the chunk, so that each byte is hashed once. */
    w->crc = mcap_crc_update(&w->crc_tables, w->crc, w->config.chunk, CHUNK_HEAD);
    w->crc = mcap_crc_join(w->crc, crc, size);
    deliver(w, w->config.chunk, w->chunk_used);
    deliver(w, tail, n);
    w->n_chunks++;
    index_chunk(w, start, CHUNK_HEAD + size);
    begin_chunk(w);
}

static void end_chunk(McapWriter *w)
{
    end_chunk_with(w, NULL, 0);
}

/* If the file has chunks: make room in the chunk buffer for one record. Ends the open chunk if necessary. */
static McapStatus make_room(McapWriter *w, uint64_t bytes)
{
    if (!chunked(w)) {
        return w->status;
    }
    if (bytes > w->config.chunk_size - CHUNK_HEAD) {
        return MCAP_TOO_LARGE;
    }
    if (bytes > chunk_free(w)) {
        end_chunk(w);
    }
    return w->status;
}

/* ---- records that are in the data section and again in the summary ---- */

static uint64_t schema_size(const McapSchema *s)
{
    return 2u + text_size(s->name) + text_size(SCHEMA_ENCODING) + text_size(s->text);
}

static void put_schema(McapWriter *w, uint16_t id)
{
    const McapSchema *s = &w->config.schemas[id - 1];
    put_record(w, OP_SCHEMA, schema_size(s));
    put_int(w, id, 2);
    put_text(w, s->name);
    put_text(w, SCHEMA_ENCODING);
    put_text(w, s->text);
}

static uint64_t channel_size(const McapChannel *c)
{
    return 2u + 2u + text_size(c->topic) + text_size(MESSAGE_ENCODING) + 4u + pairs_size(c->metadata, c->n_metadata);
}

static void put_channel(McapWriter *w, uint16_t id)
{
    const McapChannel *c = &w->config.channels[id - 1];
    put_record(w, OP_CHANNEL, channel_size(c));
    put_int(w, id, 2);
    put_int(w, c->schema, 2);
    put_text(w, c->topic);
    put_text(w, MESSAGE_ENCODING);
    put_pairs(w, c->metadata, c->n_metadata);
}

/* ---- the interface ---- */

static bool config_valid(const McapConfig *c)
{
    return c->write != NULL && (c->schemas != NULL || c->schemas_max == 0u) &&
           (c->channels != NULL || c->channels_max == 0u) && (c->index != NULL || c->index_size == 0u) &&
           (c->chunk_size == 0u ||
            (c->chunk != NULL && c->chunk_size >= MCAP_CHUNK_MIN && c->chunk_size <= MCAP_CHUNK_MAX));
}

McapStatus mcap_open(McapWriter *w, const McapConfig *config)
{
    memset(w, 0, sizeof *w);
    if (!config_valid(config)) {
        w->status = MCAP_CLOSED;
        return MCAP_BAD_ARGUMENT;
    }
    w->config = *config;
    w->index_floor = config->index_size;
    w->index_full = config->index_size == 0u;
    mcap_crc_init(&w->crc_tables);
    const char *profile = config->profile != NULL ? config->profile : "ros2";
    const char *library = config->library != NULL ? config->library : "fledge";
    put(w, MAGIC, sizeof MAGIC);
    put_record(w, OP_HEADER, text_size(profile) + text_size(library));
    put_text(w, profile);
    put_text(w, library);
    send_stage(w);
    begin_chunk(w);
    return w->status;
}

McapStatus mcap_add_schema(McapWriter *w, const char *name, const char *text, uint16_t *id)
{
    if (w->status != MCAP_OK) {
        return w->status;
    }
    if (name == NULL || text == NULL || id == NULL) {
        return MCAP_BAD_ARGUMENT;
    }
    for (uint16_t i = 0; i < w->n_schemas; i++) {
        if (strcmp(w->config.schemas[i].name, name) == 0) {
            *id = (uint16_t)(i + 1u);
            return strcmp(w->config.schemas[i].text, text) == 0 ? MCAP_OK : MCAP_BAD_ARGUMENT;
        }
    }
    if (w->n_schemas == w->config.schemas_max) {
        return MCAP_FULL;
    }
    const McapSchema schema = {name, text};
    const McapStatus status = make_room(w, PREFIX + schema_size(&schema));
    if (status != MCAP_OK) {
        return status;
    }
    w->config.schemas[w->n_schemas++] = schema;
    w->in_chunk = chunked(w);
    put_schema(w, w->n_schemas);
    w->in_chunk = false;
    send_stage(w);
    *id = w->n_schemas;
    return w->status;
}

McapStatus mcap_add_channel(McapWriter *w, const char *topic, uint16_t schema, McapOrder order, const McapPair *pairs,
                            size_t n, uint16_t *id)
{
    if (w->status != MCAP_OK) {
        return w->status;
    }
    if (topic == NULL || id == NULL || schema == 0u || schema > w->n_schemas || !pairs_valid(pairs, n)) {
        return MCAP_BAD_ARGUMENT;
    }
    for (uint16_t i = 0; i < w->n_channels; i++) {
        if (strcmp(w->config.channels[i].topic, topic) == 0) {
            return MCAP_BAD_ARGUMENT;
        }
    }
    if (w->n_channels == w->config.channels_max) {
        return MCAP_FULL;
    }
    McapChannel channel = {.topic = topic, .metadata = pairs, .n_metadata = n, .schema = schema};
    channel.little_endian = order == MCAP_ORDER_LITTLE || (order == MCAP_ORDER_NATIVE && little_endian_machine());
    const McapStatus status = make_room(w, PREFIX + channel_size(&channel));
    if (status != MCAP_OK) {
        return status;
    }
    w->config.channels[w->n_channels++] = channel;
    w->in_chunk = chunked(w);
    put_channel(w, w->n_channels);
    w->in_chunk = false;
    send_stage(w);
    *id = w->n_channels;
    return w->status;
}

/* Add the index entry of the next message to the list of its channel. */
static void add_entry(McapWriter *w, McapChannel *channel, uint64_t t)
{
    const uint32_t k = w->chunk_messages;
    uint8_t *entry = entry_at(w, k);
    put_u64(entry, t);
    put_u32(entry + 8, (uint32_t)(w->chunk_used - CHUNK_HEAD));
    put_u32(entry + 12, 0);
    if (channel->chunk_count == 0u) {
        channel->first = k;
    } else {
        put_u32(entry_at(w, channel->last) + 12, k);
    }
    channel->last = k;
    channel->chunk_count++;
    w->chunk_t_first = k == 0u || t < w->chunk_t_first ? t : w->chunk_t_first;
    w->chunk_t_last = t > w->chunk_t_last ? t : w->chunk_t_last;
    w->chunk_messages++;
}

McapStatus mcap_message(McapWriter *w, uint16_t channel, int64_t t_ns, uint32_t sequence, const void *bytes, size_t n)
{
    if (w->status != MCAP_OK) {
        return w->status;
    }
    if (channel == 0u || channel > w->n_channels || t_ns < 0 || (bytes == NULL && n > 0u)) {
        return MCAP_BAD_ARGUMENT;
    }
    McapChannel *c = &w->config.channels[channel - 1];
    const uint64_t t = (uint64_t)t_ns;
    const uint64_t length = MESSAGE_HEAD - PREFIX + CDR_HEAD + (uint64_t)n;

    /* In the stage, and so that the struct behind it is aligned: a simple memcpy() then copies words. */
    const size_t head_size = MESSAGE_HEAD + CDR_HEAD;
    uint8_t *const head = w->stage + 1;
    uint8_t *p = put_prefix(head, OP_MESSAGE, length);
    p = put_u16(p, channel);
    p = put_u32(p, sequence);
    p = put_u64(p, t);
    p = put_u64(p, t);
    p[0] = 0;
    p[1] = c->little_endian;
    p[2] = 0;
    p[3] = 0;

    if (chunked(w)) {
        /* A message beyond the buffer has a chunk of its own, which takes it from the caller's memory. */
        const bool fits = PREFIX + length + ENTRY <= w->config.chunk_size - CHUNK_HEAD;
        if (!fits) {
            end_chunk(w);
        }
        const McapStatus status = make_room(w, fits ? PREFIX + length + ENTRY : head_size + ENTRY);
        if (status != MCAP_OK) {
            return status;
        }
        add_entry(w, c, t);
        memcpy(w->config.chunk + w->chunk_used, head, head_size);
        w->chunk_used += head_size;
        if (!fits) {
            end_chunk_with(w, bytes, n);
        } else if (n > 0u) {
            memcpy(w->config.chunk + w->chunk_used, bytes, n);
            w->chunk_used += n;
        }
    } else if (n > sizeof w->stage - 1u - head_size) {
        send(w, head, head_size);
        send(w, bytes, n);
    } else {
        if (n > 0u) {
            memcpy(head + head_size, bytes, n);
        }
        send(w, head, head_size + n);
    }
    c->count++;
    w->t_first = w->n_messages == 0u || t < w->t_first ? t : w->t_first;
    w->t_last = t > w->t_last ? t : w->t_last;
    w->n_messages++;
    return w->status;
}

McapStatus mcap_metadata(McapWriter *w, const char *name, const McapPair *pairs, size_t n)
{
    if (w->status != MCAP_OK) {
        return w->status;
    }
    if (name == NULL || !pairs_valid(pairs, n)) {
        return MCAP_BAD_ARGUMENT;
    }
    const uint64_t start = w->position;
    put_record(w, OP_METADATA, text_size(name) + 4u + pairs_size(pairs, n));
    put_text(w, name);
    put_pairs(w, pairs, n);
    send_stage(w);
    w->n_metadata++;
    if (w->chunk_ahead > CHUNK_HEAD) { /* it overwrote the chunk, which now begins behind it */
        w->chunk_ahead = CHUNK_HEAD;
        w->crc_ahead = 0;
        (void)mcap_save(w);
    }

    const uint64_t length = 8u + 8u + text_size(name);
    if (PREFIX + length > w->index_floor - w->index_used) {
        w->index_full = true;
    }
    if (!w->index_full) {
        w->index_floor -= (size_t)(PREFIX + length);
        uint8_t *x = put_prefix(w->config.index + w->index_floor, OP_METADATA_INDEX, length);
        x = put_u64(x, start);
        x = put_u64(x, w->position - start);
        x = put_u32(x, (uint32_t)strlen(name));
        memcpy(x, name, strlen(name));
    }
    return w->status;
}

McapStatus mcap_flush(McapWriter *w)
{
    if (w->status == MCAP_OK && chunked(w)) {
        end_chunk(w);
    }
    return w->status;
}

McapStatus mcap_save(McapWriter *w)
{
    if (w->status != MCAP_OK || w->config.ahead == NULL || w->chunk_used == w->chunk_ahead) {
        return w->status;
    }
    const McapConfig *c = &w->config;
    w->crc_ahead = chunk_crc(w);
    put_chunk_head(w, w->chunk_used - CHUNK_HEAD, w->crc_ahead);
    /* The head last: a crash in between leaves a chunk that agrees with its head, and records behind it. */
    int error = c->ahead(c->user, w->chunk_ahead, c->chunk + w->chunk_ahead, w->chunk_used - w->chunk_ahead);
    if (error == 0) {
        error = c->ahead(c->user, 0, c->chunk, CHUNK_HEAD);
    }
    if (error != 0) {
        w->status = MCAP_WRITE_FAILED;
        w->sink_error = error;
    }
    w->chunk_ahead = w->chunk_used;
    return w->status;
}

McapMark mcap_mark(const McapWriter *w)
{
    McapMark mark = {w->position, 0, w->crc, 0};
    if (chunked(w)) {
        mark.records = w->chunk_used - CHUNK_HEAD;
        mark.crc = mcap_crc_join(w->crc, chunk_crc(w), mark.records);
    }
    return mark;
}

static void put_statistics(McapWriter *w)
{
    put_record(w, OP_STATISTICS, 8u + 2u + 4u * 4u + 2u * 8u + 4u + 10u * (uint64_t)w->n_channels);
    put_int(w, w->n_messages, 8);
    put_int(w, w->n_schemas, 2);
    put_int(w, w->n_channels, 4);
    put_int(w, 0, 4); /* attachments */
    put_int(w, w->n_metadata, 4);
    put_int(w, w->n_chunks, 4);
    put_int(w, w->t_first, 8);
    put_int(w, w->t_last, 8);
    put_int(w, 10u * (uint64_t)w->n_channels, 4);
    for (uint16_t c = 0; c < w->n_channels; c++) {
        put_int(w, c + 1u, 2);
        put_int(w, w->config.channels[c].count, 8);
    }
}

/* The summary's records, one group per operation code, and the offsets of the groups. */
static void put_summary(McapWriter *w)
{
    static const uint8_t GROUPS[5] = {OP_SCHEMA, OP_CHANNEL, OP_STATISTICS, OP_CHUNK_INDEX, OP_METADATA_INDEX};
    uint64_t begin[6];
    for (size_t g = 0; g < 5u; g++) {
        begin[g] = tell(w);
        switch (GROUPS[g]) {
        case OP_SCHEMA:
            for (uint16_t i = 0; i < w->n_schemas; i++) {
                put_schema(w, (uint16_t)(i + 1u));
            }
            break;
        case OP_CHANNEL:
            for (uint16_t i = 0; i < w->n_channels; i++) {
                put_channel(w, (uint16_t)(i + 1u));
            }
            break;
        case OP_STATISTICS: put_statistics(w); break;
        case OP_CHUNK_INDEX:
            if (!w->index_full) {
                put(w, w->config.index, w->index_used);
            }
            break;
        default:
            if (!w->index_full) {
                put(w, w->config.index + w->index_floor, w->config.index_size - w->index_floor);
            }
            break;
        }
    }
    begin[5] = tell(w);
    for (size_t g = 0; g < 5u; g++) {
        if (begin[g + 1] > begin[g]) {
            put_record(w, OP_SUMMARY_OFFSET, 1u + 8u + 8u);
            put(w, &GROUPS[g], 1);
            put_int(w, begin[g], 8);
            put_int(w, begin[g + 1] - begin[g], 8);
        }
    }
    put_record(w, OP_FOOTER, 8u + 8u + 4u);
    put_int(w, begin[0], 8);
    put_int(w, begin[5], 8);
}

McapStatus mcap_close(McapWriter *w)
{
    if (w->status != MCAP_OK) {
        return w->status;
    }
    if (chunked(w)) {
        end_chunk(w);
    }
    put_record(w, OP_DATA_END, 4u);
    put_int(w, w->crc, 4);
    send_stage(w);

    w->crc = 0;
    put_summary(w);
    send_stage(w);
    put_int(w, w->crc, 4);
    put(w, MAGIC, sizeof MAGIC);
    send_stage(w);
    if (w->status != MCAP_OK) {
        return w->status;
    }
    w->status = MCAP_CLOSED;
    return MCAP_OK;
}

const char *mcap_status_text(McapStatus status)
{
    switch (status) {
    case MCAP_OK: return "ok";
    case MCAP_WRITE_FAILED: return "the archive could not be written";
    case MCAP_FULL: return "no room for one more schema or channel";
    case MCAP_TOO_LARGE: return "a schema or channel is larger than the chunk buffer";
    case MCAP_BAD_ARGUMENT: return "bad argument";
    case MCAP_CLOSED: return "the archive is closed";
    default: return "unknown status";
    }
}
