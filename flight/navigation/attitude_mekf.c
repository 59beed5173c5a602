/* SPDX-License-Identifier: Apache-2.0 */
/* A deviation of the attitude is theta itself. */
#include "flight/navigation/attitude_mekf.h"

static Mat3 to_turn(Vec3 sigma)
{
    (void)sigma;
    return mat_identity();
}

static Mat3 from_turn(Vec3 sigma)
{
    (void)sigma;
    return mat_identity();
}

static int predict(AttitudeEstimate *e, const GyroSpan *span, double (*rows)[6])
{
    memcpy(rows, e->root, sizeof e->root);
    rows_turn(rows, 6, span);
    e->sigma_BN = mrp_compose(span->sigma, e->sigma_BN);
    return 6;
}

static Vec3 innovation(Vec3 measured, Vec3 sigma)
{
    return vec_scale(4.0, mrp_relative(measured, sigma));
}

static void correct(AttitudeEstimate *e, Vec3 dx)
{
    e->sigma_BN = mrp_compose(vec_scale(0.25, dx), e->sigma_BN);
}

void attitude_mekf_reset(AttitudeMekf *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void attitude_mekf_update(AttitudeMekf *m, Tick t)
{
    const AttitudeFilterKind kind = {to_turn, from_turn, predict, innovation, correct};
    attitude_filter_update(&m->mem.filter, &kind, &m->par, &m->in.gyro, &m->in.stars, t, &m->out.attitude,
                           &m->out.state);
}
