/* SPDX-License-Identifier: Apache-2.0 */
/* Prints for each flight module, or the one that is named, a 64-bit FNV-1a hash of its outputs over random parameters
 * and inputs. Most of these are of a size that occurs in a low orbit, by their units; some have any bits. What there is
 * comes from the tables, so that a new module is hashed without a line. Equal hashes on two machines mean equal bits;
 * module_hash_test.py compares them. A line is
 *
 *     NAME HASH CHANGES       CHANGES: after how many inputs the outputs, but for their heads, were others than before
 */
#include "flight/math/attitude.h"
#include "flight/math/ieee.h"
#include "flight/msg/head.h"
#include "sim/table.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { SETS = 20, ROUNDS = 50, ROOM = 1 << 19 };

#define EPOCH INT64_C(827272800000000000) /* [ns] UTC since 2000-01-01T12:00:00, 86,400 s a day: March of 2026 */
#define STEP INT64_C(500000000)           /* [ns] */

extern const FledgeLibrary fledge_library_flight;

/* Sizes of fields in a low orbit; 1 for other units. */
static const struct {
    char unit[12];
    double size;
} SIZES[] = {
    {"m", 7e6},      {"m/s", 7.5e3},    {"m/s^2", 1e-3},   {"m^3/s^2", 4e14},    {"m^2/s^3", 1e-6},
    {"rad/s", 0.02}, {"rad/s^2", 0.01}, {"rad^2/s", 1e-8}, {"rad^2/s^3", 1e-12}, {"rad^2", 1e-6},
    {"T", 4e-5},     {"T^2/s", 1e-18},  {"N", 1.0},        {"N m", 0.01},        {"N m s", 0.1},
    {"kg m^2", 0.2}, {"A m^2", 0.4},    {"A", 5e-3},       {"1/s", 0.01},        {"s", 10.0},
};

static uint64_t state; /* of the numbers to come */
static uint64_t memory[ROOM / 8];

/* splitmix64 (Steele, Lea and Flood, 2014). */
static uint64_t random_bits(void)
{
    uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

static uint32_t below(uint32_t n)
{
    return (uint32_t)(random_bits() >> 32) % n;
}

/* Uniform in [0, 1). */
static double share(void)
{
    return (double)(random_bits() >> 11) * 0x1p-53;
}

static double size_of(const FledgeField *field)
{
    for (uint32_t i = 0; i < sizeof SIZES / sizeof *SIZES; i++) {
        if (strcmp(SIZES[i].unit, field->unit) == 0) {
            return SIZES[i].size;
        }
    }
    return 1.0;
}

/* At most the size of the field; a position without bounds reaches as far as the Sun, too. */
static double part_of(const FledgeField *field)
{
    static const double parts[] = {1.0, 1.0, 0.1, 0.01}, places[] = {1.0, 1.0, 1.0, 2e4};
    return (field->bounds == 0u && strcmp(field->unit, "m") == 0 ? places : parts)[below(4u)];
}

/* A number that the field's bounds allow, about 0 where they do. */
static double real_of(const FledgeField *field, double part)
{
    const double size = part * size_of(field);
    const int lo = (field->bounds & FLEDGE_HAS_LO) != 0, hi = (field->bounds & FLEDGE_HAS_HI) != 0;
    const double least = hi && field->hi - 2.0 * size < -size ? field->hi - 2.0 * size : -size;
    const double low = lo ? field->lo : least;
    const double high = hi && field->hi < low + 2.0 * size ? field->hi : low + 2.0 * size;
    return low + (high - low) * (0.05 + 0.9 * share());
}

/* A turn where it has no unit, else symmetric, positive definite, and the inertia of a body. */
static Mat3 matrix_of(const FledgeField *field)
{
    const double size = size_of(field);
    Vec3 sigma;
    Mat3 m;
    for (int i = 0; i < 3; i++) {
        sigma.v[i] = 2.0 * share() - 1.0;
    }
    if (strcmp(field->unit, "-") == 0) {
        return mrp_to_dcm(sigma);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            m.m[i][j] = m.m[j][i] = size * (i == j ? 1.0 + 0.3 * share() : 0.1 * share() - 0.05);
        }
    }
    return m;
}

static int64_t whole_of(const FledgeField *field, int64_t t, int64_t epoch)
{
    const int64_t lo = (field->bounds & FLEDGE_HAS_LO) != 0 ? (int64_t)field->lo : 0;
    if (field->type == FLEDGE_ENUM && field->values != NULL) {
        const uint32_t last = field->values->n - 1u;
        return field->values->values[strcmp(field->name, "quality") == 0 && below(8u) > 0u ? last : below(last + 1u)]
            .value;
    }
    switch (field->type) {
    case FLEDGE_I64: return strcmp(field->name, "t") == 0 ? t : epoch + t + (int64_t)below(2000000000u);
    case FLEDGE_U8: return below(8u) > 0u;
    case FLEDGE_I16:
    case FLEDGE_U16: return (int64_t)(random_bits() & 0x7fffu);
    default:
        return lo + (int64_t)below((field->bounds & FLEDGE_HAS_HI) != 0 && field->hi < (double)lo + 3.0
                                       ? (uint32_t)((int64_t)field->hi - lo) + 1u
                                       : 4u);
    }
}

/* Set the value of a field. bad: one of this many numbers gets any bits; 0: none. */
static void set(const FledgeField *field, uint8_t *at, int64_t t, int64_t epoch, uint32_t bad)
{
    const uint32_t width = field->type == FLEDGE_STRUCT ? field->sub->size : element_size(field->type);
    const int matrix = strcmp(field->ctype, "Mat3") == 0;
    const int unit_vector = strcmp(field->ctype, "Vec3") == 0 && strstr(field->doc, "unit vector") != NULL;
    const double part = part_of(field);
    if ((field->flags & FLEDGE_SPARE) != 0u || field->type == FLEDGE_CHAR) {
        return;
    }
    for (uint32_t place = 0; place < field->size; place += width) {
        for (uint32_t i = 0; field->type == FLEDGE_STRUCT && i < field->sub->n; i++) {
            set(&field->sub->fields[i], at + place + field->sub->fields[i].offset, t, epoch, bad);
        }
        if (matrix && place % sizeof(Mat3) == 0u) {
            const Mat3 m = matrix_of(field);
            memcpy(at + place, &m, sizeof m);
        }
        if (field->type == FLEDGE_F64 && !matrix) {
            const double x = real_of(field, part);
            memcpy(at + place, &x, sizeof x);
            if (unit_vector && place % sizeof(Vec3) == 2u * sizeof x) {
                Vec3 d;
                memcpy(&d, at + place - 2u * sizeof x, sizeof d);
                d = vec_unit(d);
                memcpy(at + place - 2u * sizeof x, &d, sizeof d);
            }
        } else if (field->type == FLEDGE_I64 || field->type == FLEDGE_U64) {
            const int64_t x = whole_of(field, t, epoch);
            memcpy(at + place, &x, sizeof x);
        } else if (field->type != FLEDGE_F64 && field->type != FLEDGE_STRUCT) {
            element_write(field->type, at + place, (double)whole_of(field, t, epoch));
        }
        if (bad != 0u && field->type != FLEDGE_STRUCT && below(bad) == 0u) {
            static const double worst[] = {0.0, -0.0, 5e-324, 1e-170, -1e160, 1.7e308, HUGE_VAL, -HUGE_VAL};
            uint64_t bits = below(2u) == 0u ? random_bits() : fm_bits(worst[below(8u)]);
            if (width == 8u) {
                memcpy(at + place, &bits, sizeof bits);
            } else if (field->type != FLEDGE_ENUM) {
                element_write(field->type, at + place, (double)(uint32_t)bits);
            }
        }
    }
}

static void set_group(const FledgeStruct *type, FledgeGroup group, int64_t t, int64_t epoch, uint32_t bad)
{
    for (uint32_t i = 0; i < type->n; i++) {
        if (type->fields[i].group == group) {
            set(&type->fields[i], (uint8_t *)memory + type->fields[i].offset, t, epoch, bad);
        }
    }
}

/* Byte by byte from the least significant on, whatever the byte order; all NaN count as one. */
static uint64_t hash_bits(uint64_t hash, uint64_t bits)
{
    for (int i = 0; i < 8; i++) {
        hash = (hash ^ (bits & 0xffu)) * 0x100000001b3u;
        bits >>= 8;
    }
    return hash;
}

/* heads: 0: without them. */
static uint64_t hash_field(uint64_t hash, const FledgeField *field, const uint8_t *at, int heads)
{
    const uint32_t width = field->type == FLEDGE_STRUCT ? field->sub->size : element_size(field->type);
    if ((field->flags & FLEDGE_SPARE) != 0u || (!heads && strcmp(field->ctype, "Head") == 0)) {
        return hash;
    }
    for (uint32_t place = 0; place < field->size; place += width) {
        if (field->type == FLEDGE_STRUCT) {
            for (uint32_t i = 0; i < field->sub->n; i++) {
                hash = hash_field(hash, &field->sub->fields[i], at + place + field->sub->fields[i].offset, heads);
            }
        } else if (width == 8u && field->type != FLEDGE_F64) {
            uint64_t bits;
            memcpy(&bits, at + place, sizeof bits);
            hash = hash_bits(hash, bits);
        } else {
            const double x = field->type == FLEDGE_CHAR ? at[place] : element_read(field->type, at + place);
            hash = hash_bits(hash, x == x ? fm_bits(x) : 0x7ff8000000000000u);
        }
    }
    return hash;
}

static uint64_t hash_outputs(uint64_t hash, const FledgeStruct *type, int heads)
{
    for (uint32_t i = 0; i < type->n; i++) {
        if (type->fields[i].group == FLEDGE_OUT) {
            hash = hash_field(hash, &type->fields[i], (const uint8_t *)memory + type->fields[i].offset, heads);
        }
    }
    return hash;
}

static void print_hash(const FledgeStruct *type)
{
    uint64_t hash = 0xcbf29ce484222325u, before = 0u;
    uint32_t changes = 0u;
    for (uint32_t i = 0; i < SETS; i++) {
        const int64_t epoch = i % 2u != 0u ? EPOCH : 0;
        memset(memory, 0, type->size);
        state = i;
        set_group(type, FLEDGE_PAR, 0, epoch, 0u);
        ((void (*)(void *))type->reset)(memory);
        for (uint32_t round = 0; round < ROUNDS; round++) {
            const int64_t t = STEP * round;
            state = 1000u + (i % 4u < 2u ? i : i * ROUNDS + round); /* in half of the sets the inputs stay */
            set_group(type, FLEDGE_IN, t, epoch, round % 5u == 4u ? 16u : 0u);
            ((void (*)(void *, Tick))type->update)(memory, (Tick){t, round > 0u ? STEP : 0});
            hash = hash_outputs(hash, type, 1);
            const uint64_t now = hash_outputs(0u, type, 0);
            changes += now != before;
            before = now;
        }
    }
    (void)printf("%s %08lx%08lx %u\n", type->name, (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu),
                 (unsigned)changes);
}

int main(int argc, char **argv)
{
    for (uint32_t i = 0; i < fledge_library_flight.n; i++) {
        const FledgeStruct *type = fledge_library_flight.structs[i];
        if (type->kind == FLEDGE_MODULE && (argc < 2 || strcmp(argv[1], type->name) == 0)) {
            if (type->size > ROOM) {
                (void)printf("%s has %" PRIu32 " bytes\n", type->name, type->size);
                return 1;
            }
            print_hash(type);
        }
    }
    return 0;
}
