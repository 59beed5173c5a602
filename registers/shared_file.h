/* SPDX-License-Identifier: Apache-2.0 */
/* Boards in a file that two processes map: the models' side creates it, flight's side attaches. It needs POSIX. On
 * Linux a futex wakes the other side; elsewhere the waiting side polls every 50 microseconds. A lock shows whether the
 * other side lives. No heap.
 *
 * No file stays behind: the peer that attaches removes the name once it has mapped the file, and the
 * kernel drops map and locks of a process that ends, after kill -9 too. If a creator is killed before
 * a peer attaches, the next creator of that name finds the file unlocked and replaces it. Without a
 * path the file has no name: a child attaches to "/dev/fd/N" of the descriptor that it inherits. */
#ifndef REGISTERS_SHARED_FILE_H
#define REGISTERS_SHARED_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "registers/window.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum RegisterFileStatus {
    REGISTER_FILE_OK = 0,
    REGISTER_FILE_RANG,    ///< wait: the other side rang
    REGISTER_FILE_TIMEOUT, ///< wait: it did not ring in time
    REGISTER_FILE_GONE,    ///< wait: the other side has ended
    REGISTER_FILE_NOT_YET, ///< attach: there is no file of a living creator, or it is not ready
    REGISTER_FILE_IN_USE,  ///< create: another creator lives; attach: another peer has attached
    REGISTER_FILE_OTHER,   ///< attach: the file has other boards or another version
    REGISTER_FILE_FAILED   ///< the system refused: see error
} RegisterFileStatus;

/** The end of one side. Callers read only fd and error. */
typedef struct RegisterFile {
    int fd;    ///< of the file; not kept open across exec
    int error; ///< errno of REGISTER_FILE_FAILED
    uint32_t side;
    uint32_t seen; ///< the rings of the other side until the last wait
    size_t size;
    volatile uint32_t *map;
    char path[256]; ///< the name to remove, or empty
} RegisterFile;

/** Create the file with all memory 0, and make the n boards' windows, which ring the other side.
 *  path NULL: without a name. *f must stay where it is until register_file_close. */
RegisterFileStatus register_file_create(RegisterFile *f, const char *path, const RegisterBoard *const *boards,
                                        uint32_t n, RegisterWindow *windows);

/** Attach to a file of the same boards in the same order, and remove its name. It closes the descriptor of a
 *  "/dev/fd/N", because the creator's locks would live on with it. */
RegisterFileStatus register_file_attach(RegisterFile *f, const char *path, const RegisterBoard *const *boards,
                                        uint32_t n, RegisterWindow *windows);

/** Unmap, and remove the name if it is still there. */
void register_file_close(RegisterFile *f);

/** Wait until the other side rings after the last call that returned REGISTER_FILE_RANG, at most timeout_ns. */
RegisterFileStatus register_file_wait(RegisterFile *f, int64_t timeout_ns);

/** Whether the other side has attached, and lives. */
int register_file_peer_lives(const RegisterFile *f);

/** A status in words. */
const char *register_file_status_text(RegisterFileStatus status);

#ifdef __cplusplus
}
#endif

#endif
