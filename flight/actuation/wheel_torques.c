/* SPDX-License-Identifier: Apache-2.0 */
/* Minimum-norm wheel torques. With A = C G, whose columns are zero for wheels that may not be used,
 *     u = -A^T (A A^T)^+ C L,
 * which is -A^+ C L also where the wheels do not span the controlled axes. A A^T is of three,
 * however many the wheels, and inverted in closed form, so nothing is kept between updates. */
#include "flight/actuation/wheel_torques.h"

#include <string.h>

#include "flight/actuation/allocation.h"

void wheel_torques_reset(WheelTorques *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

/* C of unit axes, filled up with rows of zeros, which raise no rank. */
static Mat3 controlled_axes(const WheelTorques *m, int n_axes)
{
    Vec3 rows[3] = {{{0.0}}};
    for (int i = 0; i < n_axes; i++) {
        rows[i] = vec_unit(m->par.axes_B[i]);
    }
    return mat_rows(rows[0], rows[1], rows[2]);
}

/* Gives the motor torques before saturation; 1 if the wheels span the controlled axes. */
static int distribute(const WheelTorques *m, double u[WHEELS_MAX])
{
    const WheelSet *wheels = &m->in.wheels;
    const WheelAvailability *may = &m->in.availability;
    uint32_t n = wheels_count(wheels);
    int subset = m->par.n_axes > 0u && m->par.n_axes < 4u;
    int n_axes = subset ? (int)m->par.n_axes : 3;
    Mat3 C = subset ? controlled_axes(m, n_axes) : mat_identity();

    Vec3 A[WHEELS_MAX];
    Gram gram = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < n; i++) {
        Vec3 a = vec3(0.0, 0.0, 0.0);
        if (may_use(may->head, may->available[i])) {
            a = subset ? mat_vec(C, wheels->axes_B[i]) : wheels->axes_B[i];
        }
        A[i] = a;
        gram_add(&gram, a);
    }
    int rank;
    Vec3 y = mat_vec(gram_pinv(&gram, &rank), mat_vec(C, m->in.torque.torque_B));
    for (uint32_t i = 0; i < n; i++) {
        u[i] = -vec_dot(A[i], y);
    }
    return rank == n_axes;
}

/* open command: each u[i] is finite where their sum along the axes is, torque_B */
void wheel_torques_update(WheelTorques *m, Tick t)
{
    const WheelSet *wheels = &m->in.wheels;
    WheelCommand *command = &m->out.command;

    double u[WHEELS_MAX] = {0.0};
    int spanned = distribute(m, u);
    double factor = within_limits(wheels->u_max, u, wheels_count(wheels));
    Vec3 torque_B = vec3(0.0, 0.0, 0.0);
    for (uint32_t i = 0; i < wheels_count(wheels); i++) {
        u[i] *= factor;
        torque_B = vec_sub(torque_B, vec_scale(u[i], wheels->axes_B[i]));
    }

    Quality quality = quality_min(quality_through(m->in.torque.head), quality_through(wheels->head));
    quality = quality_min(quality, quality_optional(m->in.availability.head));
    if (!spanned) {
        quality = quality_min(quality, QUALITY_DEGRADED);
    }
    if (!vec_finite(torque_B)) { /* else every u[i] is finite too */
        quality = QUALITY_NONE;
    }
    const int acts =
        head_acting(&command->head, t, quality, data_time(m->in.torque.head, t.t), m->par.hold, &m->mem.newest);
    put_numbers(command->u, u, WHEELS_MAX, acts);
    put_achieved(&m->out.achieved, torque_B, command->head, t.t, acts);
    m->mem.saturated += acts > 0 && factor < 1.0;
}
