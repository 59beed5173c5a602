/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/orbit_on_board.h"

#include <string.h>

#include "flight/navigation/earth_orientation.h"
#include "flight/navigation/orbit_motion.h"

void orbit_on_board_reset(OrbitOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Fills in the motion, if it is known. */
static OrbitElementsCode motion(Sgp4 *sgp4, double age, int64_t now, NavOrbit *orbit)
{
    const OrbitField field = {SGP4_MU, SGP4_RADIUS, SGP4_J2, 0.0, 0.0, vec3(0.0, 0.0, 1.0)};
    Vec3 r, v;
    const OrbitElementsCode code = sgp4_state(sgp4, age, &r, &v);
    if (code != ORBIT_ELEMENTS_GOOD) {
        return code;
    }
    const Mat3 dcm_TN = earth_teme(earth_days(now));
    orbit->a_BN_N = mat_transpose_vec(dcm_TN, orbit_gravity(&field, r));
    orbit->r_BN_N = mat_transpose_vec(dcm_TN, r);
    orbit->v_BN_N = mat_transpose_vec(dcm_TN, v);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (!vec_finite(orbit->r_BN_N) || !vec_finite(orbit->v_BN_N) || !vec_finite(orbit->a_BN_N)) {
        return ORBIT_ELEMENTS_UNSOUND;
    }
    return ORBIT_ELEMENTS_GOOD;
}

void orbit_on_board_update(OrbitOnBoard *m, Tick t)
{
    const Sgp4Elements elements = {m->par.epoch, m->par.n,         m->par.e, m->par.i,
                                   m->par.node,  m->par.periapsis, m->par.M, m->par.bstar};
    const int64_t now = m->in.time.time;
    const int64_t at = data_time(m->in.time.head, t.t);
    const double age = tick_seconds(tick_since(now, elements.epoch));
    Sgp4 sgp4 = m->mem.sgp4;
    NavOrbit *orbit = &m->out.orbit;
    OrbitElementsState *state = &m->out.state;
    if (!head_written(m->in.time.head)) {
        orbit->head = head_held(orbit->head);
        state->head = head_held(state->head);
        return;
    }

    OrbitElementsCode code = ORBIT_ELEMENTS_GOOD;
    if (m->mem.any == 0u || memcmp(&sgp4.elements, &elements, sizeof elements) != 0) {
        code = sgp4_init(&sgp4, elements);
    }
    NavOrbit next = *orbit;
    if (code == ORBIT_ELEMENTS_GOOD) {
        code = motion(&sgp4, age, now, &next);
    }
    const Quality quality = quality_through(m->in.time.head);
    const int old = m->par.age_max > 0.0 && fm_abs(age) > m->par.age_max;
    *state = (OrbitElementsState){head_next(state->head, at, quality), age, code, sgp4.deep};
    if (code != ORBIT_ELEMENTS_GOOD) {
        orbit->head = head_held(orbit->head);
        return;
    }
    next.head = head_next(orbit->head, at, old ? QUALITY_DEGRADED : quality);
    *orbit = next;
    m->mem.sgp4 = sgp4;
    m->mem.any = 1u;
}
