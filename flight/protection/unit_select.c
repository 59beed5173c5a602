/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/protection/unit_select.h"

#include <string.h>

/* Pass on the message of the first of n <= UNIT_CHOICES units that is in use and speaks, else of the first that is in
 * use; if none is, or it has written nothing yet, the output holds what it has. The message keeps its time and
 * quality, as on a wire; the output counts its own writings, one for each of those that it passes on.
 * table: never written: all are in use. places: of the units in it. in, out: messages of a size, heads first. */
static void pass_chosen(UnitChoice *choice, ChoiceMemory *memory, const UnitTable *table, const uint32_t *places, int n,
                        const void *const *in, void *out, size_t size, int64_t t)
{
    Head heads[UNIT_CHOICES], last;
    int taken = -1;
    for (int i = 0; i < n; i++) {
        memcpy(&heads[i], in[i], sizeof heads[i]);
        choice->age[i] = tick_seconds(tick_since(t, heads[i].t));
        const int used = !head_written(table->head) || unit_used(table, places[i]);
        const int speaks = heads[i].quality >= QUALITY_DEGRADED;
        if (used && (taken < 0 || (speaks && heads[taken].quality < QUALITY_DEGRADED))) {
            taken = i;
        }
    }
    const uint32_t now = (uint32_t)(taken + 1);
    choice->changes += head_written(choice->head) && choice->taken != now;
    choice->taken = now;
    choice->head = head_next(choice->head, t, taken < 0 ? QUALITY_DEGRADED : QUALITY_GOOD);
    memcpy(&last, out, sizeof last);
    if (taken < 0 || !head_written(heads[taken])) {
        last = head_held(last);
    } else {
        const uint32_t is_new = memory->passed != now || memory->sequence != heads[taken].sequence;
        memory->passed = now;
        memory->sequence = heads[taken].sequence;
        memcpy(out, in[taken], size);
        last = (Head){heads[taken].t, heads[taken].quality, last.sequence + is_new};
    }
    memcpy(out, &last, sizeof last);
}

/* A message; one whose numbers are not finite counts as never written. */
static StarAttitude stars_heard(const StarAttitude *stars)
{
    StarAttitude heard = *stars;
    if (!vec_finite(heard.sigma_BN) || !mat_finite(heard.P_B)) {
        memset(&heard, 0, sizeof heard);
    }
    return heard;
}

static GyroRate gyro_heard(const GyroRate *gyro)
{
    GyroRate heard = *gyro;
    if (!vec_finite(heard.omega_BN_B)) {
        memset(&heard, 0, sizeof heard);
    }
    return heard;
}

void star_select_reset(StarSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void star_select_update(StarSelect *m, Tick t)
{
    const StarAttitude a = stars_heard(&m->in.a), b = stars_heard(&m->in.b);
    const void *const in[] = {&a, &b};
    pass_chosen(&m->out.choice, &m->mem.memory, &m->in.units, m->par.places, 2, in, &m->out.attitude,
                sizeof m->out.attitude, t.t);
}

void gyro_select_reset(GyroSelect *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void gyro_select_update(GyroSelect *m, Tick t)
{
    const GyroRate a = gyro_heard(&m->in.a), b = gyro_heard(&m->in.b);
    const void *const in[] = {&a, &b};
    pass_chosen(&m->out.choice, &m->mem.memory, &m->in.units, m->par.places, 2, in, &m->out.rate, sizeof m->out.rate,
                t.t);
}
