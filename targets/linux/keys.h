/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of a mission's secured link of frames. */
#ifndef TARGETS_LINUX_KEYS_H
#define TARGETS_LINUX_KEYS_H

#include "ccsds/sdls.h"

/** Read them from a file (ccsds/security/key_file.h). since: as of SdlsProvider. Returns NULL, and why in `why`, if it
 * has none. */
const SdlsProvider *keys_read(const char *path, int64_t since, char *why, size_t size);

#endif
