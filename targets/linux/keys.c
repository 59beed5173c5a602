/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/linux/keys.h"

#include "ccsds/security/key_file.h"

enum { KEYS_MAX = 16 };

const SdlsProvider *keys_read(const char *path, int64_t since, char *why, size_t size)
{
    static AesGcmKey expanded[KEYS_MAX];
    static AesGcmKeys keys = {expanded, 0};
    static SdlsProvider provider;
    keys.n = key_file_read(path, expanded, KEYS_MAX, why, size);
    provider.cipher = aes_gcm(&keys);
    provider.functions = &sdls_functions;
    provider.since = (uint64_t)since;
    return keys.n != 0 ? &provider : NULL;
}
