/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/actuation: how a vector is shared among actuators along given axes, with the least norm. */
#ifndef FLIGHT_ACTUATION_ALLOCATION_H
#define FLIGHT_ACTUATION_ALLOCATION_H

#include "flight/math/mat.h"
#include "flight/msg/vehicle.h"

/** Whether an actuator may be used. Without a message of availability all may. */
static inline int may_use(Head availability, uint8_t available)
{
    return !head_written(availability) || available;
}

/** A A^T of columns that are added one by one, because a column that was just stored would have to be waited for. */
typedef struct Gram {
    double xx, yy, zz, xy, xz, yz;
} Gram;

static inline void gram_add(Gram *sum, Vec3 a)
{
    sum->xx += a.v[0] * a.v[0];
    sum->yy += a.v[1] * a.v[1];
    sum->zz += a.v[2] * a.v[2];
    sum->xy += a.v[0] * a.v[1];
    sum->xz += a.v[0] * a.v[2];
    sum->yz += a.v[1] * a.v[2];
}

/** (A A^T)^+ with its rank. A^T (A A^T)^+ y is the least-norm solution x of A x = y, or of A x nearest to y. Columns of
 *  zero take no part. */
static inline Mat3 gram_pinv(const Gram *g, int *rank)
{
    return mat_sym_pinv((Mat3){{{g->xx, g->xy, g->xz}, {g->xy, g->yy, g->yz}, {g->xz, g->yz, g->zz}}}, rank);
}

/** The largest factor <= 1 by which all commands stay within their limits, where 0 is none; NaN for a limit that is. */
static inline double within_limits(const double *limits, const double *u, uint32_t n)
{
    double factor = 1.0;
    for (uint32_t i = 0; i < n; i++) {
        if (isnan(limits[i])) {
            return limits[i];
        }
        if (limits[i] > 0.0 && fm_abs(u[i]) * factor > limits[i]) {
            factor = limits[i] / fm_abs(u[i]);
        }
    }
    return factor;
}

/** Writes what actuators are commanded, as head_acting() says: x, 0, or what they are. */
static inline void put_numbers(double *out, const double *x, uint32_t n, int acts)
{
    for (uint32_t i = 0; i < n && acts >= 0; i++) {
        out[i] = acts ? x[i] : 0.0;
    }
}

/** Writes the torque that a command gives, beside its head; acts: as head_acting() returned for that. */
static inline void put_achieved(BodyTorque *out, Vec3 torque_B, Head command, int64_t t, int acts)
{
    out->head = acts >= 0 ? head_next(out->head, t, command.quality) : head_held(out->head);
    if (acts >= 0) {
        out->torque_B = acts ? torque_B : vec3(0.0, 0.0, 0.0);
    }
}

#endif
