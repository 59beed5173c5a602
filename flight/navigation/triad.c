/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/triad.h"

#include <string.h>

#include "flight/navigation/attitude_fix.h"

void triad_reset(Triad *m)
{
    memset(&m->out, 0, sizeof m->out);
}

/* The triad as rows, which is the attitude of its frame. */
static Mat3 triad(Vec3 first, Vec3 second)
{
    const Vec3 a = vec_unit(first), c = vec_unit(vec_cross(first, second));
    return mat_rows(a, vec_cross(c, a), c);
}

static Mat3 covariance(Vec3 w1, Vec3 w2, double var1, double var2)
{
    const double c = vec_dot(w1, w2), s2 = vec_norm2(vec_cross(w1, w2));
    Mat3 P;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const double about = (var2 - var1) * w1.v[i] * w1.v[j],
                         both = var1 * c * (w1.v[i] * w2.v[j] + w2.v[i] * w1.v[j]);
            P.m[i][j] = (i == j ? var1 : 0.0) + (about + both) / s2;
        }
    }
    return P;
}

void triad_update(Triad *m, Tick t)
{
    const SeenDirection *const all[] = {&m->in.primary, &m->in.secondary}, *a = all[0], *b = all[1];
    const FixChoice c = fix_choose(all, 2, QUALITY_DEGRADED, t.t, m->out.attitude.head, m->par.together);
    if (c.together == 2u && c.n < 2u && quality_min(a->head.quality, b->head.quality) == QUALITY_GOOD) {
        return; /* not both are new */
    }
    Vec3 sigma_BN = vec3(0.0, 0.0, 0.0);
    Mat3 P_B = {{{0.0}}};
    double misfit = 0.0;
    FixFinding finding = c.n < 2u ? FIX_ALONE : FIX_SOUND;
    if (finding == FIX_SOUND && !fix_apart(a, b, m->par.separation_min)) {
        finding = FIX_PARALLEL;
    }
    if (finding == FIX_SOUND) {
        const double var_a = a->std * a->std, var_b = b->std * b->std;
        const double rest = vec_angle(a->d_B, b->d_B) - vec_angle(a->d_N, b->d_N);
        sigma_BN = dcm_to_mrp(mat_mul(mat_transpose(triad(a->d_B, b->d_B)), triad(a->d_N, b->d_N)));
        P_B = covariance(vec_unit(a->d_B), vec_unit(b->d_B), var_a, var_b);
        misfit = rest * rest / (var_a + var_b);
    }
    fix_write(&m->out.attitude, &m->out.state, &c, finding, sigma_BN, P_B, misfit, m->par.gate, t.t);
}
