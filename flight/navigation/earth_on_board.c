/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/navigation/earth_on_board.h"

#include <string.h>

#include "flight/navigation/earth_orientation.h"

void earth_on_board_reset(EarthOnBoard *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void earth_on_board_update(EarthOnBoard *m, Tick t)
{
    const double days = earth_days(m->in.time.time);
    const Quality known = earth_known(days) ? QUALITY_GOOD : QUALITY_DEGRADED;
    const Mat3 dcm_PN = earth_dcm_PN_ut1(days, m->par.dut1);
    PlanetAttitude *earth = &m->out.earth;
    if (head_written(m->in.time.head) && mat_finite(dcm_PN)) {
        const Quality quality = quality_min(quality_through(m->in.time.head), known);
        *earth = (PlanetAttitude){head_next(earth->head, t.t, quality), dcm_PN, earth_omega_PN_N(dcm_PN)};
    } else {
        earth->head = head_held(earth->head);
    }
    m->out.centre.head = earth->head; /* all else of it is zero */
}
