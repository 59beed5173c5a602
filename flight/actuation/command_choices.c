/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/command_choices.h"

#include <string.h>

static int all_finite(const double *x, int n)
{
    for (int i = 0; i < n; i++) {
        if (!isfinite(x[i])) {
            return 0;
        }
    }
    return 1;
}

/* chosen, out: messages of a size, heads first. sound: whether the numbers of the first are finite. */
static void pass_on(const void *chosen, void *out, size_t size, int sound, int64_t t)
{
    Head head, last;
    memcpy(&head, chosen, sizeof head);
    memcpy(&last, out, sizeof last);
    if (!head_written(head) || !sound) {
        last = head_held(last);
        memcpy(out, &last, sizeof last);
        return;
    }
    head = (Head){head_time(head, t), head.quality, last.sequence};
    const int same =
        head.t == last.t && head.quality == last.quality &&
        memcmp((const char *)chosen + sizeof head, (const char *)out + sizeof head, size - sizeof head) == 0;
    if (!same) {
        head.sequence++;
        memcpy(out, chosen, size);
        memcpy(out, &head, sizeof head);
    }
}

void rod_command_choice_reset(RodCommandChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void rod_command_choice_update(RodCommandChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, all_finite(m->in.chosen.dipole, RODS_MAX), t.t);
}

void wheel_command_choice_reset(WheelCommandChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void wheel_command_choice_update(WheelCommandChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, all_finite(m->in.chosen.u, WHEELS_MAX), t.t);
}

void wheel_drive_choice_reset(WheelDriveChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void wheel_drive_choice_update(WheelDriveChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, 1, t.t);
}

void gimbal_rates_choice_reset(GimbalRatesChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void gimbal_rates_choice_update(GimbalRatesChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, all_finite(m->in.chosen.rate, WHEELS_MAX), t.t);
}

void gimbal_torques_choice_reset(GimbalTorquesChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void gimbal_torques_choice_update(GimbalTorquesChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, all_finite(m->in.chosen.u, WHEELS_MAX), t.t);
}

void thruster_times_choice_reset(ThrusterTimesChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void thruster_times_choice_update(ThrusterTimesChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, 1, t.t);
}

void thruster_valves_choice_reset(ThrusterValvesChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void thruster_valves_choice_update(ThrusterValvesChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, 1, t.t);
}

void panel_command_choice_reset(PanelCommandChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void panel_command_choice_update(PanelCommandChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command,
            all_finite(m->in.chosen.theta, PANELS_MAX) && all_finite(m->in.chosen.u, PANELS_MAX), t.t);
}

void array_drive_command_choice_reset(ArrayDriveCommandChoice *m)
{
    memset(&m->out, 0, sizeof m->out);
}

void array_drive_command_choice_update(ArrayDriveCommandChoice *m, Tick t)
{
    pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, 1, t.t);
}
