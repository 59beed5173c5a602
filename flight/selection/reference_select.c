/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/selection/reference_select.h"

void reference_select_reset(ReferenceSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void reference_select_update(ReferenceSelect *m, Tick t)
{
    const void *const in[] = {&m->in.a, &m->in.b, &m->in.c, &m->in.d, &m->in.e, &m->in.f};
    pass_newest(&m->mem.memory, 6, in, &m->out.reference, sizeof m->out.reference);
    (void)t;
}
