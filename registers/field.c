/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/field.h"

#include <string.h>

static uint32_t mask(const RegisterField *field)
{
    return UINT32_MAX >> (32u - field->bits);
}

int64_t register_field_count(const RegisterField *field, uint32_t word)
{
    const int64_t raw = (int64_t)((word >> field->lsb) & mask(field));
    const int64_t half = (int64_t)1 << (field->bits - 1u);
    return field->is_signed && raw >= half ? raw - 2 * half : raw;
}

uint32_t register_field_place(const RegisterField *field, uint32_t word, int64_t count)
{
    const uint32_t m = mask(field);
    return (word & ~(m << field->lsb)) | (((uint32_t)count & m) << field->lsb);
}

double register_field_value(const RegisterField *field, int64_t count)
{
    return field->offset + field->scale * (double)count;
}

int64_t register_field_quantise(const RegisterField *field, double value, int *saturated)
{
    const uint32_t bits = field->bits - (uint32_t)(field->is_signed != 0u);
    const int64_t high = bits >= 63u ? INT64_MAX : ((int64_t)1 << bits) - 1;
    const int64_t low = field->is_signed ? -high - 1 : 0;
    const double x = (value - field->offset) / field->scale;
    /* Compared with halves, which are exact, before a conversion that could overflow. */
    const int below = !(x > (double)low - 0.5);
    const int above = x >= (double)high + 0.5;
    if (saturated) {
        *saturated = below || above;
    }
    if (below || above) {
        return above ? high : low;
    }
    /* The fraction of a double is exact; adding one half to 0.49999999999999994 is not. */
    const int64_t whole = (int64_t)x;
    const double fraction = x - (double)whole;
    return whole + (fraction >= 0.5) - (fraction <= -0.5);
}

/* The bits of a number of 1, 2, 4 or 8 bytes. */
static uint64_t load(const RegisterField *field, const uint8_t *p)
{
    const uint32_t n = field->bits / 8u;
    uint64_t raw = 0u;
    for (uint32_t k = 0u; k < n; k++) {
        raw = raw << 8 | p[field->little_endian ? n - 1u - k : k];
    }
    return raw;
}

static void store(const RegisterField *field, uint8_t *p, uint64_t raw)
{
    const uint32_t n = field->bits / 8u;
    for (uint32_t k = n; k-- > 0u; raw >>= 8) {
        p[field->little_endian ? n - 1u - k : k] = (uint8_t)raw;
    }
}

/* A number with the scale 1 passes as it is: adding an offset of 0 would lose the sign of -0. */
static int is_plain(const RegisterField *field)
{
    return field->scale == 1.0 && field->offset == 0.0;
}

double register_field_read(const RegisterField *field, const void *packet, uint32_t i)
{
    const uint64_t raw = load(field, (const uint8_t *)packet + field->at + i * (field->bits / 8u));
    double x;
    if (!field->is_float) {
        const uint64_t sign = (uint64_t)1 << (field->bits - 1u);
        x = field->is_signed ? (double)(int64_t)((raw ^ sign) - sign) : (double)raw;
    } else if (field->bits == 64u) {
        memcpy(&x, &raw, sizeof x);
    } else {
        const uint32_t half = (uint32_t)raw;
        float f;
        memcpy(&f, &half, sizeof f);
        x = f;
    }
    return is_plain(field) ? x : field->offset + field->scale * x;
}

int register_field_write(const RegisterField *field, void *packet, uint32_t i, double value)
{
    uint8_t *p = (uint8_t *)packet + field->at + i * (field->bits / 8u);
    uint64_t raw;
    int saturated = 0;
    if (!field->is_float) {
        raw = (uint64_t)register_field_quantise(field, value, &saturated);
    } else {
        const double x = is_plain(field) ? value : (value - field->offset) / field->scale;
        if (field->bits == 64u) {
            memcpy(&raw, &x, sizeof raw);
        } else {
            const float f = (float)x;
            uint32_t half;
            memcpy(&half, &f, sizeof half);
            raw = half;
        }
    }
    store(field, p, raw);
    return saturated;
}
