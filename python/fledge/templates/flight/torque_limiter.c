/* SPDX-License-Identifier: Apache-2.0 */
/* The torque moves straight to the wanted torque, by at most  rate dt  per update. */
#include "flight/torque_limiter.h"

#include <string.h>

/* Called before the first update, and when the module's task restarts. Parameters stay. */
void torque_limiter_reset(TorqueLimiter *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* Called at each run of the task: t.t is the time, t.dt the time since the last update (0 at first). */
void torque_limiter_update(TorqueLimiter *m, Tick t)
{
    Vec3 torque_B = m->in.wanted.torque_B;
    Vec3 change = vec_sub(torque_B, m->mem.torque_B);
    double size = vec_norm(change);
    double most = m->par.rate * tick_seconds(t.dt);
    if (size > most) {
        torque_B = vec_add(m->mem.torque_B, vec_scale(most / size, change));
    }

    /* An output has the quality of its inputs. Without data, or without a finite result, the module
     * holds its last output. See flight/msg/head.h. */
    BodyTorque *out = &m->out.torque;
    Quality quality = quality_through(m->in.wanted.head);
    if (quality != QUALITY_NONE && vec_finite(torque_B)) {
        out->head = head_next(out->head, t.t, quality);
        out->torque_B = torque_B;
        m->mem.torque_B = torque_B;
    } else {
        out->head = head_held(out->head);
    }
}
