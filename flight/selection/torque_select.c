/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/selection/torque_select.h"

void torque_select_reset(TorqueSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void torque_select_update(TorqueSelect *m, Tick t)
{
    const void *const in[] = {&m->in.a, &m->in.b, &m->in.c};
    pass_newest(&m->mem.memory, 3, in, &m->out.torque, sizeof m->out.torque);
    (void)t;
}
