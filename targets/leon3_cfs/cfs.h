/* SPDX-License-Identifier: Apache-2.0 */
/* The pocket cFE on a LEON3 board, for `fledge fly --on leon3-cfs`. */
#ifndef TARGETS_LEON3_CFS_H
#define TARGETS_LEON3_CFS_H

#include "common_types.h"

#include <stddef.h>

/** A file that is there from the start: `fledge fly` writes the list. */
typedef struct Leon3File {
    const char *path; ///< "/cf/cfe_es_startup.scr"
    const uint8 *bytes;
    size_t size;
} Leon3File;

extern const Leon3File leon3_files[];
extern const uint32 leon3_files_n;

#endif
