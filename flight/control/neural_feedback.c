/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/control/neural_feedback.h"

#include <string.h>

#include "flight/math/elementary.h"

/* To about 2^-53 of 1, not of its value. */
static double hyperbolic_tangent(double x)
{
    const double e = fm_exp(-2.0 * fm_abs(x));
    const double y = (1.0 - e) / (1.0 + e);
    return x < 0.0 ? -y : y;
}

static double activated(NeuralActivation activation, double x)
{
    if (activation == NEURAL_RELU) {
        return x > 0.0 ? x : 0.0;
    }
    return hyperbolic_tangent(x);
}

static uint32_t at_most(uint32_t n, uint32_t most)
{
    return n < most ? n : most;
}

/* The layers in turn: `values` are their inputs, then their outputs. Returns 1, or 0 where a sum is not finite, which
 * an activation would hide. */
static int network(const NeuralFeedback *m, double values[NEURAL_NEURONS_MAX])
{
    const uint32_t hidden = at_most(m->par.hidden, NEURAL_HIDDEN_MAX);
    uint32_t inputs = NEURAL_INPUTS, at = 0;
    for (uint32_t k = 0; k <= hidden; k++) {
        const uint32_t outputs = k < hidden ? at_most(m->par.neurons[k], NEURAL_NEURONS_MAX) : NEURAL_OUTPUTS;
        double sums[NEURAL_NEURONS_MAX] = {0.0};
        for (uint32_t i = 0; i < outputs; i++) {
            double sum = m->par.weights[at + outputs * inputs + i];
            for (uint32_t j = 0; j < inputs; j++) {
                sum += m->par.weights[at + i * inputs + j] * values[j];
            }
            if (!isfinite(sum)) {
                return 0;
            }
            sums[i] = sum;
        }
        for (uint32_t i = 0; i < outputs; i++) {
            values[i] = k < hidden ? activated(m->par.activation, sums[i]) : sums[i];
        }
        at += outputs * (inputs + 1u);
        inputs = outputs;
    }
    return 1;
}

void neural_feedback_reset(NeuralFeedback *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void neural_feedback_update(NeuralFeedback *m, Tick t)
{
    const AttError *error = &m->in.error;
    double values[NEURAL_NEURONS_MAX] = {0.0};
    for (int i = 0; i < 3; i++) {
        values[i] = error->sigma_BR.v[i] / m->par.sigma_unit;
        values[3 + i] = error->omega_BR_B.v[i] / m->par.omega_unit;
    }
    const Quality quality = network(m, values) ? quality_through(error->head) : QUALITY_NONE;
    Vec3 torque_B = vec3(0.0, 0.0, 0.0);
    if (quality != QUALITY_NONE) {
        torque_B = vec_scale(m->par.torque_max, vec_clamp(vec3(values[0], values[1], values[2]), 1.0));
    }
    torque_put(&m->out.torque, torque_B, t, quality, data_time(error->head, t.t), m->par.hold, &m->mem.newest);
}
