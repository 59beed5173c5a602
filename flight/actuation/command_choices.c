/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/actuation/command_choices.h"

#include <string.h>

#include "flight/math/vec.h"

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

/* The two functions of a module; sound: whether the numbers of m->in.chosen are finite. A type has no parentheses:
 * NOLINTBEGIN(bugprone-macro-parentheses) */
#define CHOICE(Type, reset, update, sound)                                                                             \
    void reset(Type *m)                                                                                                \
    {                                                                                                                  \
        memset(&m->out, 0, sizeof m->out);                                                                             \
    }                                                                                                                  \
    void update(Type *m, Tick t)                                                                                       \
    {                                                                                                                  \
        pass_on(&m->in.chosen, &m->out.command, sizeof m->out.command, sound, t.t);                                    \
    }
/* NOLINTEND(bugprone-macro-parentheses) */

CHOICE(RodCommandChoice, rod_command_choice_reset, rod_command_choice_update,
       numbers_finite(m->in.chosen.dipole, RODS_MAX))
CHOICE(WheelCommandChoice, wheel_command_choice_reset, wheel_command_choice_update,
       numbers_finite(m->in.chosen.u, WHEELS_MAX))
CHOICE(WheelDriveChoice, wheel_drive_choice_reset, wheel_drive_choice_update, 1)
CHOICE(GimbalRatesChoice, gimbal_rates_choice_reset, gimbal_rates_choice_update,
       numbers_finite(m->in.chosen.rate, WHEELS_MAX))
CHOICE(GimbalTorquesChoice, gimbal_torques_choice_reset, gimbal_torques_choice_update,
       numbers_finite(m->in.chosen.u, WHEELS_MAX))
CHOICE(ThrusterTimesChoice, thruster_times_choice_reset, thruster_times_choice_update, 1)
CHOICE(ThrusterValvesChoice, thruster_valves_choice_reset, thruster_valves_choice_update, 1)
CHOICE(PanelCommandChoice, panel_command_choice_reset, panel_command_choice_update,
       numbers_finite(m->in.chosen.theta, PANELS_MAX) && numbers_finite(m->in.chosen.u, PANELS_MAX))
CHOICE(ArrayDriveCommandChoice, array_drive_command_choice_reset, array_drive_command_choice_update, 1)
