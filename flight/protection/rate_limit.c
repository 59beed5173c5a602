/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/rate_limit.h"

#include <string.h>

#include "flight/protection/persistence.h"

void rate_limit_reset(RateLimit *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void rate_limit_update(RateLimit *m, Tick t)
{
    const GyroRate *rate = &m->in.rate;
    judge(&m->out.state, &m->mem.judgement, t.t, data_time(rate->head, t.t), rate->head.quality,
          vec_norm(rate->omega_BN_B) / m->par.rate_max, m->par.persistence, m->par.release);
}
