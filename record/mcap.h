/* SPDX-License-Identifier: Apache-2.0 */
/** The run archive: an MCAP file (https://mcap.dev/spec) with `ros2msg` schemas and CDR messages.
 *
 *  One writer for every target: C99, no heap, no OS, no static data. All memory is the caller's,
 *  output goes through a callback, and the same calls give the same bytes on every machine.
 *
 *      magic  Header  [ Chunk MessageIndex* | Metadata ]*  DataEnd          data section
 *      Schema* Channel* Statistics ChunkIndex* MetadataIndex*               summary
 *      SummaryOffset*  Footer  magic
 *
 *  - With a chunk buffer, schemas, channels and messages are gathered in chunks, each with its own
 *    CRC and index: readers seek, and a damaged or truncated file is good up to its last whole
 *    chunk. Without one, records go out one by one (small targets): the last whole record is good.
 *  - A message is its C struct's bytes behind a 4-byte CDR header with the byte order. That
 *    is CDR exactly because no message struct has padding.
 *  - log_time = publish_time = simulated time [ns]; no wall-clock time, host or path is written.
 *
 *  What the chunk buffer holds, so that nothing else is needed per message:
 *
 *      | 49 bytes for the chunk's header | records -->  free  <-- 16-byte index entries |
 *
 *  Memory:  schemas, channels: one entry each.  chunk: 0, or MCAP_CHUNK_MIN bytes to 1 GiB; a
 *  record must fit in.  index: 73 + 10 x channels bytes per chunk, 29 + name per metadata record.
 *  When `index` is full, the file stays valid and whole, but its summary then holds no chunk index
 *  at all (for a partial one would hide the rest): readers scan it, and `index_full` says so.
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
    MCAP_WRITE_FAILED, ///< the sink failed: from then on every call does nothing and returns this
    MCAP_FULL,         ///< no room for one more schema or channel; the file is not touched
    MCAP_TOO_LARGE,    ///< the record does not fit the chunk buffer; the file is not touched
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

typedef struct McapPair {
    const char *key;
    const char *value;
} McapPair;

/** Of a schema, kept until close. Private to the writer. */
typedef struct McapSchema {
    const char *name;
    const char *text;
} McapSchema;

/** Of a channel, kept until close. Private to the writer. */
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
    void *user;            ///< handed to write
    const char *profile;   ///< null: "ros2"
    const char *library;   ///< null: "fledge"
    McapSchema *schemas;   ///< room for schemas_max
    McapChannel *channels; ///< room for channels_max
    uint8_t *chunk;        ///< room for chunk_size bytes
    uint8_t *index;        ///< room for index_size bytes
    size_t chunk_size;     ///< [bytes] 0: unchunked
    size_t index_size;     ///< [bytes]
    uint16_t schemas_max;
    uint16_t channels_max;
} McapConfig;

/** The state of one open file. Read `status`, `sink_error`, `index_full`; leave the rest alone. */
typedef struct McapWriter {
    McapStatus status; ///< MCAP_WRITE_FAILED or MCAP_CLOSED once they happened
    int sink_error;    ///< what the sink returned when it failed
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

    bool in_chunk; ///< where put() goes: into the chunk, or by way of the stage to the sink
    size_t chunk_used;
    uint32_t chunk_messages;
    uint64_t chunk_t_first;
    uint64_t chunk_t_last;

    size_t index_used;  ///< ChunkIndex records, from the start of `index` up
    size_t index_floor; ///< MetadataIndex records, from its end down

    size_t stage_used;
    uint8_t stage[512]; ///< makes one call of the sink out of a short record's fields
    McapCrc crc_tables;
} McapWriter;

/** Begin a file. The memory that `config` names is the writer's until mcap_close. */
McapStatus mcap_open(McapWriter *w, const McapConfig *config);

/** Declare a message type: its ROS 2 name ("fledge/msg/AttError") and the text of its definition.
 *  Both strings must live until mcap_close, which writes them again. The same name and text once
 *  more give the same id; the same name with another text is MCAP_BAD_ARGUMENT. */
McapStatus mcap_add_schema(McapWriter *w, const char *name, const char *text, uint16_t *id);

/** Declare a topic of its own name ("/flight/tracking/error"), with n key/value pairs (may be 0).
 *  Strings and pairs must live until mcap_close. */
McapStatus mcap_add_channel(McapWriter *w, const char *topic, uint16_t schema, McapOrder order, const McapPair *pairs,
                            size_t n, uint16_t *id);

/** Record the n bytes of a message struct at the simulated time t_ns >= 0. */
McapStatus mcap_message(McapWriter *w, uint16_t channel, int64_t t_ns, uint32_t sequence, const void *bytes, size_t n);

/** Record n key/value pairs about the run under a name. Keys must differ. No pointer is kept. */
McapStatus mcap_metadata(McapWriter *w, const char *name, const McapPair *pairs, size_t n);

/** Hand the open chunk to the sink now, so that a later crash cannot take it. */
McapStatus mcap_flush(McapWriter *w);

/** Complete the file. Returns the first failure of the sink, if there was one; the bytes written
 *  until then are a readable, truncated file. */
McapStatus mcap_close(McapWriter *w);

/** A status in words. */
const char *mcap_status_text(McapStatus status);

#ifdef __cplusplus
}
#endif
#endif
