/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of a link in a file that only its owner may read, for programs with an operating system. Each line
 *
 *     1 000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f
 *
 * is the id of a key, 1 to 65535, and its 16, 24 or 32 bytes in hex; # begins a comment.
 * `./fledge keys link FILE` writes it.
 *
 * Example:
 *
 *     AesGcmKey expanded[8];
 *     char why[200];
 *     AesGcmKeys keys = {expanded, key_file_read("link.keys", expanded, 8, why, sizeof why)};
 *     if (keys.n > 0) {
 *         const SdlsCipher cipher = aes_gcm(&keys); // for an association of sdls.h
 *     }
 */
#ifndef CCSDS_SECURITY_KEY_FILE_H
#define CCSDS_SECURITY_KEY_FILE_H

#include "ccsds/security/aes_gcm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Read all keys of a file. Returns their number, at most `room`; 0 and a text with the file, the line and what to do
 * in `why`, of `size` bytes, if the file or one of its lines is wrong. */
size_t key_file_read(const char *path, AesGcmKey *keys, size_t room, char *why, size_t size);

#ifdef __cplusplus
}
#endif

#endif
