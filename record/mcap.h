/* SPDX-License-Identifier: Apache-2.0 */
/** The run archive: an MCAP file (https://mcap.dev/spec) with `ros2msg` schemas and CDR messages.
 *
 *  One writer for every target: C99, without heap, operating system or static data. The caller provides all memory and
 *  a callback for the output. The same calls give the same bytes on every machine.
 *
 *      magic  Header  [ Chunk MessageIndex* | Metadata ]*  DataEnd          data section
 *      Schema* Channel* Statistics ChunkIndex* MetadataIndex*               summary
 *      SummaryOffset*  Footer  magic
 *
 *  - With a chunk buffer, the writer collects schemas, channels and messages in chunks, each with its own CRC and
 *    index.
 *    Readers can seek, and a damaged or truncated file is readable up to its last whole chunk. Without a chunk buffer
 *    (small targets), the writer writes each record at once, and a truncated file is readable up to its last record.
 *  - A message is its C struct's bytes behind a 4-byte CDR header with the byte order. That
 *    is CDR exactly because no message struct has padding.
 *  - log_time = publish_time = simulated time [ns]; no wall-clock time, host or path is written.
 *
 *  The layout of the chunk buffer, which also holds the index entries of the messages:
 *
 *      | 49 bytes for the chunk's header | records -->  free  <-- 16-byte index entries |
 *
 *  Memory:  schemas, channels: one entry each.  chunk: 0, or MCAP_CHUNK_MIN bytes to 1 GiB; each schema and channel
 *  must fit in, a larger message has a chunk of its own.  index: 73 + 10 x channels bytes per chunk, 29 + name per
 *  metadata record.
 *  When `index` is full, the file stays valid and complete, but its summary has no chunk index at all, because a
 *  partial index would hide the other chunks: readers scan the file. `index_full` is then true.
 *
 * Example:
 *
 *     static McapWriter writer;
 *     static McapSchema schemas[1];
 *     static McapChannel channels[1];
 *
 *     static McapStatus record(McapWrite write, void *file, int64_t t, const double *level)
 *     {
 *         const McapConfig config = {.write = write, .user = file, .schemas = schemas, .channels = channels,
 *                                    .schemas_max = 1, .channels_max = 1};
 *         uint16_t schema, channel;
 *         mcap_open(&writer, &config);
 *         mcap_add_schema(&writer, "fledge/msg/Level", "float64 level\n", &schema);
 *         mcap_add_channel(&writer, "/tank/level", schema, MCAP_ORDER_NATIVE, NULL, 0, &channel);
 *         mcap_message(&writer, channel, t, 1, level, sizeof *level);
 *         return mcap_close(&writer);
 *     }
 */
#ifndef RECORD_MCAP_H
#define RECORD_MCAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "record/mcap_crc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MCAP_CHUNK_MIN ((size_t)1024)
#define MCAP_CHUNK_MAX ((size_t)1 << 30)

typedef enum McapStatus {
    MCAP_OK = 0,
    MCAP_WRITE_FAILED, ///< the sink failed: every later call does nothing and returns this
    MCAP_FULL,         ///< no room for one more schema or channel; the file is not touched
    MCAP_TOO_LARGE,    ///< the schema or channel does not fit the chunk buffer; the file is not touched
    MCAP_BAD_ARGUMENT, ///< unknown id, negative time, null, name in use; the file is not touched
    MCAP_CLOSED        ///< the file was closed before
} McapStatus;

/** The byte order of a channel's message structs. */
typedef enum McapOrder {
    MCAP_ORDER_NATIVE = 0, ///< that of the machine that runs the writer
    MCAP_ORDER_LITTLE,
    MCAP_ORDER_BIG
} McapOrder;

/** Take n bytes in order; 0 for success, else an error code of the sink's own (never 0). */
typedef int (*McapWrite)(void *user, const void *bytes, size_t n);

/** Take n bytes ahead, for a place `offset` bytes behind all that McapWrite has taken; later calls of McapWrite replace
 *  them. Returns as McapWrite. */
typedef int (*McapAhead)(void *user, size_t offset, const void *bytes, size_t n);

typedef struct McapPair {
    const char *key;
    const char *value;
} McapPair;

/** A schema. Private to the writer, which uses it until close. */
typedef struct McapSchema {
    const char *name;
    const char *text;
} McapSchema;

/** A channel. Private to the writer, which uses it until close. */
typedef struct McapChannel {
    const char *topic;
    const McapPair *metadata;
    size_t n_metadata;
    uint64_t count;       ///< messages in the file
    uint32_t chunk_count; ///< messages in the open chunk
    uint32_t first;       ///< their first and last index entry
    uint32_t last;
    uint16_t schema;
    uint8_t little_endian;
} McapChannel;

typedef struct McapConfig {
    McapWrite write;
    McapAhead ahead;       ///< null: the open chunk reaches the sink when it ends
    void *user;            ///< the first argument of both
    const char *profile;   ///< null: "ros2"
    const char *library;   ///< null: "fledge"
    McapSchema *schemas;   ///< memory for schemas_max entries
    McapChannel *channels; ///< memory for channels_max entries
    uint8_t *chunk;        ///< memory for chunk_size bytes
    uint8_t *index;        ///< memory for index_size bytes
    size_t chunk_size;     ///< [bytes] 0: unchunked
    size_t index_size;     ///< [bytes]
    uint16_t schemas_max;
    uint16_t channels_max;
} McapConfig;

/** The state of one open file. Read `status`, `sink_error`, `index_full`; leave the rest alone. */
typedef struct McapWriter {
    McapStatus status; ///< stays MCAP_WRITE_FAILED or MCAP_CLOSED
    int sink_error;    ///< the error code of the sink
    bool index_full;   ///< `index` had no room: the file must be scanned

    McapConfig config;
    uint16_t n_schemas;
    uint16_t n_channels;
    uint32_t n_metadata;
    uint32_t n_chunks;
    uint64_t n_messages;
    uint64_t t_first; ///< [ns] earliest and latest message of the file
    uint64_t t_last;

    uint64_t position; ///< bytes the sink has taken
    uint32_t crc;      ///< of the section's bytes so far

    bool in_chunk; ///< put() appends to the chunk; else it sends to the sink
    size_t chunk_used;
    uint32_t chunk_messages;
    uint64_t chunk_t_first;
    uint64_t chunk_t_last;
    size_t chunk_ahead; ///< end of what the sink has of the open chunk,
    uint32_t crc_ahead; ///< and the CRC of its records

    size_t index_used;  ///< end of the ChunkIndex records, which begin at the start of `index`
    size_t index_floor; ///< start of the MetadataIndex records, which end at the end of `index`

    size_t stage_used;
    uint8_t stage[512]; ///< collects the fields of a short record for one call of the sink
    McapCrc crc_tables;
} McapWriter;

/** Begin a file. The writer uses the memory in `config` until mcap_close. */
McapStatus mcap_open(McapWriter *w, const McapConfig *config);

/** Declare a message type: its ROS 2 name ("fledge/msg/AttError") and the text of its definition.
 *  Both strings must live until mcap_close, which writes them again. A second call with the same name and text returns
 *  the same id; with another text, MCAP_BAD_ARGUMENT. */
McapStatus mcap_add_schema(McapWriter *w, const char *name, const char *text, uint16_t *id);

/** Declare a topic of its own name ("/flight/tracking/error"), with n key/value pairs (may be 0).
 *  Strings and pairs must live until mcap_close. */
McapStatus mcap_add_channel(McapWriter *w, const char *topic, uint16_t schema, McapOrder order, const McapPair *pairs,
                            size_t n, uint16_t *id);

/** Record the n bytes of a message struct at the simulated time t_ns >= 0. */
McapStatus mcap_message(McapWriter *w, uint16_t channel, int64_t t_ns, uint32_t sequence, const void *bytes, size_t n);

/** Record n key/value pairs about the run under a name. Keys must differ. The writer keeps no pointer. */
McapStatus mcap_metadata(McapWriter *w, const char *name, const McapPair *pairs, size_t n);

/** End the open chunk, and pass it to the sink. */
McapStatus mcap_flush(McapWriter *w);

/** Pass what is new in the open chunk to the sink ahead of the chunk's end, so that a crash does not lose it: the file
 *  then ends with a chunk that is whole. The finished file has the same bytes as without. */
McapStatus mcap_save(McapWriter *w);

/** What tells whether two files have the same bytes so far. */
typedef struct McapMark {
    uint64_t position; ///< [bytes] in front of the open chunk
    uint64_t records;  ///< [bytes] of the records in the open chunk
    uint32_t crc;      ///< of both
    uint32_t spare;
} McapMark;

McapMark mcap_mark(const McapWriter *w);

/** Complete the file. Returns the first failure of the sink, if it failed: then the bytes that it has taken are a
 *  readable, truncated file. */
McapStatus mcap_close(McapWriter *w);

/** A status in words. */
const char *mcap_status_text(McapStatus status);

#ifdef __cplusplus
}
#endif
#endif
