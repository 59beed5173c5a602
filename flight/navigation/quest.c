/* SPDX-License-Identifier: Apache-2.0 */
/* With the weights a_i, whose sum is 1, and
 *     B = sum a_i w_i v_i^T,   S = B + B^T,   z = sum a_i w_i x v_i,   s = tr B,   k = tr adj S,
 * the eigenvalues of Davenport's matrix K are the roots of
 *     l^4 - (a + b) l^2 - c l + a b + c s - d,
 *     a = s^2 - k,   b = s^2 + z^2,   c = det S + z . S z,   d = |S z|^2.
 * All are at most 1, and the largest is the first that Newton's method meets from there. Its quaternion is along
 *     ((l + s) (l^2 - s^2 + k) - det S,   (l^2 - s^2 + k) z + (l - s) S z + S S z).
 * That is a column of adj (K - l I), and the longer, the larger the scalar part. N turned by 180 degrees about each of
 * its axes has the other columns; the longest of the four counts (the method of sequential rotations).
 * For small turns x of the attitude, b_i = [BN] v_i, the sum of Wahba has the minimum where
 *     sum a_i ((w_i . b_i) I - (w_i b_i^T + b_i w_i^T) / 2) x = sum a_i w_i x b_i. */
#include "flight/navigation/quest.h"

#include <string.h>

#include "flight/navigation/attitude_fix.h"

#define NEWTON_STEPS 12
#define POLISH_STEPS 2

void quest_reset(Quest *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* A + A^T */
static Mat3 twice_symmetric(Mat3 A)
{
    Mat3 S;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            S.m[i][j] = A.m[i][j] + A.m[j][i];
        }
    }
    return S;
}

typedef struct Profile {
    Mat3 S;
    Vec3 z;
    double s, k, det;
} Profile;

/* Of the B for N turned by 180 degrees about an axis; other axes: not turned. */
static Profile profile_of(Mat3 B, int axis)
{
    Profile p;
    for (int i = 0; i < 3 && axis < 3; i++) {
        for (int j = 0; j < 3; j++) {
            B.m[i][j] = j != axis ? -B.m[i][j] : B.m[i][j];
        }
    }
    p.S = twice_symmetric(B);
    const double xx = p.S.m[0][0], xy = p.S.m[0][1], xz = p.S.m[0][2];
    const double yy = p.S.m[1][1], yz = p.S.m[1][2], zz = p.S.m[2][2];
    p.z = vec3(B.m[1][2] - B.m[2][1], B.m[2][0] - B.m[0][2], B.m[0][1] - B.m[1][0]);
    p.s = B.m[0][0] + B.m[1][1] + B.m[2][2];
    p.k = yy * zz - yz * yz + xx * zz - xz * xz + xx * yy - xy * xy;
    p.det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    return p;
}

static double largest_eigenvalue(const Profile *p)
{
    const Vec3 Sz = mat_vec(p->S, p->z);
    const double a = p->s * p->s - p->k, b = p->s * p->s + vec_norm2(p->z);
    const double c = p->det + vec_dot(p->z, Sz), last = a * b + c * p->s - vec_norm2(Sz);
    double l = 1.0;
    for (int i = 0; i < NEWTON_STEPS; i++) {
        const double value = ((l * l - (a + b)) * l - c) * l + last, slope = (4.0 * l * l - 2.0 * (a + b)) * l - c;
        const double step = slope > 0.0 ? value / slope : 0.0;
        l -= step > 0.0 ? step : 0.0; /* from above; the rest is rounding */
    }
    return l;
}

static Vec3 eigenvector(Mat3 B, double l)
{
    Vec3 sigma_BN = vec3(0.0, 0.0, 0.0);
    double longest = 0.0;
    for (int axis = 0; axis < 4; axis++) {
        const Profile p = profile_of(B, axis);
        const Vec3 Sz = mat_vec(p.S, p.z);
        const double a = l * l - p.s * p.s + p.k, scalar = (l + p.s) * a - p.det;
        const Vec3 x = vec_add(vec_scale(a, p.z), vec_add(vec_scale(l - p.s, Sz), mat_vec(p.S, Sz)));
        const double length = fm_sqrt(scalar * scalar + vec_norm2(x));
        if (length > longest) {
            longest = length;
            sigma_BN = mrp_project(scalar, x, length);
            if (axis < 3) {
                Vec3 half = vec3(0.0, 0.0, 0.0);
                half.v[axis] = 1.0;
                sigma_BN = mrp_compose(sigma_BN, half);
            }
        }
    }
    return sigma_BN;
}

static Vec3 polished(const FixChoice *c, const double *weight, Vec3 sigma_BN)
{
    for (int k = 0; k < POLISH_STEPS; k++) {
        const Mat3 dcm_BN = mrp_to_dcm(sigma_BN);
        Mat3 H = {{{0.0}}};
        Vec3 y = vec3(0.0, 0.0, 0.0);
        for (uint32_t i = 0u; i < c->n; i++) {
            const Vec3 w = vec_unit(c->d[i]->d_B), b = mat_vec(dcm_BN, vec_unit(c->d[i]->d_N));
            add_across(&H, weight[i], w, b);
            y = vec_add(y, vec_scale(weight[i], vec_cross(w, b)));
        }
        const Vec3 x = root_solve(mat_root(H), y);
        if (!(vec_norm2(x) < 0.01)) {
            return sigma_BN; /* no minimum near by: the directions contradict each other */
        }
        sigma_BN = mrp_compose(mrp_turn(x), sigma_BN);
    }
    return sigma_BN;
}

static Vec3 solve(const FixChoice *c)
{
    double weight[FIX_DIRECTIONS], sum = 0.0;
    Mat3 B = {{{0.0}}};
    for (uint32_t i = 0u; i < c->n; i++) {
        weight[i] = 1.0 / (c->d[i]->std * c->d[i]->std);
        sum += weight[i];
    }
    for (uint32_t i = 0u; i < c->n; i++) {
        const Vec3 w = vec_unit(c->d[i]->d_B), v = vec_unit(c->d[i]->d_N);
        weight[i] /= sum;
        for (int k = 0; k < 9; k++) {
            B.m[k / 3][k % 3] += weight[i] * w.v[k / 3] * v.v[k % 3];
        }
    }
    const Profile p = profile_of(B, 3);
    return polished(c, weight, eigenvector(B, largest_eigenvalue(&p)));
}

/* The misfit, and the covariance. */
static double judge(const FixChoice *c, Vec3 sigma_BN, Mat3 *P_B)
{
    const Mat3 dcm_BN = mrp_to_dcm(sigma_BN);
    Mat3 information = {{{0.0}}};
    double misfit = 0.0;
    for (uint32_t i = 0u; i < c->n; i++) {
        const Vec3 w = vec_unit(c->d[i]->d_B), b = mat_vec(dcm_BN, vec_unit(c->d[i]->d_N));
        const double weight = 1.0 / (c->d[i]->std * c->d[i]->std);
        misfit += weight * vec_norm2(vec_sub(w, b));
        add_across(&information, weight, b, b);
    }
    const Mat3 root = mat_root(information), I = mat_identity();
    for (int j = 0; j < 3; j++) {
        const Vec3 column = root_solve(root, vec3(I.m[0][j], I.m[1][j], I.m[2][j]));
        memcpy(P_B->m[j], vec_scale(0.5, column).v, sizeof column.v);
    }
    *P_B = twice_symmetric(*P_B);
    return misfit;
}

void quest_update(Quest *m, Tick t)
{
    const SeenDirection *const all[] = {&m->in.first, &m->in.second, &m->in.third, &m->in.fourth};
    const Head last = m->out.attitude.head;
    FixChoice c = fix_choose(all, FIX_DIRECTIONS, QUALITY_GOOD, t.t, last, m->par.together);
    if (c.together >= 2u && c.n < 2u) {
        return; /* not two of them are new */
    }
    if (c.n < 2u) {
        c = fix_choose(all, FIX_DIRECTIONS, QUALITY_DEGRADED, t.t, last, m->par.together);
    }
    FixFinding finding = c.n < 2u ? FIX_ALONE : FIX_PARALLEL;
    for (uint32_t i = 1u; i < c.n; i++) {
        for (uint32_t k = 0u; k < i; k++) {
            finding = fix_apart(c.d[i], c.d[k], m->par.separation_min) ? FIX_SOUND : finding;
        }
    }
    Vec3 sigma_BN = vec3(0.0, 0.0, 0.0);
    Mat3 P_B = {{{0.0}}};
    double misfit = 0.0;
    if (finding == FIX_SOUND) {
        sigma_BN = solve(&c);
        misfit = judge(&c, sigma_BN, &P_B);
    }
    fix_write(&m->out.attitude, &m->out.state, &c, finding, sigma_BN, P_B, misfit, m->par.gate, t.t);
}
