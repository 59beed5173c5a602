/* SPDX-License-Identifier: Apache-2.0 */
/* r + v T + a T^2 / 2 and v + a T, with T the lead. */
#include "flight/guidance/orbit_beacon.h"

#include <string.h>

void orbit_beacon_reset(OrbitBeacon *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void orbit_beacon_update(OrbitBeacon *m, Tick t)
{
    const NavOrbit *orbit = &m->in.orbit;
    BodyState *out = &m->out.body;
    double lead = m->par.lead;

    BodyState body;
    Quality quality = quality_through(orbit->head);
    body.head = head_next(out->head, t.t, quality);
    body.a_PN_N = orbit->a_BN_N;
    body.v_PN_N = vec_add(orbit->v_BN_N, vec_scale(lead, body.a_PN_N));
    body.r_PN_N = vec_add(orbit->r_BN_N, vec_scale(lead, vec_add(orbit->v_BN_N, vec_scale(0.5 * lead, body.a_PN_N))));
    /* undecided: a guard; it is a copy of an input that has been found finite */
    if (quality != QUALITY_NONE && vec_finite(body.r_PN_N) && vec_finite(body.v_PN_N) && vec_finite(body.a_PN_N)) {
        *out = body;
    } else {
        out->head = head_held(out->head);
    }
}
