// SPDX-License-Identifier: Apache-2.0
#include "sim/integrator.h"

#include "sim/dop853.h"
#include "sim/error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace integrator_test {

using namespace fledge::sim;

// ---- The order conditions of the coefficients ---------------------------------------------------

/// A rooted tree is its root's subtrees, sorted, so that equal trees compare equal.
struct Tree {
    std::vector<Tree> branches;

    int order() const
    {
        int n = 1;
        for (const Tree &branch : branches) {
            n += branch.order();
        }
        return n;
    }

    /// gamma: the order times the gammas of the branches.
    double density() const
    {
        double gamma = order();
        for (const Tree &branch : branches) {
            gamma *= branch.density();
        }
        return gamma;
    }

    bool operator<(const Tree &other) const { return branches < other.branches; }
    bool operator==(const Tree &other) const { return branches == other.branches; }
};

/// All rooted trees of an order: a tree of order n is one of order n - 1 with a leaf hung onto one
/// of its nodes.
std::vector<Tree> grow(const Tree &tree)
{
    std::vector<Tree> grown;
    const auto add = [&](Tree t) {
        std::sort(t.branches.begin(), t.branches.end());
        grown.push_back(std::move(t));
    };
    Tree with_leaf = tree;
    with_leaf.branches.push_back({});
    add(with_leaf);
    for (std::size_t i = 0; i < tree.branches.size(); i++) {
        for (const Tree &branch : grow(tree.branches[i])) {
            Tree changed = tree;
            changed.branches[i] = branch;
            add(changed);
        }
    }
    return grown;
}

std::vector<Tree> trees(int order)
{
    if (order == 1) {
        return {Tree{}};
    }
    std::vector<Tree> all;
    for (const Tree &smaller : trees(order - 1)) {
        const auto grown = grow(smaller);
        all.insert(all.end(), grown.begin(), grown.end());
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
}

using Stages = std::vector<double>;

/// For each stage, the product over the branches of sum_j a_ij (product of branch)_j.
Stages elementary_weights(const Tree &tree)
{
    Stages product(dop853::stages, 1.0);
    for (const Tree &branch : tree.branches) {
        const Stages inner = elementary_weights(branch);
        for (int i = 0; i < dop853::stages; i++) {
            double sum = 0.0;
            for (int j = 0; j < i; j++) {
                sum += dop853::a[i][j] * inner[static_cast<std::size_t>(j)];
            }
            product[static_cast<std::size_t>(i)] *= sum;
        }
    }
    return product;
}

/// The largest |sum b_i phi_i - 1 / gamma| over all trees of an order.
double worst_residual(const double *b, int order)
{
    double worst = 0.0;
    for (const Tree &tree : trees(order)) {
        const Stages phi = elementary_weights(tree);
        double sum = 0.0;
        for (int i = 0; i < dop853::stages; i++) {
            sum += b[i] * phi[static_cast<std::size_t>(i)];
        }
        worst = std::max(worst, std::abs(sum - 1.0 / tree.density()));
    }
    return worst;
}

TEST(Dop853, TreesAreCounted)
{
    const std::size_t count[] = {1, 1, 2, 4, 9, 20, 48, 115}; // rooted trees of 1 to 8 nodes
    for (int order = 1; order <= 8; order++) {
        EXPECT_EQ(trees(order).size(), count[order - 1]);
    }
}

TEST(Dop853, SatisfiesAllConditionsOfOrder8)
{
    for (int order = 1; order <= 8; order++) {
        EXPECT_LT(worst_residual(dop853::b, order), 1e-14) << "order " << order;
    }
    EXPECT_GT(worst_residual(dop853::b, 9), 1e-7);
}

TEST(Dop853, RowsSumToTheNodes)
{
    for (int i = 0; i < dop853::stages; i++) {
        double sum = 0.0;
        for (int j = 0; j < i; j++) {
            sum += dop853::a[i][j];
        }
        EXPECT_NEAR(sum, dop853::c[i], 1e-14) << "stage " << i + 1;
    }
}

TEST(Dop853, EmbeddedMethodsAreOfOrders5And3)
{
    double b5[dop853::stages], b3[dop853::stages];
    for (int i = 0; i < dop853::stages; i++) {
        b5[i] = dop853::b[i] - dop853::e5[i];
        b3[i] = dop853::b[i] - dop853::e3[i];
    }
    for (int order = 1; order <= 5; order++) {
        EXPECT_LT(worst_residual(b5, order), 1e-14) << "order " << order;
    }
    EXPECT_GT(worst_residual(b5, 6), 1e-5);
    for (int order = 1; order <= 3; order++) {
        EXPECT_LT(worst_residual(b3, order), 1e-14) << "order " << order;
    }
    EXPECT_GT(worst_residual(b3, 4), 1e-4);
}

// ---- The methods at work ------------------------------------------------------------------------

using Function = std::function<void(double t, const double *x, double *dx)>;

/// A system from a lambda, with a count of its calls.
struct Problem final : System {
    Function f;
    int evaluations = 0;
    int normalized = 0;
    double last_tau = 0.0;

    explicit Problem(Function function) : f(std::move(function)) {}

    void derive(Ns start, double tau, const double *x, double *dx) override
    {
        evaluations++;
        last_tau = tau;
        f(1e-9 * static_cast<double>(start) + tau, x, dx);
    }
    void normalize(double *) override { normalized++; }
};

constexpr Ns second = 1'000'000'000;

/// One update, with the derivative that it begins with.
void advance(Integrator &method, System &system, Ns start, Ns dt, std::vector<double> &x)
{
    std::vector<double> dx(x.size());
    system.derive(start, 0.0, x.data(), dx.data());
    method.advance(system, start, dt, x.data(), dx.data());
}

/// x0 advanced from time 0 to `end` in `updates` equal updates.
std::vector<double> fly(Integrator &method, System &system, std::vector<double> x, Ns end, int updates)
{
    const std::size_t n = x.size();
    method.resize(n);
    x.resize(n + method.carried(), 0.0);
    const Ns dt = end / updates;
    for (int i = 0; i < updates; i++) {
        advance(method, system, i * dt, dt, x);
    }
    x.resize(n);
    return x;
}

/// The Kepler problem in the plane, mu = 1: x, y, vx, vy.
void kepler(double, const double *x, double *dx)
{
    const double r2 = x[0] * x[0] + x[1] * x[1];
    const double r3 = r2 * std::sqrt(r2);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = -x[0] / r3;
    dx[3] = -x[1] / r3;
}

/// At periapsis of an orbit with a = 1.
std::vector<double> at_periapsis(double e)
{
    return {1.0 - e, 0.0, 0.0, std::sqrt((1.0 + e) / (1.0 - e))};
}

double distance(const std::vector<double> &a, const std::vector<double> &b)
{
    double worst = 0.0;
    for (std::size_t i = 0; i < a.size(); i++) {
        worst = std::max(worst, std::abs(a[i] - b[i]));
    }
    return worst;
}

/// The Kepler state of an orbit with a = 1 at time t after periapsis, by Kepler's equation.
std::vector<double> kepler_exact(double e, double t)
{
    double E = t;
    for (int i = 0; i < 100; i++) {
        E -= (E - e * std::sin(E) - t) / (1.0 - e * std::cos(E));
    }
    const double b = std::sqrt(1.0 - e * e), rate = 1.0 / (1.0 - e * std::cos(E));
    return {std::cos(E) - e, b * std::sin(E), -rate * std::sin(E), rate * b * std::cos(E)};
}

TEST(Rk4, IsOfOrder4)
{
    double before = 0.0;
    for (const int steps : {200, 400, 800}) {
        auto method = make_rk4();
        Problem problem(kepler);
        const auto x = fly(*method, problem, at_periapsis(0.3), 8 * second, steps);
        EXPECT_EQ(problem.evaluations, 4 * steps);
        EXPECT_EQ(problem.normalized, steps);
        const double error = distance(x, kepler_exact(0.3, 8.0));
        if (before > 0.0) {
            EXPECT_NEAR(std::log2(before / error), 4.0, 0.25);
        }
        before = error;
    }
}

TEST(Rk4, SeesTheTimeOfItsStages)
{
    // x' = t^3 is integrated exactly: the method is Simpson's rule. The start lies years away.
    auto method = make_rk4();
    const Ns start = 300'000'000 * second;
    struct Cubic final : System {
        Ns start;
        void derive(Ns at, double tau, const double *, double *dx) override
        {
            EXPECT_EQ(at, start);
            std::fill(dx, dx + 4, 0.0);
            dx[0] = tau * tau * tau;
        }
    } cubic;
    cubic.start = start;
    method->resize(4);
    std::vector<double> x = {0.0, 0.0, 0.0, 0.0};
    advance(*method, cubic, start, 2 * second, x);
    EXPECT_DOUBLE_EQ(x[0], 4.0);
}

TEST(Integrators, RefuseWhatIsNoWholeBlock)
{
    EXPECT_THROW(make_rk4()->resize(6), std::invalid_argument);
    EXPECT_THROW(make_adaptive(1e-9, 1e-9)->resize(1), std::invalid_argument);
    EXPECT_EQ(padded(0), 0u);
    EXPECT_EQ(padded(1), 4u);
    EXPECT_EQ(padded(12), 12u);
}

TEST(Adaptive, EffortGrowsAsTheEighthRootOfAccuracy)
{
    // From 1e-6 to 1e-12 a method of order 8 needs 10^(6/8) = 5.6 times the evaluations, one of
    // order 5 would need 16 times. The error itself follows the tolerance.
    std::map<double, int> evaluations;
    for (const double tolerance : {1e-6, 1e-12}) {
        auto method = make_adaptive(tolerance, tolerance);
        Problem problem(kepler);
        const auto x = fly(*method, problem, at_periapsis(0.5), 20 * second, 1);
        EXPECT_LT(distance(x, kepler_exact(0.5, 20.0)), 300.0 * tolerance);
        evaluations[tolerance] = problem.evaluations;
    }
    EXPECT_NEAR(std::log10(evaluations[1e-12] / static_cast<double>(evaluations[1e-6])), 6.0 / 8.0, 0.15);
}

TEST(Adaptive, KeepsItsToleranceOnOrbitsOfAnyShape)
{
    for (const double e : {0.0, 0.4, 0.9, 0.99}) {
        auto method = make_adaptive(1e-12, 1e-14);
        Problem problem(kepler);
        const auto x = fly(*method, problem, at_periapsis(e), 10 * second, 7);
        EXPECT_LT(distance(x, kepler_exact(e, 10.0)), 1e-8) << "e = " << e;
        EXPECT_LT(problem.evaluations, 6000) << "e = " << e;
    }
}

TEST(Adaptive, EstimatesTheErrorOfQuadratures)
{
    // Here estimators that compare methods with the same quadrature weights see no error at all.
    const auto peak = [](double t, const double *, double *dx) {
        std::fill(dx, dx + 4, 0.0);
        dx[0] = 1e-3 / (1e-6 + (t - 1.0) * (t - 1.0)); // of width 0.001 at t = 1
    };
    auto method = make_adaptive(1e-10, 1e-10);
    Problem problem(peak);
    const auto x = fly(*method, problem, {0.0, 0.0, 0.0, 0.0}, 2 * second, 1);
    EXPECT_NEAR(x[0], 2.0 * std::atan(1e3), 1e-8);
}

TEST(Adaptive, HoldsEachStateToItsOwnTolerance)
{
    // A large state that never changes must not hide a small one's error.
    const auto decay = [](double, const double *x, double *dx) {
        dx[0] = 0.0;
        dx[1] = -x[1];
        dx[2] = dx[3] = 0.0;
    };
    auto method = make_adaptive(1e-10, 1e-20);
    Problem problem(decay);
    const auto x = fly(*method, problem, {1e9, 1e-3, 0.0, 0.0}, 10 * second, 1);
    EXPECT_NEAR(x[1] / (1e-3 * std::exp(-10.0)), 1.0, 1e-8);
    EXPECT_EQ(x[0], 1e9);
}

TEST(Adaptive, ItsStepsDoNotDependOnTheOrderOfStates)
{
    // All states begin with the same value and slope; one of them bends.
    const auto with_bent = [](std::size_t bent) {
        auto method = make_adaptive(1e-9, 1e-9);
        Problem problem([&](double, const double *x, double *dx) {
            std::fill(dx, dx + 4, 1.0);
            dx[bent] += std::sin(50.0 * (x[bent] - 1.0));
        });
        const auto x = fly(*method, problem, {1.0, 1.0, 1.0, 1.0}, second, 1);
        return std::pair(problem.evaluations, x[bent]);
    };
    for (std::size_t bent = 1; bent < 4; bent++) {
        EXPECT_EQ(with_bent(bent), with_bent(0));
    }
}

TEST(Adaptive, EndsExactlyWithTheUpdateAndCarriesItsStep)
{
    auto method = make_adaptive(1e-9, 1e-9);
    Problem problem(kepler);
    method->resize(4);
    auto x = at_periapsis(0.2);
    x.resize(4 + method->carried(), 0.0);
    const Ns dt = second / 10;
    std::vector<int> evaluations;
    for (int i = 0; i < 50; i++) {
        const int before = problem.evaluations;
        advance(*method, problem, i * dt, dt, x);
        evaluations.push_back(problem.evaluations - before);
        EXPECT_LE(problem.last_tau, 0.1);
        EXPECT_GT(x[4], 0.1); // the step is longer than the updates, and stays so
    }
    EXPECT_EQ(evaluations[0] % 12, 1); // one more, to choose the first step
    for (std::size_t i = 1; i < evaluations.size(); i++) {
        EXPECT_EQ(evaluations[i], 12);
    }
    x.resize(4);
    EXPECT_LT(distance(x, kepler_exact(0.2, 5.0)), 1e-8);
    EXPECT_EQ(problem.normalized, problem.evaluations / 12);
}

TEST(Adaptive, GoesOnFromItsStateAloneBitForBit)
{
    const Ns dt = 3 * second;
    auto method = make_adaptive(1e-8, 1e-8);
    Problem problem(kepler);
    method->resize(4);
    auto x = at_periapsis(0.7);
    x.resize(6, 0.0);
    advance(*method, problem, 0, dt, x);
    auto copy = x;
    advance(*method, problem, dt, dt, x);

    auto other = method->fresh();
    other->resize(4);
    advance(*other, problem, dt, dt, copy);
    EXPECT_EQ(std::memcmp(x.data(), copy.data(), 6 * sizeof(double)), 0);
}

TEST(Adaptive, CrossesADiscontinuity)
{
    const auto kick = [](double t, const double *, double *dx) {
        std::fill(dx, dx + 4, 0.0);
        dx[0] = t < 1.0 / 3.0 ? 1.0 : -1.0;
    };
    auto method = make_adaptive(1e-9, 1e-9);
    Problem problem(kick);
    const auto x = fly(*method, problem, {0.0, 0.0, 0.0, 0.0}, second, 1);
    EXPECT_NEAR(x[0], -1.0 / 3.0, 1e-7);
}

std::string message_of(const std::function<void()> &action)
{
    try {
        action();
    } catch (const std::exception &error) {
        return error.what();
    }
    return "(nothing was thrown)";
}

TEST(Adaptive, SaysWhenItCannotKeepItsTolerance)
{
    // x' = x^2 from 1 is infinite at t = 1.
    const auto explode = [](double, const double *x, double *dx) {
        std::fill(dx, dx + 4, 0.0);
        dx[0] = x[0] * x[0];
    };
    auto method = make_adaptive(1e-9, 1e-9);
    Problem problem(explode);
    EXPECT_THROW(fly(*method, problem, {1.0, 0.0, 0.0, 0.0}, 2 * second, 1), RunError);
    const std::string text = message_of([&] { fly(*method, problem, {1.0, 0.0, 0.0, 0.0}, 2 * second, 1); });
    EXPECT_NE(text.find("adaptive integrator, relative tolerance 1e-09, absolute 1e-09: "), std::string::npos) << text;
    EXPECT_NE(text.find("s after 0 s"), std::string::npos) << text;

    Problem undefined([](double, const double *, double *dx) { std::fill(dx, dx + 4, std::nan("")); });
    EXPECT_NE(message_of([&] {
                  fly(*method, undefined, {1.0, 0.0, 0.0, 0.0}, second, 1);
              }).find("the derivative is not finite"),
              std::string::npos);

    // A million radians per update need more steps than are granted.
    Problem fast([](double, const double *x, double *dx) {
        dx[0] = 1e7 * x[1];
        dx[1] = -1e7 * x[0];
        dx[2] = dx[3] = 0.0;
    });
    EXPECT_NE(message_of([&] {
                  fly(*method, fast, {1.0, 0.0, 0.0, 0.0}, second, 1);
              }).find("one update would take more than 100000 steps"),
              std::string::npos);
}

TEST(Adaptive, RefusesTolerancesThatMeanNothing)
{
    EXPECT_EQ(message_of([] { make_adaptive(0.0, 1e-9); }),
              "adaptive integrator: the relative tolerance must be in [1e-15, 1); found 0");
    EXPECT_EQ(message_of([] { make_adaptive(1e-9, 0.0); }),
              "adaptive integrator: the absolute tolerance must be > 0; found 0");
    EXPECT_THROW(make_adaptive(1e-9, -1.0), SetupError);
    EXPECT_THROW(make_adaptive(std::nan(""), 1e-9), SetupError);
    EXPECT_THROW(make_adaptive(1e-9, INFINITY), SetupError);
}

} // namespace integrator_test
