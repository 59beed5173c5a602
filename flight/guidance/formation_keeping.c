/* SPDX-License-Identifier: Apache-2.0 */
/* With omega and domega of the chief's Hill frame, as in HillPointing, and all in H components:
 *     dr*  = v_C + drho* + omega x rho*
 *     ddr* = a_C + ddrho* + 2 omega x drho* + domega x rho* + omega x (omega x rho*),   a_C = g(r_C) */
#include "flight/guidance/formation_keeping.h"

#include <string.h>

#include "flight/math/attitude.h"

void formation_keeping_reset(FormationKeeping *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static Vec3 point_mass(double mu, Vec3 r)
{
    const double r2 = vec_norm2(r);
    return vec_scale(-mu / (r2 * fm_sqrt(r2)), r);
}

/* Carries a motion about the planet to now: over the seconds for which old data count, its gravity is constant. */
static void carry(double mu, Head head, int64_t t, Vec3 *r, Vec3 *v)
{
    const double age = head.t < t ? tick_seconds(tick_since(t, head.t)) : 0.0;
    const Vec3 dv = vec_scale(age, point_mass(mu, *r));
    *r = vec_add(*r, vec_scale(age, vec_add(*v, vec_scale(0.5, dv))));
    *v = vec_add(*v, dv);
}

typedef struct Wanted {
    Vec3 rho, drho, ddrho;
} Wanted;

static Wanted wanted_motion(const FormationKeeping *m, double n, double since)
{
    const double u = n * since + m->par.start, a = m->par.a, b = m->par.b;
    double s, c, sz, cz;
    fm_sincos(u, &s, &c);
    fm_sincos(u + m->par.phase, &sz, &cz);
    return (Wanted){vec3(a * c, m->par.lead - 2.0 * a * s, b * cz), vec_scale(n, vec3(-a * s, -2.0 * a * c, -b * sz)),
                    vec_scale(n * n, vec3(-a * c, 2.0 * a * s, -b * cz))};
}

/* The force in N components, and the state in H; both at t, `since` the first update. */
static Vec3 keep(const FormationKeeping *m, int64_t t, double n, double since, HillState *state)
{
    const BodyState *planet = &m->in.planet;
    Vec3 r = vec_sub(m->in.orbit.r_BN_N, planet->r_PN_N), v = vec_sub(m->in.orbit.v_BN_N, planet->v_PN_N);
    Vec3 r_C = vec_sub(m->in.chief.r_PN_N, planet->r_PN_N), v_C = vec_sub(m->in.chief.v_PN_N, planet->v_PN_N);
    carry(m->par.mu, m->in.orbit.head, t, &r, &v);
    carry(m->par.mu, m->in.chief.head, t, &r_C, &v_C);
    const Vec3 h = vec_cross(r_C, v_C), i_r = vec_unit(r_C), i_h = vec_unit(h);
    const Mat3 dcm_HN = mat_rows(i_r, vec_cross(i_h, i_r), i_h);
    const double r2 = vec_norm2(r_C), rate = vec_norm(h) / r2;
    const Vec3 omega = vec3(0.0, 0.0, rate), domega = vec3(0.0, 0.0, -2.0 * vec_dot(r_C, v_C) / r2 * rate);

    const Wanted w = wanted_motion(m, n, since);
    const Vec3 apart = mat_vec(dcm_HN, vec_sub(r, r_C));
    const Vec3 moves = mat_vec(dcm_HN, vec_sub(v, v_C));
    const Vec3 e = vec_sub(apart, w.rho);
    const Vec3 de = vec_sub(moves, vec_add(w.drho, vec_cross(omega, w.rho))); /* in N, H components */
    state->rho_H = apart;
    state->drho_H = vec_sub(moves, vec_cross(omega, apart));
    state->rho_error_H = e;
    state->drho_error_H = vec_sub(de, vec_cross(omega, e));

    if (m->par.quiet > 0.0 && vec_norm(e) < m->par.quiet && vec_norm(de) < m->par.quiet * fm_sqrt(m->par.K)) {
        return vec_scale(0.0, e);
    }
    Vec3 a = vec_add(w.ddrho, vec_scale(2.0, vec_cross(omega, w.drho)));
    a = vec_add(a, vec_add(vec_cross(domega, w.rho), vec_cross(omega, vec_cross(omega, w.rho))));
    a = vec_sub(a, vec_add(vec_scale(m->par.K, e), vec_scale(m->par.P, de)));
    const Vec3 pull = vec_sub(point_mass(m->par.mu, r_C), point_mass(m->par.mu, r));
    Vec3 force = vec_scale(m->par.mass, vec_add(mat_transpose_vec(dcm_HN, a), pull));
    const double size = vec_norm(force);
    if (m->par.force_max > 0.0 && size > m->par.force_max) {
        force = vec_scale(m->par.force_max / size, force);
    }
    return force;
}

void formation_keeping_update(FormationKeeping *m, Tick t)
{
    const Head orbit = m->in.orbit.head, attitude = m->in.attitude.head, chief = m->in.chief.head;
    BodyForce *out = &m->out.force;
    Quality quality = quality_min(quality_through(orbit), quality_through(attitude));
    quality = quality_min(quality, quality_min(quality_through(chief), quality_optional(m->in.planet.head)));

    double n = m->mem.n;
    const int64_t origin = m->mem.running ? m->mem.origin : t.t;
    if (!m->mem.running) {
        const double r = vec_norm(vec_sub(m->in.chief.r_PN_N, m->in.planet.r_PN_N));
        n = fm_sqrt(m->par.mu / r) / r;
    }
    HillState state;
    const Vec3 force_N = keep(m, t.t, n, tick_seconds(tick_since(t.t, origin)), &state);
    const Vec3 force_B = mat_vec(mrp_to_dcm(m->in.attitude.sigma_BN), force_N);
    int64_t newest = data_time(orbit, t.t);
    newest = data_time(attitude, t.t) < newest ? data_time(attitude, t.t) : newest;
    newest = data_time(chief, t.t) < newest ? data_time(chief, t.t) : newest;
    const Head last = out->head;
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (quality != QUALITY_NONE && isfinite(n) && vec_finite(force_B) && vec_finite(state.rho_H) &&
        vec_finite(state.drho_H) && vec_finite(state.rho_error_H) && vec_finite(state.drho_error_H)) {
        state.head = head_next(m->out.relative.head, t.t, quality);
        m->out.relative = state;
        m->mem.n = n;
        m->mem.origin = origin;
        m->mem.newest = newest;
        m->mem.running = 1;
        out->head = head_next(last, t.t, quality);
        out->force_B = force_B;
    } else {
        m->out.relative.head = head_held(m->out.relative.head);
        out->head = head_held(last);
    }
    if (head_written(last) && data_lost(t, m->mem.newest, m->par.hold)) {
        out->head = head_next(last, t.t, QUALITY_DEGRADED);
        out->force_B = vec3(0.0, 0.0, 0.0);
    }
}
