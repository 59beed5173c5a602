/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/mission_check.h"

#include <string.h>

#define READ(ctype)                                                                                                    \
    {                                                                                                                  \
        ctype v;                                                                                                       \
        memcpy(&v, p, sizeof v);                                                                                       \
        return (double)v;                                                                                              \
    }

/* The i-th number, as a double. */
static double number(const MissionRule *rule, const uint8_t *block, uint32_t i)
{
    static const uint8_t sizes[] = {8u, 4u, 1u, 1u, 2u, 2u, 4u, 4u, 8u, 8u};
    const uint8_t *p = block + rule->offset + (size_t)i * sizes[rule->number];
    switch (rule->number) {
    case MISSION_F64: READ(double)
    case MISSION_F32: READ(float)
    case MISSION_I8: READ(int8_t)
    case MISSION_U8: READ(uint8_t)
    case MISSION_I16: READ(int16_t)
    case MISSION_U16: READ(uint16_t)
    case MISSION_I32: READ(int32_t)
    case MISSION_U32: READ(uint32_t)
    case MISSION_I64: READ(int64_t)
    case MISSION_U64: READ(uint64_t)
    }
    return 0.0;
}

static int is_within(const MissionRule *rule, double x)
{
    const uint32_t f = rule->flags;
    if ((f & MISSION_HAS_LOW) != 0u && !((f & MISSION_LOW_OPEN) != 0u ? x > rule->low : x >= rule->low)) {
        return 0;
    }
    return (f & MISSION_HAS_HIGH) == 0u || ((f & MISSION_HIGH_OPEN) != 0u ? x < rule->high : x <= rule->high);
}

/* Whether m + shift has only positive eigenvalues: Sylvester's criterion. */
static int is_positive_definite(double (*m)[3], double shift)
{
    const double a = m[0][0] + shift, b = m[1][1] + shift, c = m[2][2] + shift;
    const double minor = a * b - m[0][1] * m[1][0];
    const double determinant = a * (b * c - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * c - m[1][2] * m[2][0]) +
                               m[0][2] * (m[1][0] * m[2][1] - b * m[2][0]);
    return a > 0.0 && minor > 0.0 && determinant > 0.0;
}

static double magnitude(double x)
{
    return x < 0.0 ? -x : x;
}

/* Symmetric, positive definite by more than rounding, and no principal moment exceeds the sum of the
 * other two, which is: trace/2 - I has no negative eigenvalue. */
static int is_inertia(double (*m)[3])
{
    const double trace = m[0][0] + m[1][1] + m[2][2];
    double rest[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            if (magnitude(m[i][j] - m[j][i]) > 1e-9 * magnitude(trace)) {
                return 0;
            }
            rest[i][j] = (i == j ? 0.5 * trace : 0.0) - m[i][j];
        }
    }
    return is_positive_definite(m, -1e-12 * trace) && is_positive_definite(rest, 1e-9 * trace);
}

/* The first number of a field that breaks its rule, or n. */
static uint32_t broken(const MissionRule *rule, const uint8_t *block)
{
    uint32_t n = rule->n;
    if (rule->rows_at != MISSION_ALL) {
        uint32_t rows;
        memcpy(&rows, block + rule->rows_at, sizeof rows);
        n = rows < n / rule->row ? rows * rule->row : n;
    }
    for (uint32_t i = 0u; i < n; i++) {
        const double x = number(rule, block, i);
        if (x - x != 0.0 || !is_within(rule, x)) { /* of what is not finite, the difference is no number */
            return i;
        }
    }
    if ((rule->flags & MISSION_NON_ZERO) != 0u) {
        const uint32_t vector = rule->row == 3u ? 3u : 1u;
        for (uint32_t i = 0u; i + vector <= n; i += vector) {
            uint32_t zeros = 0u;
            for (uint32_t k = 0u; k < vector; k++) {
                zeros += number(rule, block, i + k) == 0.0;
            }
            if (zeros == vector) {
                return i;
            }
        }
    }
    if ((rule->flags & MISSION_INERTIA) != 0u) {
        double m[3][3];
        memcpy(m, block + rule->offset, sizeof m);
        return is_inertia(m) ? rule->n : 0u;
    }
    return rule->n;
}

const MissionRule *mission_check(const MissionRule *rules, uint32_t n, const void *block, uint32_t *element)
{
    for (uint32_t i = 0u; i < n; i++) {
        *element = broken(&rules[i], block);
        if (*element < rules[i].n) {
            return &rules[i];
        }
    }
    return NULL;
}
