/* SPDX-License-Identifier: Apache-2.0 */
/* T_k+1 = 2 x T_k - T_k-1, and its first and second derivative in x; dx/dt = 2 / duration. */
#include "flight/navigation/chebyshev_ephemeris.h"

#include <string.h>

void chebyshev_ephemeris_reset(ChebyshevEphemeris *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* The motion at a time `in` [s] in a polynomial of n coefficients that is `duration` [s] long. */
static BodyState evaluate(const Vec3 *c, uint32_t n, double in, double duration)
{
    const double rate = 2.0 / duration;
    const double x = rate * in - 1.0;
    double T[3] = {1.0, 0.0, 0.0}, last[3] = {0.0, 0.0, 0.0};
    BodyState body;
    memset(&body, 0, sizeof body);
    for (uint32_t k = 0u; k < n; k++) {
        body.r_PN_N = vec_add(body.r_PN_N, vec_scale(T[0], c[k]));
        body.v_PN_N = vec_add(body.v_PN_N, vec_scale(rate * T[1], c[k]));
        body.a_PN_N = vec_add(body.a_PN_N, vec_scale(rate * rate * T[2], c[k]));
        const double twice = k == 0u ? 1.0 : 2.0; /* T_1 = x */
        const double next[3] = {twice * x * T[0] - last[0], twice * (T[0] + x * T[1]) - last[1],
                                twice * (2.0 * T[1] + x * T[2]) - last[2]};
        memcpy(last, T, sizeof last);
        memcpy(T, next, sizeof T);
    }
    return body;
}

/* 1 if the time is within `count` polynomials of the given duration from a start on; then which one, and how far. */
static int covers(int64_t start, int64_t duration, uint32_t count, int64_t time, uint32_t *which, int64_t *in)
{
    const int64_t since = tick_since(time, start);
    if (since < 0 || duration <= 0) {
        return 0;
    }
    const int64_t whole = since / duration, rest = since % duration;
    if (count == 0u || whole > count || (whole == count && rest != 0)) {
        return 0;
    }
    *which = whole < count ? (uint32_t)whole : count - 1u;
    *in = whole < count ? rest : duration; /* its very end */
    return 1;
}

static int sound(const EphemerisBlock *block)
{
    if (block->n < 1u || block->n > EPHEMERIS_TERMS || block->duration <= 0) {
        return 0;
    }
    int finite = 1;
    for (uint32_t k = 0u; k < block->n; k++) {
        finite = finite && vec_finite(block->c[k]);
    }
    return finite;
}

static void take(ChebyshevEphemeris *m)
{
    const EphemerisBlock *block = &m->in.block;
    if (!head_written(block->head) || (m->mem.any != 0u && block->number == m->mem.number)) {
        return;
    }
    m->mem.any = 1u;
    m->mem.number = block->number;
    if (sound(block)) {
        m->mem.blocks[m->mem.next] = *block;
        m->mem.next = (m->mem.next + 1u) % EPHEMERIS_BLOCKS;
        m->mem.taken++;
    } else {
        m->mem.refused++;
    }
}

void chebyshev_ephemeris_update(ChebyshevEphemeris *m, Tick t)
{
    const int64_t time = head_written(m->in.time.head) ? m->in.time.time : t.t;
    const Quality quality = quality_optional(m->in.time.head);
    uint32_t which = 0u;
    int64_t in = 0;
    int found = 0;
    double left = 0.0;
    BodyState body;
    take(m);
    for (uint32_t k = 1u; !found && k <= EPHEMERIS_BLOCKS; k++) {
        const EphemerisBlock *block = &m->mem.blocks[(m->mem.next + EPHEMERIS_BLOCKS - k) % EPHEMERIS_BLOCKS];
        found = covers(block->start, block->duration, 1u, time, &which, &in);
        if (found) {
            body = evaluate(block->c, block->n, tick_seconds(in), tick_seconds(block->duration));
            left = tick_seconds(block->duration - in);
        }
    }
    if (!found && m->par.n > 0u && covers(m->par.start, m->par.duration, m->par.segments, time, &which, &in)) {
        found = 1;
        body = evaluate(m->par.c[which], m->par.n, tick_seconds(in), tick_seconds(m->par.duration));
        left = tick_seconds(m->par.duration - in) + tick_seconds(m->par.duration) * (m->par.segments - 1u - which);
    }
    if (found && vec_finite(body.r_PN_N) && vec_finite(body.v_PN_N) && vec_finite(body.a_PN_N)) {
        body.head = head_next(m->out.body.head, t.t, quality);
        m->out.body = body;
    } else {
        m->out.body.head = head_held(m->out.body.head);
    }
    m->out.state = (EphemerisState){head_next(m->out.state.head, t.t, found ? quality : QUALITY_DEGRADED), left,
                                    m->mem.taken, m->mem.refused};
}
