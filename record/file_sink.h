/* SPDX-License-Identifier: Apache-2.0 */
/** A sink for mcap.h on POSIX: a file that gets its name only when it is complete.
 *
 *  The sink writes NAME.part, and renames it to NAME when the caller closes it as whole; this replaces an old file NAME
 *  in one step. After a failure or a crash, NAME.part stays, and is readable up to its last whole chunk, until the next
 *  sink of that name replaces it. One sink at a time writes NAME.part: it holds a lock (flock), which ends with the
 *  program. No symbolic link is followed. The writer does not include this header, because small targets have no
 *  files. */
#ifndef RECORD_FILE_SINK_H
#define RECORD_FILE_SINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef FILE_SINK_PATH_MAX
#define FILE_SINK_PATH_MAX 4096 /* smaller on small targets */
#endif

/** What tells whether a file has the same bytes so far. */
typedef struct FileMark {
    uint64_t size; ///< [bytes]
    uint32_t crc;  ///< of them
    uint32_t spare;
} FileMark;

typedef struct FileSink {
    int fd;
    int error;                     ///< errno of the first failure, else 0
    FileMark marked;               ///< the last mark
    char part[FILE_SINK_PATH_MAX]; ///< "NAME.part"
} FileSink;

/** Create NAME.part in place of that of an earlier failure. Returns 0 or errno: EBUSY if another sink writes it, ELOOP
 *  if it is a symbolic link, EEXIST if it is no regular file. */
int file_sink_open(FileSink *s, const char *name);

/** Go on with NAME.part of a program that ended, behind the bytes of its mark; what follows them is cut off. Returns 0
 *  or errno: ENOENT if it is not there, ENODATA if it does not begin with these bytes, others as file_sink_open. */
int file_sink_resume(FileSink *s, const char *name, FileMark mark);

/** The mark of all that was written, which the system has then. Returns 0 or errno. */
int file_sink_mark(FileSink *s, FileMark *mark);

/** McapConfig.write, with the FileSink as its user. Returns 0 or errno. */
int file_sink_write(void *sink, const void *bytes, size_t n);

/** McapConfig.ahead, with the FileSink as its user. Returns 0 or errno. */
int file_sink_ahead(void *sink, size_t offset, const void *bytes, size_t n);

/** Close the file; with `whole`, and if no call has failed, rename it to NAME. Returns the first errno: ESTALE if
 *  NAME.part was deleted or replaced meanwhile. */
int file_sink_close(FileSink *s, bool whole);

#ifdef __cplusplus
}
#endif
#endif
