/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/ground_pass.h"

#include <string.h>

#include "flight/math/geodesy.h"

#define HALVINGS 30                                   /* of a step of 600 s: 0.6 us */
#define LAST (INT64_MAX - INT64_C(2) * 3600000000000) /* [ns] from which on steps do not fit */

/* From the station to the spacecraft: vector and derivative in axes of the planet. */
typedef struct View {
    Vec3 d, dd;
} View;

/* Two views and the time [s] between them. */
typedef struct Span {
    View a, b;
    double h;
    Vec3 up;
} Span;

void ground_pass_reset(GroundPass *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static View view_of(const GroundPass *m, OrbitPoint x, int64_t t)
{
    double s, c;
    const double rate = m->mem.rate;
    fm_sincos(rate * tick_seconds(tick_since(t, m->mem.start)), &s, &c);
    const Vec3 r = mat_vec(m->mem.dcm_PN, x.r), v = mat_vec(m->mem.dcm_PN, x.v);
    const Vec3 turned = vec3(c * r.v[0] + s * r.v[1], c * r.v[1] - s * r.v[0], r.v[2]);
    const Vec3 moved =
        vec3(c * v.v[0] + s * v.v[1] + rate * turned.v[1], c * v.v[1] - s * v.v[0] - rate * turned.v[0], v.v[2]);
    return (View){vec_sub(turned, m->mem.station), moved};
}

/* The part x of the way from a to b. */
static View between(const Span *w, double x)
{
    const double y = 1.0 - x;
    const Vec3 way = vec_sub(w->b.d, w->a.d);
    const Vec3 bent = vec_sub(vec_scale(y * w->h, w->a.dd), vec_scale(x * w->h, w->b.dd));
    const Vec3 d = vec_add(vec_add(w->a.d, vec_scale(x * x * (3.0 - 2.0 * x), way)), vec_scale(x * y, bent));
    const Vec3 slope = vec_add(vec_scale(y * (1.0 - 3.0 * x), w->a.dd), vec_scale(x * (3.0 * x - 2.0), w->b.dd));
    return (View){d, vec_add(vec_scale(6.0 * x * y / w->h, way), slope)};
}

/* The sine of the elevation. */
static double height(View w, Vec3 up)
{
    return vec_dot(up, w.d) / vec_norm(w.d);
}

/* Proportional to its derivative. */
static double climb(View w, Vec3 up)
{
    return vec_dot(up, w.dd) * vec_norm2(w.d) - vec_dot(up, w.d) * vec_dot(w.d, w.dd);
}

/* Between x and y, where the elevation ceases to climb, or passes the mask. */
static double halve(const Span *w, double x, double y, int culmination, double mask)
{
    const int begins = culmination || height(between(w, x), w->up) >= mask;
    for (int k = 0; k < HALVINGS; k++) {
        const double z = 0.5 * (x + y);
        const View v = between(w, z);
        const int same = (culmination ? climb(v, w->up) > 0.0 : height(v, w->up) >= mask) == begins;
        *(same ? &x : &y) = z;
    }
    return 0.5 * (x + y);
}

/* One step of the search. */
static void search_step(GroundPass *m, const OrbitField *field, Vec3 up, int64_t step, int64_t now)
{
    const double h = tick_seconds(step);
    const OrbitPoint to = orbit_step(field, m->mem.at, 0.0, h);
    const Span w = {view_of(m, m->mem.at, m->mem.t), view_of(m, to, m->mem.t + step), h, up};
    const int culminates = climb(w.a, up) > 0.0 && climb(w.b, up) < 0.0;
    double ends[3] = {0.0, 1.0, 1.0};
    if (culminates) {
        ends[1] = halve(&w, 0.0, 1.0, 1, 0.0);
    }
    /* undecided: what climbs does not set, but in a step that is long beside the orbit, which tests do not take */
    for (int k = 0; k < (culminates ? 2 : 1) && m->mem.search != SEARCH_DONE; k++) {
        const double x = ends[k], y = ends[k + 1], s = height(between(&w, y), up);
        const int above = s >= m->mem.sine;
        const int64_t end = m->mem.t + (int64_t)(y * h * 1e9);
        if (above != (m->mem.search == SEARCH_ABOVE)) {
            const int64_t passes = m->mem.t + (int64_t)(halve(&w, x, y, 0, m->mem.sine) * h * 1e9);
            m->mem.search = above ? SEARCH_ABOVE : passes > now ? SEARCH_DONE : SEARCH_BELOW;
            *(above ? &m->mem.rise : &m->mem.set) = passes;
            m->mem.best = above ? -2.0 : m->mem.best;
        }
        if (above && s > m->mem.best) {
            m->mem.best = s;
            m->mem.highest = end;
        }
    }
    m->mem.at = to;
    m->mem.t += step;
}

/* Begin the search with an orbit, if the planet's attitude is that of a frame and all numbers are finite. */
static void begin(GroundPass *m, OrbitPoint orbit, Vec3 station, double mask, Vec3 up)
{
    const Mat3 to_N = mat_transpose(m->in.planet.dcm_PN);
    const Vec3 p1 = mat_vec(to_N, vec3(1.0, 0.0, 0.0)), p3 = mat_vec(to_N, vec3(0.0, 0.0, 1.0));
    const Vec3 pole = vec_unit(p3), east = vec_unit(vec_cross(pole, p1));
    const double skew = fm_abs(vec_norm2(p1) - 1.0) + fm_abs(vec_norm2(p3) - 1.0) + fm_abs(vec_dot(p1, p3));
    /* Its attitude is of the time in its head, which may be another one than the orbit's. */
    const double rate = vec_dot(pole, m->in.planet.omega_PN_N);
    const int64_t start = m->in.orbit.head.t;
    double s, k;
    fm_sincos(rate * tick_seconds(tick_since(start, m->in.planet.head.t)), &s, &k);
    const Vec3 prime = vec_add(vec_scale(k, vec_cross(east, pole)), vec_scale(s, east));
    /* undecided: a guard; the parameters are finite, and within bounds */
    if (!(skew < 1e-3) || !vec_finite(prime) || !vec_finite(station) || !isfinite(mask)) {
        return;
    }
    m->mem.at = m->mem.follow = orbit;
    m->mem.dcm_PN = mat_rows(prime, vec_cross(pole, prime), pole);
    m->mem.station = station;
    m->mem.rate = rate;
    m->mem.sine = mask;
    m->mem.start = m->mem.t = m->mem.followed = m->mem.rise = m->mem.highest = start;
    const double best = height(view_of(m, orbit, start), up);
    m->mem.searches++;
    m->mem.search = best >= mask ? SEARCH_ABOVE : SEARCH_BELOW;
    m->mem.best = best >= mask ? best : -2.0;
}

/* Whether there is nothing more to search now. */
static int search_ends(const GroundPass *m, int64_t step, int64_t now)
{
    const double ahead = tick_seconds(tick_since(m->mem.t, now)) + tick_seconds(step);
    return m->mem.search == SEARCH_NONE || m->mem.search == SEARCH_DONE ||
           !(ahead <= (m->mem.search == SEARCH_ABOVE ? 2.0 : 1.0) * m->par.horizon);
}

void ground_pass_update(GroundPass *m, Tick t)
{
    const OrbitPoint orbit = {m->in.orbit.r_BN_N, m->in.orbit.v_BN_N};
    const GroundPlace place =
        ground_place(m->par.longitude, m->par.latitude, m->par.altitude, m->par.radius, m->par.flattening);
    const double mask = fm_sin(m->par.mask);
    const int64_t step = orbit_step_ns(m->par.step);
    OrbitField field = {m->par.mu, m->par.radius, m->par.J2, 0.0, 0.0, vec3(0.0, 0.0, 1.0)};
    const Head head = m->in.orbit.head;
    const int sound = quality_min(head.quality, m->in.planet.head.quality) != QUALITY_NONE && head.t <= t.t &&
                      orbit_sound(&field, orbit);

    GroundPass next = *m;
    const double *pole = next.mem.dcm_PN.m[2];
    field.pole = vec3(pole[0], pole[1], pole[2]);
    const int changed =
        t.t < next.mem.now || vec_norm2(vec_sub(place.r, next.mem.station)) != 0.0 || mask != next.mem.sine;
    int anew = changed;
    if (!anew && next.mem.search != SEARCH_NONE && sound && head.t > next.mem.followed) {
        next.mem.follow = orbit_go(&field, next.mem.follow, &next.mem.followed, head.t, step, m->par.steps);
        const double apart = vec_norm(vec_sub(next.mem.follow.r, orbit.r));
        anew = next.mem.followed == head.t && !(apart <= m->par.differ);
    }
    if (anew) {
        next.mem.search = SEARCH_NONE;
    }
    const int over = next.mem.search == SEARCH_DONE && t.t >= next.mem.set;
    if (over) {
        next.mem.search = SEARCH_BELOW;
    }
    if (sound && (over || next.mem.search == SEARCH_NONE)) {
        begin(&next, orbit, place.r, mask, place.up);
        if (!changed && m->mem.search == SEARCH_DONE && m->mem.rise < head.t && next.mem.search == SEARCH_ABOVE) {
            next.mem.rise = m->mem.rise; /* of the pass in which it is still */
            next.mem.highest = m->mem.highest < t.t ? m->mem.highest : next.mem.highest;
            next.mem.best = m->mem.highest < t.t ? m->mem.best : next.mem.best;
        }
        field.pole = vec3(pole[0], pole[1], pole[2]);
    }
    next.mem.now = t.t;

    int ends = 0;
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t k = 0u; k < ORBIT_STEPS_MAX && k < m->par.steps && step > 0 && !ends; k++) {
        if (next.mem.t <= LAST && !search_ends(&next, step, t.t)) {
            search_step(&next, &field, place.up, step, t.t);
            continue;
        }
        ends = 1;
        if (next.mem.search == SEARCH_ABOVE && next.mem.t > t.t) {
            next.mem.set = next.mem.t;
            next.mem.search = SEARCH_DONE;
        }
    }
    if (!orbit_sound(&field, next.mem.at)) {
        next.mem.search = SEARCH_NONE;
    }

    PassForecast *forecast = &m->out.forecast;
    const double elevation = fm_asin(fm_clamp(next.mem.best, 1.0));
    /* undecided: guards; the parameter is within bounds, and no inputs are known whose sine is not finite */
    if (next.mem.search == SEARCH_NONE || step == 0 || !isfinite(elevation)) {
        forecast->head = head_held(forecast->head);
        m->mem.search = SEARCH_NONE;
        return;
    }
    m->mem = next.mem;
    const int lost = !sound || data_lost(t, head_time(head, t.t), 0.0);
    const int done = m->mem.search == SEARCH_DONE;
    const int kept = !done && !ends && !changed && t.t < forecast->set; /* the forecast that the search replaces */
    const Quality worst = quality_min(quality_through(head), quality_through(m->in.planet.head));
    PassForecast is;
    memset(&is, 0, sizeof is);
    is.head = head_next(forecast->head, t.t, lost || kept ? QUALITY_DEGRADED : worst);
    is.state = ends ? PASS_NONE : PASS_SEARCHING;
    is.searches = m->mem.searches;
    if (done || kept) {
        is.rise = done ? m->mem.rise : forecast->rise;
        is.highest = done ? m->mem.highest : forecast->highest;
        is.set = done ? m->mem.set : forecast->set;
        is.elevation = done ? elevation : forecast->elevation;
        is.state = t.t < is.rise ? PASS_FOUND : PASS_NOW;
    }
    *forecast = is;
}
