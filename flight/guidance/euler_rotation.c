/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/euler_rotation.h"

#include <string.h>

#include "flight/math/attitude.h"

/* 0 if the result is not finite. */
static int turn(const AttReference *base, const EulerAngles *euler, AttReference *reference)
{
    double dpsi = euler->rates.v[0], dtheta = euler->rates.v[1], dphi = euler->rates.v[2];
    Vec3 s, c;
    vec_sincos(euler->angles, &s, &c);
    double s2 = s.v[1], c2 = c.v[1], s1 = s.v[2], c1 = c.v[2];

    Vec3 w = vec3(dphi - s2 * dpsi, s1 * c2 * dpsi + c1 * dtheta, c1 * c2 * dpsi - s1 * dtheta);
    Vec3 dw = vec3(-c2 * dtheta * dpsi, (c1 * c2 * dphi - s1 * s2 * dtheta) * dpsi - s1 * dphi * dtheta,
                   -(s1 * c2 * dphi + c1 * s2 * dtheta) * dpsi - c1 * dphi * dtheta);

    Mat3 dcm_RN = mat_mul(euler_sincos_to_dcm(s, c), mrp_to_dcm(base->sigma_RN));
    Vec3 w_N = mat_transpose_vec(dcm_RN, w);
    reference->sigma_RN = dcm_to_mrp(dcm_RN);
    reference->omega_RN_N = vec_add(base->omega_RN_N, w_N);
    reference->domega_RN_N =
        vec_add(vec_add(base->domega_RN_N, mat_transpose_vec(dcm_RN, dw)), vec_cross(base->omega_RN_N, w_N));
    return vec_finite(reference->sigma_RN) && vec_finite(reference->omega_RN_N) && vec_finite(reference->domega_RN_N);
}

/* The newest command that has started; without a head, the parameters. */
static EulerCommand in_effect(const EulerRotation *m, int64_t t)
{
    const EulerCommand *command = &m->in.command;
    if (head_written(command->head) && command->start >= 0 && command->start <= t) {
        return *command;
    }
    if (head_written(m->mem.commanded.head)) {
        return m->mem.commanded;
    }
    return (EulerCommand){{0, QUALITY_NONE, 0}, m->mem.start, m->par.angles, m->par.rates};
}

void euler_rotation_reset(EulerRotation *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void euler_rotation_update(EulerRotation *m, Tick t)
{
    const AttReference *base = &m->in.base;
    if (!m->mem.running) {
        m->mem.running = 1;
        m->mem.start = t.t;
    }

    EulerAngles euler;
    AttReference reference;
    EulerCommand command = in_effect(m, t.t);
    Quality quality = quality_min(quality_through(base->head), quality_optional(m->in.command.head));
    double seconds = tick_seconds(tick_since(t.t, command.start));
    euler.rates = command.rates;
    euler.angles = vec_add(command.angles, vec_scale(seconds, command.rates));
    if (quality != QUALITY_NONE && vec_finite(euler.rates) && vec_finite(euler.angles) &&
        turn(base, &euler, &reference)) {
        euler.head = head_next(m->out.euler.head, t.t, quality);
        reference.head = head_next(m->out.reference.head, t.t, quality);
        m->out.reference = reference;
        m->out.euler = euler;
        m->mem.commanded = command;
    } else {
        m->out.reference.head = head_held(m->out.reference.head);
        m->out.euler.head = head_held(m->out.euler.head);
    }
}
