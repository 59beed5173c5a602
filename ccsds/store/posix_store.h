/* SPDX-License-Identifier: Apache-2.0 */
/* A store of files below one folder of a POSIX system. No name leads out of it: absolute ones, `.`, `..` and symbolic
 * links, also those that stay inside, are refused. One entity uses a folder. */
#ifndef CCSDS_STORE_POSIX_STORE_H
#define CCSDS_STORE_POSIX_STORE_H

#include "ccsds/cfdp.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct PosixStore {
    int root;       ///< the folder
    uint64_t limit; ///< [bytes] of the largest file; more is CFDP_FULL
    uint64_t room;  ///< [bytes] that may still be written, as the user last set; none left is CFDP_FULL
} PosixStore;

/** Open the folder, and fill `store`. Returns 0 with errno if there is no such folder. */
int posix_store_open(PosixStore *posix, const char *folder, uint64_t limit, CfdpStore *store);

void posix_store_close(PosixStore *posix);

#ifdef __cplusplus
}
#endif

#endif
