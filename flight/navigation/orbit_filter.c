/* SPDX-License-Identifier: Apache-2.0 */
/* Over a step h, with the gradient G of the field in its middle and the direction e of the velocity, a deviation of
 * position, velocity and acceleration along e becomes
 *     dr' = dr + h dv + h^2 / 2 (G dr + e dw) + h^3 / 6 G dv,   dv' = dv + h (G dr + e dw) + h^2 / 2 G dv.
 * White noise of the density q on the acceleration adds, about each axis,
 *     q h^3 / 3,   q h^2 / 2,   q h   to the covariances of r with r, r with v, v with v.
 * The six numbers of a fix have errors that do not depend on each other, and are used one by one. */
#include "flight/navigation/orbit_filter.h"

#include "flight/math/qr.h"

#define VAGUE 2e4 /* [m] the motion is not linear over more */

void orbit_filter_reset(OrbitFilter *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static void row_turn(double row[7], const Mat3 *G, Vec3 e, double h)
{
    const Vec3 dr = vec3(row[0], row[1], row[2]), dv = vec3(row[3], row[4], row[5]);
    const Vec3 a = vec_add(mat_vec(*G, dr), vec_scale(row[6], e)), da = mat_vec(*G, dv);
    for (int i = 0; i < 3; i++) {
        row[i] += h * (dv.v[i] + h * (0.5 * a.v[i] + h / 6.0 * da.v[i]));
        row[3 + i] += h * (a.v[i] + 0.5 * h * da.v[i]);
    }
}

static void predict(OrbitEstimate *e, const OrbitField *field, const OrbitFilter *m, int64_t dt)
{
    const double h = tick_seconds(dt), q = m->par.accel_noise;
    const OrbitPoint to = orbit_step(field, e->x, e->along, h);
    const Mat3 G = orbit_gradient(field, vec_scale(0.5, vec_add(e->x.r, to.r)));
    const Vec3 ahead = vec_unit(vec_add(e->x.v, to.v));
    const double stays = m->par.along_time > 0.0 ? fm_exp(-h / m->par.along_time) : 1.0;
    double rows[14][7];
    memset(rows, 0, sizeof rows);
    memcpy(rows, e->root, sizeof e->root);
    for (int i = 0; i < 7; i++) {
        row_turn(rows[i], &G, ahead, h);
        rows[i][6] *= stays;
    }
    for (int i = 0; i < 3; i++) {
        rows[7 + i][i] = 0.5 * h * fm_sqrt(q * h);
        rows[7 + i][3 + i] = fm_sqrt(q * h);
        rows[10 + i][i] = h * fm_sqrt(q * h / 12.0);
    }
    rows[13][6] = m->par.along_std * fm_sqrt(1.0 - stays * stays);
    qr_reduce(&rows[0][0], 14, 7);
    memcpy(e->root, rows, sizeof e->root);
    e->x = to;
    e->along *= stays;
    e->t += dt;
}

/* To the time t, or as far as the steps allow. */
static void predict_to(OrbitEstimate *e, const OrbitField *field, const OrbitFilter *m, int64_t t, uint32_t steps)
{
    const int64_t step = orbit_step_ns(m->par.step);
    /* undecided: a guard of the array; the bounds of the parameter are within */
    for (uint32_t k = 0u; k <= ORBIT_STEPS_MAX && k < steps && step > 0 && e->t < t; k++) {
        const uint64_t left = (uint64_t)t - (uint64_t)e->t;
        predict(e, field, m, left < (uint64_t)step ? (int64_t)left : step);
    }
}

/* Use number i of a fix, which is `innovation` off; dx is what the state has already been corrected by. */
static double measure(double root[7][7], int i, double innovation, double std, double dx[7])
{
    double A[8][8];
    memset(A[0], 0, sizeof A[0]);
    A[0][0] = std;
    for (int k = 0; k < 7; k++) {
        A[1 + k][0] = root[k][i];
        memcpy(A[1 + k] + 1, root[k], sizeof root[k]);
    }
    qr_reduce(&A[0][0], 8, 8);
    const double e = (innovation - dx[i]) / A[0][0];
    for (int k = 0; k < 7; k++) {
        dx[k] += A[0][1 + k] * e;
        memcpy(root[k], A[1 + k] + 1, sizeof root[k]);
    }
    return e * e;
}

static double position_variance(const OrbitEstimate *e)
{
    double sum = 0.0;
    for (int i = 0; i < 7; i++) {
        sum += e->root[i][0] * e->root[i][0] + e->root[i][1] * e->root[i][1] + e->root[i][2] * e->root[i][2];
    }
    return sum;
}

static int estimate_finite(const OrbitEstimate *e)
{
    double sum = fm_abs(e->along) + vec_norm2(e->x.r) + vec_norm2(e->x.v);
    for (int i = 0; i < 49; i++) {
        sum += fm_abs(e->root[i / 7][i % 7]);
    }
    /* undecided: the sum is not finite either; one by one, the proof sees them */
    return vec_finite(e->x.r) && vec_finite(e->x.v) && isfinite(e->along) && isfinite(sum);
}

static double fix_std(const OrbitFilter *m)
{
    return fm_sqrt(m->par.position_std * m->par.position_std + m->par.wander * m->par.wander);
}

static void begin(OrbitFilter *m, OrbitPoint fix)
{
    OrbitEstimate *at = &m->mem.at;
    memset(at, 0, sizeof *at);
    at->t = m->in.fix.head.t;
    at->x = fix;
    for (int i = 0; i < 3; i++) {
        at->root[i][i] = fix_std(m);
        at->root[3 + i][3 + i] = m->par.velocity_std;
    }
    at->root[6][6] = m->par.along_std;
    m->mem.running = 0u;
}

static void count_used(OrbitFilter *m)
{
    m->mem.agree = 0u;
    m->mem.used = m->in.fix.head.t;
    m->mem.quality = m->in.fix.head.quality;
    m->mem.used_count++;
    m->mem.running += m->mem.running < m->par.persistence ? 1u : 0u;
}

/* Whether rejected fixes agree with each other for long enough that the estimate must be wrong. */
static int all_agree(OrbitFilter *m, const OrbitField *field, OrbitPoint fix)
{
    int64_t at = m->mem.rejected_at;
    const int64_t t = m->in.fix.head.t;
    int agrees = 0;
    if (m->mem.agree > 0u && at < t) {
        const OrbitPoint to = orbit_go(field, m->mem.rejected, &at, t, orbit_step_ns(m->par.step), m->par.steps);
        const double dt = tick_seconds(tick_since(t, m->mem.rejected_at)), gate2 = m->par.gate * m->par.gate;
        const double r2 = 6.0 * fix_std(m) * fix_std(m), v2 = 6.0 * m->par.velocity_std * m->par.velocity_std;
        agrees = at == t && vec_norm2(vec_sub(to.r, fix.r)) <= gate2 * (r2 + v2 * dt * dt) &&
                 vec_norm2(vec_sub(to.v, fix.v)) <= gate2 * (v2 + m->par.accel_noise * dt);
    }
    m->mem.agree = agrees ? m->mem.agree + 1u : 1u;
    m->mem.rejected = fix;
    m->mem.rejected_at = t;
    return m->mem.agree >= m->par.persistence;
}

/* Process a fix that is new; `kept` [s] is how far the estimate may be behind. */
static void process_fix(OrbitFilter *m, const OrbitField *field, int64_t now, double kept)
{
    const Head head = m->in.fix.head;
    const OrbitPoint fix = {m->in.fix.r_BN_N, m->in.fix.v_BN_N};
    const int repeats = m->mem.any != 0u && vec_norm2(vec_sub(fix.r, m->mem.last.r)) == 0.0 &&
                        vec_norm2(vec_sub(fix.v, m->mem.last.v)) == 0.0;
    OrbitEstimate there = m->mem.at;
    const int old = tick_seconds(tick_since(now, head.t)) > kept;
    const int late = old || (m->mem.running != 0u && (head.t < there.t || head.t <= m->mem.used));
    if (m->mem.running != 0u && !late) {
        predict_to(&there, field, m, head.t, m->par.steps + 1u);
        if (there.t < head.t) {
            return; /* it waits until the filter has caught up */
        }
    }
    m->mem.any = 1u;
    m->mem.seen = head.t;
    m->mem.sequence = head.sequence;
    m->mem.last = fix;
    if (late) {
        m->mem.late_count++;
        return;
    }
    if (repeats || !orbit_sound(field, fix)) {
        m->mem.agree = 0u;
        m->mem.rejected_count++;
        return;
    }
    if (m->mem.running != 0u) {
        double dx[7] = {0.0}, misfit = 0.0;
        const int vague = position_variance(&there) > VAGUE * VAGUE;
        const Vec3 dr = vec_sub(fix.r, there.x.r), dv = vec_sub(fix.v, there.x.v);
        for (int i = 0; i < 6; i++) {
            misfit += i < 3 ? measure(there.root, i, dr.v[i], fix_std(m), dx)
                            : measure(there.root, i, dv.v[i - 3], m->par.velocity_std, dx);
        }
        there.x.r = vec_add(there.x.r, vec3(dx[0], dx[1], dx[2]));
        there.x.v = vec_add(there.x.v, vec3(dx[3], dx[4], dx[5]));
        there.along += dx[6];
        m->mem.misfit = isfinite(misfit) ? misfit : 0.0;
        /* undecided: a guard; no inputs are known at which this alone is not finite */
        if (!vague && misfit <= m->par.gate * m->par.gate && estimate_finite(&there)) {
            m->mem.at = there;
            count_used(m);
            return;
        }
        m->mem.rejected_count += vague ? 0u : 1u;
        if (!vague && !all_agree(m, field, fix)) {
            return;
        }
        m->mem.restarts++;
    }
    begin(m, fix);
    count_used(m);
}

static OrbitFilterState state_of(const OrbitFilter *m, const OrbitEstimate *e)
{
    OrbitFilterState s = m->out.state;
    s.misfit = m->mem.misfit;
    s.used = m->mem.used_count;
    s.rejected = m->mem.rejected_count;
    s.late = m->mem.late_count;
    s.restarts = m->mem.restarts;
    if (m->mem.running != 0u) {
        const double size = vec_norm(e->x.r), n = fm_sqrt(m->par.mu / size) / size;
        double std[7];
        for (int j = 0; j < 7; j++) {
            double sum = j < 3 ? m->par.wander * m->par.wander : 0.0;
            sum += j >= 3 && j < 6 ? n * n * m->par.wander * m->par.wander : 0.0;
            for (int i = 0; i < 7; i++) {
                sum += e->root[i][j] * e->root[i][j];
            }
            std[j] = fm_sqrt(sum);
        }
        s.position_std = vec3(std[0], std[1], std[2]);
        s.velocity_std = vec3(std[3], std[4], std[5]);
        s.along = e->along;
        s.along_std = std[6];
    }
    return s;
}

void orbit_filter_update(OrbitFilter *m, Tick t)
{
    OrbitFilter next = *m;
    const NavOrbit *fix = &next.in.fix;
    Quality placed;
    const Vec3 pole = orbit_pole(&m->in.planet, &placed);
    const OrbitField field = {m->par.mu, m->par.radius, m->par.J2, m->par.J3, m->par.J4, pole};
    const double reach = (double)m->par.steps * m->par.step;
    const double kept = (m->par.latency < reach ? m->par.latency : reach) + m->par.step;

    if (t.t < next.mem.now) { /* the clock went back */
        next.mem.restarts += next.mem.running != 0u ? 1u : 0u;
        next.mem.running = next.mem.agree = next.mem.any = 0u;
    }
    next.mem.now = t.t;
    /* undecided: guards; the bounds of the parameter are within, and what is not behind leaves below */
    for (uint32_t k = 0u; k < ORBIT_STEPS_MAX && k < m->par.steps && next.mem.running != 0u && next.mem.at.t < t.t;
         k++) {
        const int64_t step = orbit_step_ns(m->par.step);
        if (step == 0 || !(tick_seconds(tick_since(t.t, next.mem.at.t)) >= kept)) {
            break;
        }
        predict(&next.mem.at, &field, m, step);
    }
    if (next.mem.running != 0u && !estimate_finite(&next.mem.at)) { /* it is lost */
        next.mem.restarts++;
        next.mem.running = 0u;
    }
    if (fix->head.quality >= QUALITY_DEGRADED && fix->head.t <= t.t &&
        (next.mem.any == 0u || fix->head.t != next.mem.seen || fix->head.sequence != next.mem.sequence)) {
        process_fix(&next, &field, t.t, kept);
    }
    OrbitEstimate now = next.mem.at;
    if (next.mem.running != 0u) {
        predict_to(&now, &field, &next, t.t, m->par.steps + 1u);
    }
    OrbitFilterState state = state_of(&next, &now);
    const Vec3 a = orbit_acceleration(&field, now.x, now.along);
    const int running = next.mem.running != 0u;
    const double std = vec_norm(state.position_std);
    m->out.orbit.head = head_held(m->out.orbit.head);
    /* undecided: a guard; no inputs are known at which this alone is not finite */
    if (next.mem.any != 0u && vec_finite(state.position_std) && vec_finite(state.velocity_std) &&
        isfinite(state.along) && isfinite(state.along_std)) {
        if (running && orbit_step_ns(m->par.step) > 0 && estimate_finite(&now) && vec_finite(a)) {
            const int good = now.t == t.t && next.mem.running >= m->par.persistence && std <= m->par.good;
            const Quality quality = good ? quality_min(placed, next.mem.quality) : QUALITY_DEGRADED;
            m->mem = next.mem;
            m->out.orbit = (NavOrbit){head_next(m->out.orbit.head, now.t, quality), now.x.r, now.x.v, a};
            state.head = head_next(m->out.state.head, now.t, quality);
            m->out.state = state;
            return;
        }
        if (!running) {
            m->mem = next.mem;
            state.head = head_next(m->out.state.head, t.t, QUALITY_DEGRADED);
            m->out.state = state;
            return;
        }
    }
    m->out.state.head = head_held(m->out.state.head);
}
