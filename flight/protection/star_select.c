/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/star_select.h"

void star_select_reset(StarSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

static int is_finite(const StarAttitude *stars)
{
    return vec_finite(stars->sigma_BN) && mat_finite(stars->P_B);
}

void star_select_update(StarSelect *m, Tick t)
{
    const void *const in[] = {&m->in.a, &m->in.b};
    const int finite[] = {is_finite(&m->in.a), is_finite(&m->in.b)};
    pass_chosen(&m->out.choice, &m->mem.memory, &m->in.units, m->par.places, 2, in, finite, &m->out.attitude,
                sizeof m->out.attitude, t.t);
}
