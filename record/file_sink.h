/* SPDX-License-Identifier: Apache-2.0 */
/** A sink for mcap.h on POSIX: a file that has its name only when it is whole.
 *
 *  Bytes go to NAME.part, which becomes NAME when it is closed as whole; what stood at NAME before
 *  is replaced in one step. After a failure, or a crash, NAME.part stays and can be read up to its
 *  last whole chunk. Kept apart from the writer: small targets have no files. */
#ifndef RECORD_FILE_SINK_H
#define RECORD_FILE_SINK_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef FILE_SINK_PATH_MAX
#define FILE_SINK_PATH_MAX 4096 /* less where there is little memory */
#endif

typedef struct FileSink {
    int fd;
    int error;                     ///< errno of the first failure, else 0
    char part[FILE_SINK_PATH_MAX]; ///< "NAME.part"
} FileSink;

/** Create NAME.part, or empty the one that an earlier failure left. Returns 0 or errno. */
int file_sink_open(FileSink *s, const char *name);

/** McapConfig.write, with the FileSink as its user. Returns 0 or errno. */
int file_sink_write(void *sink, const void *bytes, size_t n);

/** Close; `whole` gives the file its name, unless something failed. Returns the first errno. */
int file_sink_close(FileSink *s, bool whole);

#ifdef __cplusplus
}
#endif
#endif
