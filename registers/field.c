/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/field.h"

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
    const int64_t span = (int64_t)mask(field);
    const int64_t low = field->is_signed ? -(span / 2) - 1 : 0;
    const int64_t high = field->is_signed ? span / 2 : span;
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
