/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/sensing/field_direction.h"

#include <string.h>

void field_direction_reset(FieldDirection *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void field_direction_update(FieldDirection *m, Tick t)
{
    const Head field = m->in.field.head, known = m->in.known.head;
    SeenDirection *seen = &m->out.seen;
    FieldAgreement *agreement = &m->out.agreement;
    const int is_new = !head_written(agreement->head) || field.t > agreement->head.t || agreement->head.t > t.t;
    if (field.t > t.t || (!is_new && field.quality == QUALITY_GOOD)) {
        return; /* it waits, or was looked at */
    }
    const Quality quality = quality_min(quality_through(field), quality_through(known));
    if (!is_new || quality < QUALITY_DEGRADED) {
        seen->head = head_held(seen->head);
        agreement->head = head_held(agreement->head);
        return;
    }
    const double strength = vec_norm(m->in.known.B_N), noise = m->par.noise / strength;
    const double differ = vec_norm(m->in.field.B_B) / strength - 1.0;
    const SeenDirection next = {head_next(seen->head, field.t, quality), vec_unit(m->in.field.B_B),
                                vec_unit(m->in.known.B_N), fm_sqrt(m->par.std * m->par.std + noise * noise)};
    agreement->head = head_next(agreement->head, field.t, quality);
    agreement->differ = isfinite(differ) ? differ : 0.0;
    if (fm_abs(differ) <= m->par.differ && direction_speaks(&next)) {
        agreement->taken++;
        *seen = next;
    } else {
        agreement->refused++;
        seen->head = head_held(seen->head);
    }
}
