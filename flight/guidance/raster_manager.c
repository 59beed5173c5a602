/* SPDX-License-Identifier: Apache-2.0 */
/* The raster in effect is found anew at each update from the time since the list began, in whole
 * ns, so nothing accumulates and nothing has to be noticed in time. */
#include "flight/guidance/raster_manager.h"

#include <string.h>

/* The longest raster, in s: sixteen of them fit twice into the ns of an int64_t. */
static const double LONGEST = 5e8;

/* A list of rasters, wherever it lies. */
typedef struct Rasters {
    int64_t start; /* [ns] */
    uint32_t n, repeat;
    const Vec3 *angles, *rates;
    const double *durations;
} Rasters;

static Rasters of_message(const RasterList *list)
{
    return (Rasters){list->start, list->n, list->repeat, list->angles, list->rates, list->durations};
}

static Rasters of_parameters(const RasterManager *m)
{
    return (Rasters){m->mem.start, m->par.n, m->par.repeat, m->par.angles, m->par.rates, m->par.durations};
}

/* For 0 <= seconds <= LONGEST. */
static int64_t nearest_ns(double seconds)
{
    double ns = seconds * 1e9;
    int64_t whole = (int64_t)ns;
    return ns - (double)whole < 0.5 ? whole : whole + 1;
}

/* The durations in ns; 0 if this is no list of rasters. */
static int durations_ns(const Rasters *rasters, int64_t durations[RASTERS_MAX])
{
    int good = rasters->n > 0u && rasters->n <= RASTERS_MAX && rasters->start >= 0;
    for (uint32_t i = 0; good && i < rasters->n; i++) {
        double seconds = rasters->durations[i];
        good = seconds > 0.0 && seconds <= LONGEST && vec_finite(rasters->angles[i]) && vec_finite(rasters->rates[i]);
        durations[i] = good ? nearest_ns(seconds) : 0;
        good = good && durations[i] > 0;
    }
    return good;
}

/* The raster in effect at t; before the start, the first one. 0 if the result is not finite. */
static int raster_at(const Rasters *rasters, const int64_t durations[RASTERS_MAX], int64_t t, EulerCommand *command,
                     RasterStatus *status)
{
    int64_t total = 0;
    for (uint32_t k = 0; k < rasters->n; k++) {
        total += durations[k];
    }
    if (t < rasters->start) {
        t = rasters->start;
    }
    int64_t elapsed = t - rasters->start; /* no start is below zero */
    int64_t cycle = elapsed / total;
    int done = cycle > 0 && !rasters->repeat;
    uint32_t i = 0;
    if (done) {
        i = rasters->n - 1u;
        cycle = 1;
        elapsed -= total;
        Vec3 turned = vec_scale(tick_seconds(durations[i]), rasters->rates[i]);
        command->angles = vec_add(rasters->angles[i], turned);
        command->rates = vec3(0.0, 0.0, 0.0);
    } else {
        elapsed -= cycle * total;
        for (; elapsed >= durations[i]; i++) { /* ends before n, for elapsed < total */
            elapsed -= durations[i];
        }
        command->angles = rasters->angles[i];
        command->rates = rasters->rates[i];
    }
    command->start = t - elapsed;
    status->elapsed = elapsed;
    status->cycle = cycle;
    status->index = i;
    status->done = (uint32_t)done;
    return vec_finite(command->angles);
}

void raster_manager_reset(RasterManager *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void raster_manager_update(RasterManager *m, Tick t)
{
    const RasterList *list = &m->in.list;
    if (!m->mem.running) {
        m->mem.running = 1;
        m->mem.start = t.t > 0 ? t.t : 0;
    }

    int64_t durations[RASTERS_MAX];
    int commanded = head_written(m->mem.commanded.head);
    Rasters rasters = commanded ? of_message(&m->mem.commanded) : of_parameters(m);
    Rasters offered = of_message(list);
    int good = durations_ns(&offered, durations);
    int refused = head_written(list->head) && !good;
    int taken = head_written(list->head) && good && list->start <= t.t;
    if (taken) {
        rasters = offered;
    } else {
        good = durations_ns(&rasters, durations);
    }

    EulerCommand command;
    RasterStatus status;
    if (good && raster_at(&rasters, durations, t.t, &command, &status)) {
        Quality quality = refused ? QUALITY_DEGRADED : quality_optional(list->head);
        status.refused = (uint32_t)refused;
        status.spare = 0;
        status.head = head_next(m->out.status.head, t.t, quality);
        command.head = head_next(m->out.command.head, t.t, quality);
        m->out.command = command;
        m->out.status = status;
        if (taken) {
            m->mem.commanded = *list;
        }
    } else {
        m->out.command.head = head_held(m->out.command.head);
        m->out.status.head = head_held(m->out.status.head);
    }
}
