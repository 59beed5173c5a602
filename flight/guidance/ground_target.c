/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/guidance/ground_target.h"

#include <string.h>

#include "flight/math/geodesy.h"

#define TURN 6.283185307179586

void ground_target_reset(GroundTarget *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* From P to N, with the planet's axes p1, p2, p3 in N. */
static Vec3 to_N(const Vec3 p[3], Vec3 a)
{
    return vec_add(vec_add(vec_scale(a.v[0], p[0]), vec_scale(a.v[1], p[1])), vec_scale(a.v[2], p[2]));
}

/* p1, p2, p3 in N now: orthonormal, whatever the attitude is. Returns the rate about p3 [rad/s]. */
static double axes(const GroundTarget *m, int64_t t, Vec3 p[3])
{
    const PlanetAttitude *known = &m->in.attitude;
    const int wired = head_written(known->head);
    const double(*c)[3] = wired ? known->dcm_PN.m : m->par.dcm_PN.m;
    double s, k;
    const Vec3 pole = vec_unit(vec3(c[2][0], c[2][1], c[2][2]));
    const Vec3 east = vec_unit(vec_cross(pole, vec3(c[0][0], c[0][1], c[0][2])));
    const Vec3 prime = vec_cross(east, pole);
    const double rate = wired ? vec_dot(known->omega_PN_N, pole) : m->par.rate;
    fm_sincos(rate * tick_seconds(wired ? tick_since(t, known->head.t) : t), &s, &k);
    p[0] = vec_add(vec_scale(k, prime), vec_scale(s, east));
    p[1] = vec_cross(pole, p[0]);
    p[2] = pole;
    return rate;
}

static void see(GroundContact *contact, Vec3 d, Vec3 dd, const Vec3 local[3])
{
    const double east = vec_dot(d, local[0]), north = vec_dot(d, local[1]), up = vec_dot(d, local[2]);
    const double azimuth = fm_atan2(east, north);
    contact->range = vec_norm(d);
    contact->range_rate = vec_dot(vec_unit(d), dd);
    contact->azimuth = azimuth < 0.0 ? azimuth + TURN : azimuth;
    contact->elevation = fm_atan2(up, fm_sqrt(east * east + north * north));
    contact->spare = 0u;
}

/* open contact: where `spans` holds, so are `local` unit vectors, in which a d of finite length has finite parts */
void ground_target_update(GroundTarget *m, Tick t)
{
    const NavOrbit *orbit = &m->in.orbit;
    const BodyState *planet = &m->in.planet; /* all zero if never written */
    Vec3 p[3];
    const double rate = axes(m, t.t, p);
    const GroundPlace place =
        ground_place(m->par.longitude, m->par.latitude, m->par.altitude, m->par.radius, m->par.flattening);
    const Vec3 local[3] = {to_N(p, place.east), to_N(p, place.north), to_N(p, place.up)};

    BodyState target;
    const Vec3 omega = vec_scale(rate, p[2]);
    const Vec3 r = to_N(p, place.r);
    const Vec3 v = vec_cross(omega, r);
    target.r_PN_N = vec_add(planet->r_PN_N, r);
    target.v_PN_N = vec_add(planet->v_PN_N, v);
    target.a_PN_N = vec_add(planet->a_PN_N, vec_cross(omega, v));
    const Quality placed = quality_min(quality_optional(planet->head), quality_optional(m->in.attitude.head));
    const int spans = vec_norm2(p[0]) > 0.5; /* a unit vector, unless the planet's axes span no frame */
    if (spans && vec_finite(target.r_PN_N) && vec_finite(target.v_PN_N) && vec_finite(target.a_PN_N)) {
        target.head = head_next(m->out.target.head, t.t, placed);
        m->out.target = target;
    } else {
        m->out.target.head = head_held(m->out.target.head);
    }

    GroundContact contact;
    const Quality quality = quality_min(placed, quality_through(orbit->head));
    see(&contact, vec_sub(orbit->r_BN_N, target.r_PN_N), vec_sub(orbit->v_BN_N, target.v_PN_N), local);
    if (quality != QUALITY_NONE && spans && isfinite(contact.range) && isfinite(contact.range_rate)) {
        contact.visible = contact.elevation >= m->par.mask && !data_lost(t, data_time(orbit->head, t.t), 0.0);
        contact.head = head_next(m->out.contact.head, t.t, quality);
        m->out.contact = contact;
    } else {
        m->out.contact.head = head_held(m->out.contact.head);
        m->out.contact.visible = 0u; /* no link is begun on old data */
    }
}
