/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/control/mrp_steering.h"

#include <string.h>

#include "flight/math/attitude.h"

#define TWO_OVER_PI 0.63661977236758134308

void mrp_steering_reset(MrpSteering *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void mrp_steering_update(MrpSteering *m, Tick t)
{
    const AttError *error = &m->in.error;
    RateCommand *out = &m->out.command;
    const double most = TWO_OVER_PI * m->par.omega_max;
    const Vec3 dsigma = mrp_rate(error->sigma_BR, error->omega_BR_B);

    RateCommand command;
    for (int i = 0; i < 3; i++) {
        const double x = error->sigma_BR.v[i];
        const double y = (m->par.K1 + m->par.K3 * x * x) * x / most;
        const double slope = (m->par.K1 + 3.0 * m->par.K3 * x * x) / (1.0 + y * y);
        command.omega_DR_B.v[i] = -most * fm_atan(y);
        command.domega_DR_B.v[i] = -slope * dsigma.v[i];
    }
    const Quality quality = quality_through(error->head);
    if (quality != QUALITY_NONE && vec_finite(command.omega_DR_B) && vec_finite(command.domega_DR_B)) {
        command.head = head_next(out->head, t.t, quality);
        *out = command;
    } else {
        out->head = head_held(out->head);
    }
}
