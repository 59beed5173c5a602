/* SPDX-License-Identifier: Apache-2.0 */
#include "ccsds/security/aes_gcm.h"

/* The code for words of this machine. On x86-64 there are instructions for AES and GHASH, if the processor has them. */
#if UINTPTR_MAX > 0xFFFFFFFFu
static const br_block_ctr_class *aes(void)
{
    const br_block_ctr_class *fast = br_aes_x86ni_ctr_get_vtable();
    return fast != NULL ? fast : &br_aes_ct64_ctr_vtable; /* undecided: a processor has them or not */
}

static br_ghash ghash(void)
{
    const br_ghash fast = br_ghash_pclmul_get();
    return fast != NULL ? fast : br_ghash_ctmul64; /* undecided: a processor has them or not */
}
#else
static const br_block_ctr_class *aes(void)
{
    return &br_aes_ct_ctr_vtable;
}

static br_ghash ghash(void)
{
    return br_ghash_ctmul32;
}
#endif

int aes_gcm_expand(AesGcmKey *key, uint16_t id, const uint8_t *bytes, size_t n)
{
    if (n != 16 && n != 24 && n != 32) {
        return 0;
    }
    key->id = id;
    aes()->init(&key->aes.vtable, bytes, n);
    br_gcm_init(&key->gcm, &key->aes.vtable, ghash());
    return 1;
}

static int run(void *user, uint16_t id, const uint8_t vector[SDLS_VECTOR], const SdlsText *text, uint8_t tag[SDLS_TAG])
{
    const AesGcmKeys *keys = user;
    size_t i = 0;
    while (i < keys->n && keys->keys[i].id != id) {
        i++;
    }
    if (i == keys->n) {
        return 0;
    }
    br_gcm_context gcm = keys->keys[i].gcm;
    br_gcm_reset(&gcm, vector, SDLS_VECTOR);
    br_gcm_aad_inject(&gcm, text->head, text->head_size);
    if (!text->encrypt) {
        br_gcm_aad_inject(&gcm, text->data, text->n);
    }
    br_gcm_flip(&gcm);
    if (text->encrypt) {
        br_gcm_run(&gcm, !text->opening, text->data, text->n);
    }
    br_gcm_get_tag(&gcm, tag);
    return 1;
}

SdlsCipher aes_gcm(AesGcmKeys *keys)
{
    const SdlsCipher cipher = {run, keys};
    return cipher;
}
