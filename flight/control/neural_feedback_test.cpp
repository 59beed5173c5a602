// SPDX-License-Identifier: Apache-2.0
// The network against matrices of Eigen and the tangent of libm, in any shape that it can have.
#include "flight/testing/eigen.h"
#include "flight/testing/poison.h"

extern "C" {
#include "flight/control/neural_feedback.h"
}

#include <cmath>

namespace flight::testing {
namespace neural_feedback_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A network of any shape and function; of the largest, if `whole`.
NeuralFeedback any(Random &random, bool whole = false)
{
    NeuralFeedback m{};
    m.in.error = {good(), vec(random.vector()), vec(random.vector(0.1)), vec(random.vector()), vec(random.vector())};
    m.par.sigma_unit = random.real(0.1, 2);
    m.par.omega_unit = random.real(0.01, 1);
    m.par.torque_max = random.real(0.01, 10);
    m.par.activation = random.below(2) ? NEURAL_RELU : NEURAL_TANH;
    m.par.hidden = whole ? NEURAL_HIDDEN_MAX : static_cast<std::uint32_t>(random.below(NEURAL_HIDDEN_MAX + 1));
    for (std::uint32_t &n : m.par.neurons) {
        n = whole ? NEURAL_NEURONS_MAX : 1 + static_cast<std::uint32_t>(random.below(NEURAL_NEURONS_MAX));
    }
    const double size = random.real(0.1, 0.8);
    for (double &weight : m.par.weights) {
        weight = random.real(-size, size);
    }
    return m;
}

Vector3d torque_of(NeuralFeedback m)
{
    neural_feedback_update(&m, {0, 0});
    EXPECT_EQ(m.out.torque.head.quality, QUALITY_GOOD);
    return eigen(m.out.torque.torque_B);
}

/// The same by matrices; `used`: how many weights it has.
Vector3d expected_of(const NeuralFeedback &m, std::size_t *used = nullptr)
{
    VectorXd x(6);
    x << eigen(m.in.error.sigma_BR) / m.par.sigma_unit, eigen(m.in.error.omega_BR_B) / m.par.omega_unit;
    const double *w = m.par.weights;
    for (std::uint32_t k = 0; k <= m.par.hidden; k++) {
        const bool last = k == m.par.hidden;
        const Eigen::Index n = last ? 3 : m.par.neurons[k];
        using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const VectorXd y = Eigen::Map<const Rows>(w, n, x.size()) * x + Eigen::Map<const VectorXd>(w + n * x.size(), n);
        w += n * (x.size() + 1);
        x = last ? y : y.unaryExpr([&](double z) {
            return m.par.activation == NEURAL_RELU ? std::max(0.0, z) : std::tanh(z);
        });
    }
    if (used) {
        *used = static_cast<std::size_t>(w - m.par.weights);
    }
    return m.par.torque_max * x.cwiseMax(-1).cwiseMin(1);
}

TEST(NeuralFeedback, is_what_its_matrices_say)
{
    Random random{1};
    int cut = 0, free = 0;
    for (int i = 0; i < runs(2000); i++) {
        const NeuralFeedback m = any(random);
        const Vector3d found = torque_of(m);
        EXPECT_LT((found - expected_of(m)).norm(), 1e-12 * m.par.torque_max) << i;
        (found.cwiseAbs().maxCoeff() == m.par.torque_max ? cut : free)++;
    }
    EXPECT_TRUE(cut > runs(2000) / 20 && free > runs(2000) / 20) << cut << " and " << free;
}

TEST(NeuralFeedback, the_largest_network_uses_all_weights)
{
    Random random{2};
    const NeuralFeedback m = any(random, true);
    std::size_t used = 0;
    expected_of(m, &used);
    EXPECT_EQ(used, std::size(m.par.weights));
    NeuralFeedback other = m;
    other.par.weights[used - 1] += torque_of(m).z() > 0 ? -1 : 1;
    EXPECT_NE(torque_of(other).z(), torque_of(m).z());
}

TEST(NeuralFeedback, saturated_neurons_are_exact_and_without_biases_it_is_odd)
{
    Random random{3};
    for (int i = 0; i < runs(200); i++) {
        NeuralFeedback m = any(random);
        m.par.activation = NEURAL_TANH;
        m.par.hidden = 1;
        const std::size_t n = m.par.neurons[0];
        std::fill(m.par.weights + 6 * n, m.par.weights + 7 * n, 0.0);
        std::fill(m.par.weights + 10 * n, m.par.weights + 10 * n + 3, 0.0);
        NeuralFeedback back = m;
        back.in.error.sigma_BR = vec_neg(m.in.error.sigma_BR);
        back.in.error.omega_BR_B = vec_neg(m.in.error.omega_BR_B);
        EXPECT_EQ(torque_of(back), -torque_of(m));
        m.in.error.sigma_BR = m.in.error.omega_BR_B = vec3(0, 0, 0);
        EXPECT_EQ(torque_of(m).norm(), 0);

        std::fill(m.par.weights + 6 * n, m.par.weights + 7 * n, i % 2 ? 800.0 : -800.0);
        std::fill(m.par.weights + 7 * n, m.par.weights + 10 * n, 0.25 / static_cast<double>(n));
        for (double x : torque_of(m)) {
            EXPECT_NEAR(x, (i % 2 ? 0.25 : -0.25) * m.par.torque_max, 1e-13 * m.par.torque_max);
        }
    }
}

TEST(NeuralFeedback, ends_without_usable_errors)
{
    Random random{4};
    expect_torque_ends(any(random), neural_feedback_update,
                       [](NeuralFeedback &m) { return std::pair(&m.in.error.head, &m.in.error.omega_BR_B.v[1]); });
}

TEST(NeuralFeedback, holds_the_last_torque_against_numbers_that_are_not_finite)
{
    Random random{5};
    NeuralFeedback m = any(random, true);
    neural_feedback_update(&m, {0, 0});
    expect_held(
        m, doubles(m.in.error.sigma_BR, m.in.error.omega_BR_B, m.par.torque_max),
        [](NeuralFeedback &module) {
            neural_feedback_update(&module, {5, 5});
        },
        [](NeuralFeedback &module) { return std::vector<Head *>{&module.out.torque.head}; });
}

} // namespace neural_feedback_test
} // namespace flight::testing
