/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/inertial_spin.h"

#include <string.h>

#include "flight/math/attitude.h"

/* 0 if the result is not finite. */
static int spin(const AttReference *base, Vec3 omega_RR0_R0, double seconds, AttReference *reference)
{
    double s, c;
    fm_sincos(0.5 * vec_norm(omega_RR0_R0) * seconds, &s, &c);
    Vec3 sigma_RR0 = mrp_project(c, vec_scale(s, vec_unit(omega_RR0_R0)), 1.0);
    Vec3 w_N = mat_transpose_vec(mrp_to_dcm(base->sigma_RN), omega_RR0_R0);
    reference->sigma_RN = mrp_compose(sigma_RR0, base->sigma_RN);
    reference->omega_RN_N = vec_add(base->omega_RN_N, w_N);
    reference->domega_RN_N = vec_add(base->domega_RN_N, vec_cross(base->omega_RN_N, w_N));
    return vec_finite(reference->sigma_RN) && vec_finite(reference->omega_RN_N) && vec_finite(reference->domega_RN_N);
}

void inertial_spin_reset(InertialSpin *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void inertial_spin_update(InertialSpin *m, Tick t)
{
    const AttReference *base = &m->in.base;
    AttReference *out = &m->out.reference;
    if (!m->mem.running) {
        m->mem.running = 1;
        m->mem.start = t.t;
    }

    AttReference reference;
    Quality quality = quality_through(base->head);
    double seconds = tick_seconds(tick_since(t.t, m->mem.start));
    if (quality != QUALITY_NONE && spin(base, m->par.omega_RR0_R0, seconds, &reference)) {
        reference.head = head_next(out->head, t.t, quality);
        *out = reference;
    } else {
        out->head = head_held(out->head);
    }
}
