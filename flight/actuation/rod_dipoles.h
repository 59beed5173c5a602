/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/actuation: the dipoles of torque rods that make a dipole of the body, and what they give. */
#ifndef FLIGHT_ACTUATION_ROD_DIPOLES_H
#define FLIGHT_ACTUATION_ROD_DIPOLES_H

#include <string.h>

#include "flight/actuation/allocation.h"
#include "flight/msg/magnetics.h"
#include "flight/msg/vehicle.h"

/** The dipoles of the least norm, G^+ wanted_B, with the unit axes of the rods the columns of G, and G's rank. Where a
 *  rod would pass its limit, all are scaled alike, by the factor that is returned. */
static inline double rods_share(const RodSet *rods, Vec3 wanted_B, double *dipole, int *rank)
{
    const uint32_t n = rods_count(rods);
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < n; i++) {
        gram_add(&gram, rods->axes_B[i]);
    }
    const Vec3 y = mat_vec(gram_pinv(&gram, rank), wanted_B);
    for (uint32_t i = 0; i < n; i++) {
        dipole[i] = vec_dot(rods->axes_B[i], y);
    }
    const double factor = within_limits(rods->m_max, dipole, n);
    for (uint32_t i = 0; i < n; i++) {
        dipole[i] *= factor;
    }
    return factor;
}

/** The dipole of the body that the rods make. */
static inline Vec3 rods_dipole(const RodSet *rods, const double *dipole)
{
    Vec3 m_B = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < rods_count(rods); i++) {
        m_B = vec_add(m_B, vec_scale(dipole[i], rods->axes_B[i]));
    }
    return m_B;
}

/** Write dipoles, and the torque that they give, as head_acting() says; weak: zero at once. Returns what that does. */
static inline int rods_put(RodCommand *command, BodyTorque *achieved, const double *dipole, Vec3 torque_B, Tick t,
                           int weak, Quality quality, int64_t of, double hold, int64_t *newest)
{
    int acts = 0;
    if (weak) {
        command->head = head_next(command->head, t.t, QUALITY_DEGRADED);
    } else {
        acts = head_acting(&command->head, t, quality, of, hold, newest);
    }
    put_numbers(command->dipole, dipole, RODS_MAX, acts);
    put_achieved(achieved, torque_B, command->head, t.t, acts);
    return acts;
}

#endif
