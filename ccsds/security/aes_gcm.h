/* SPDX-License-Identifier: Apache-2.0 */
/* AES-GCM for frame security, by BearSSL: without a heap, and in a time that does not depend on keys and data. */
#ifndef CCSDS_SECURITY_AES_GCM_H
#define CCSDS_SECURITY_AES_GCM_H

#include "ccsds/sdls.h"

#include <bearssl/bearssl_aead.h> /* bearssl.h has inline code that converts without a cast */

#ifdef __cplusplus
extern "C" {
#endif

enum { AES_GCM_KEY_MAX = 32 };

/** A key, expanded. */
typedef struct AesGcmKey {
    uint16_t id;
    br_aes_gen_ctr_keys aes;
    br_gcm_context gcm; ///< as it is before a frame
} AesGcmKey;

/** The user of the cipher: the caller's memory. */
typedef struct AesGcmKeys {
    const AesGcmKey *keys;
    size_t n;
} AesGcmKeys;

/** Expand a key of n bytes: 16, 24 or 32. Returns 0 if it is of another size. The key stays where it is. */
int aes_gcm_expand(AesGcmKey *key, uint16_t id, const uint8_t *bytes, size_t n);

/** keys: must outlive the cipher. */
SdlsCipher aes_gcm(AesGcmKeys *keys);

#ifdef __cplusplus
}
#endif

#endif
