/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/thruster_mapping.h"

#include <string.h>

#include "flight/actuation/allocation.h"
#include "flight/math/nnls.h"

/* [-] The part of the wanted torque and force that may be missing from a good output. */
static const double EXACT = 1e-6;

void thruster_mapping_reset(ThrusterMapping *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static void put(double *at, Vec3 a)
{
    memcpy(at, a.v, sizeof a.v);
}

/* Forces before saturation, and r, what they leave of p->b. 1 if they give what is wanted, 0 if not, -1 if there is no
 * result. */
static int distribute(const ThrusterMapping *m, Tick t, Nnls *p, uint32_t *pushing, double F[THRUSTERS_MAX],
                      double r[NNLS_ROWS])
{
    const ThrusterSet *set = &m->in.thrusters;
    const ThrusterAvailability *may = &m->in.availability;
    const int force = head_written(m->in.force.head);
    p->m = force ? 6u : 3u;
    p->n = thrusters_count(set);
    put(p->b, m->in.torque.torque_B);
    const int lost = data_lost(t, data_time(m->in.force.head, t.t), m->par.hold);
    put(p->b + 3, lost ? vec3(0.0, 0.0, 0.0) : m->in.force.force_B);
    for (uint32_t i = 0; i < p->n; i++) {
        const int use = may_use(may->head, may->available[i]);
        const Vec3 axis = use ? set->axes_B[i] : vec3(0.0, 0.0, 0.0);
        put(p->a[i], vec_cross(set->r_TC_B[i], axis));
        if (force) {
            put(p->a[i] + 3, axis);
        }
    }
    double wanted = nnls_dot(p->b, p->b, p->m);
    for (uint32_t k = 0; k < p->m && m->par.off_pulse; k++) {
        p->b[k] = -p->b[k];
        for (uint32_t i = 0; i < p->n; i++) {
            p->b[k] += p->a[i][k] * set->F_max[i];
        }
    }
    wanted += nnls_dot(p->b, p->b, p->m);
    if (!nnls(p, pushing, F, r)) {
        return -1;
    }
    return nnls_dot(r, r, p->m) <= EXACT * EXACT * wanted;
}

/* open forces: each F[i] is finite where their sum is, all */
void thruster_mapping_update(ThrusterMapping *m, Tick t)
{
    const ThrusterSet *set = &m->in.thrusters;
    const ThrusterAvailability *may = &m->in.availability;
    ThrusterForces *forces = &m->out.forces;
    Quality quality = quality_min(quality_through(m->in.torque.head), quality_through(set->head));
    quality = quality_min(quality, quality_optional(may->head));
    quality = quality_min(quality, quality_optional(m->in.force.head));

    double F[THRUSTERS_MAX] = {0.0};
    uint32_t pushing = m->mem.pushing;
    Nnls p; /* its first rows are of torque */
    double r[NNLS_ROWS] = {0.0};
    Vec3 torque_B;
    const int exact = distribute(m, t, &p, &pushing, F, r);
    const double factor = within_limits(set->F_max, F, thrusters_count(set));
    for (uint32_t k = 0; k < 3u; k++) {
        const double given = factor * (p.b[k] - r[k]);
        torque_B.v[k] = m->par.off_pulse ? m->in.torque.torque_B.v[k] + p.b[k] - given : given;
    }
    double all = 0.0;
    for (uint32_t i = 0; i < thrusters_count(set); i++) {
        F[i] *= factor;
        if (m->par.off_pulse) {
            F[i] = may_use(may->head, may->available[i]) ? set->F_max[i] - F[i] : 0.0;
        }
        all += F[i];
    }
    if (!exact) {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (exact < 0 || !vec_finite(torque_B) || !isfinite(all)) {
        quality = QUALITY_NONE;
    }
    const int acts =
        head_acting(&forces->head, t, quality, data_time(m->in.torque.head, t.t), m->par.hold, &m->mem.newest);
    put_numbers(forces->F, F, THRUSTERS_MAX, acts);
    put_achieved(&m->out.achieved, torque_B, forces->head, t.t, acts);
    if (acts > 0) {
        m->mem.saturated += factor < 1.0;
        m->mem.pushing = pushing;
    }
}
