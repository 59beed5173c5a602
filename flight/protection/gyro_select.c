/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/gyro_select.h"

void gyro_select_reset(GyroSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void gyro_select_update(GyroSelect *m, Tick t)
{
    const void *const in[] = {&m->in.a, &m->in.b};
    const int finite[] = {vec_finite(m->in.a.omega_BN_B), vec_finite(m->in.b.omega_BN_B)};
    pass_chosen(&m->out.choice, &m->mem.memory, &m->in.units, m->par.places, 2, in, finite, &m->out.rate,
                sizeof m->out.rate, t.t);
}
