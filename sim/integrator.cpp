// SPDX-License-Identifier: Apache-2.0
// Two methods of Runge and Kutta: the classical one with a fixed step, and one of order 8 that
// chooses its steps.
#include "sim/integrator.h"

#include "flight/math/elementary.h"
#include "flight/msg/head.h"
#include "sim/dop853.h"
#include "sim/error.h"
#include "sim/text.h"
#include "sim/wide.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace fledge::sim {

namespace {

void check_padding(std::size_t n)
{
    if (n % state_block != 0) {
        throw std::invalid_argument("the number of states is no multiple of state_block");
    }
}

// k1 = f(t, x), k2 = f(t + h/2, x + h/2 k1), k3 = f(t + h/2, x + h/2 k2), k4 = f(t + h, x + h k3),
// x += h/6 (k1 + 2 k2 + 2 k3 + k4). k1 is the caller's.
class Rk4 final : public Integrator {
public:
    void resize(std::size_t n) override
    {
        check_padding(n);
        n_ = n;
        work_.assign(4 * n, 0.0);
    }

    void advance(System &system, Ns start, Ns dt, double *x, const double *dx) override
    {
        in_registers<&Rk4::advance_by>(*this, system, start, tick_seconds(dt), x, dx);
    }

    std::unique_ptr<Integrator> fresh() const override { return make_rk4(); }

    std::string describe() const override
    {
        return "the classical method of Runge and Kutta, of order 4, one step per update";
    }

    bool is_rk4() const override { return true; }

private:
    [[gnu::always_inline]] void advance_by(System &system, Ns start, double h, double *x, const double *dx)
    {
        // A rigid craft has 16 states, with up to four wheels 20, with two panels as well 28, with four gyros 28: loops
        // of known length are a tenth of such a step faster.
        switch (n_) {
        case 16: return step<16>(system, start, h, x, dx);
        case 20: return step<20>(system, start, h, x, dx);
        case 24: return step<24>(system, start, h, x, dx);
        case 28: return step<28>(system, start, h, x, dx);
        case 32: return step<32>(system, start, h, x, dx);
        default: return step<0>(system, start, h, x, dx);
        }
    }

    /// known: the number of states, 0 if only n_ knows it.
    template <std::size_t known>
    [[gnu::always_inline]] void step(System &system, Ns start, double h, double *x, const double *dx)
    {
        const std::size_t n = known ? known : n_;
        double *const k2 = work_.data(), *const k3 = k2 + n, *const k4 = k3 + n;
        double *const probe = k4 + n;
        shift(n, x, 0.5 * h, dx, probe);
        system.derive(start, 0.5 * h, probe, k2);
        shift(n, x, 0.5 * h, k2, probe);
        system.derive(start, 0.5 * h, probe, k3);
        shift(n, x, h, k3, probe);
        system.derive(start, h, probe, k4);
        const double sixth = h / 6.0;
        for (std::size_t i = 0; i < n; i += state_block) {
            for (std::size_t j = i; j < i + state_block; j++) {
                x[j] += sixth * ((dx[j] + k4[j]) + 2.0 * (k2[j] + k3[j]));
            }
        }
        system.normalize(x);
    }

    /// probe = x + h k
    [[gnu::always_inline]] static void shift(std::size_t n, const double *x, double h, const double *k,
                                             double *__restrict probe)
    {
        for (std::size_t i = 0; i < n; i += state_block) {
            for (std::size_t j = i; j < i + state_block; j++) {
                probe[j] = x[j] + h * k[j];
            }
        }
    }

    std::size_t n_ = 0;
    std::vector<double> work_;
};

/// x^y for x > 0, the same bits everywhere.
double power(double x, double y)
{
    return fm_exp(y * fm_log(x));
}

// The error of a step is measured, as in DOP853, by err = E5^2 / sqrt(E5^2 + 0.01 E3^2), where E5
// and E3 are the largest ratios of an estimated error to its tolerance: it falls as h^8, although
// neither estimate is of that order. The largest ratio, rather than the usual root mean square,
// holds every state to its tolerance and does not depend on how many only pad a block.
//
// Step sizes follow the proportional-integral control of Gustafsson,
//   h_next = 0.9 h err^(-0.7 / 8) err_before^(0.4 / 8),
// which does not oscillate where stability limits the step.
class Adaptive final : public Integrator {
public:
    Adaptive(double relative, double absolute) : relative_(relative), absolute_(absolute)
    {
        const auto refuse = [](const std::string &rule, double found) {
            throw SetupError("adaptive integrator: " + rule + "; found " + format_number(found));
        };
        if (!(relative >= 1e-15 && relative < 1.0)) {
            refuse("the relative tolerance must be in [1e-15, 1)", relative);
        }
        if (!(absolute > 0.0 && std::isfinite(absolute))) {
            refuse("the absolute tolerance must be > 0", absolute);
        }
    }

    void resize(std::size_t n) override
    {
        check_padding(n);
        n_ = n;
        work_.assign((dop853::stages + 2) * n, 0.0);
    }

    std::size_t carried() const override { return 2; }
    std::array<double, 2> tolerances() const override { return {relative_, absolute_}; }

    void advance(System &system, Ns start, Ns dt, double *x, const double *dx) override
    {
        const double length = tick_seconds(dt);
        double &carried_step = x[n_], &carried_error = x[n_ + 1]; // 0: none yet
        double tau = 0.0;
        int steps = 0;
        std::copy(dx, dx + n_, k(0));
        double wanted = carried_step > 0.0 ? carried_step : first_step(system, start, length, x);
        bool rejected = false;

        while (true) {
            const double left = length - tau;
            // Two equal steps rather than a long and a tiny one.
            const double h = wanted >= left ? left : std::min(wanted, 0.5 * left);
            if (++steps > steps_max || !(h >= length * step_min)) {
                give_up(steps > steps_max, start, tau);
            }
            const double error = try_step(system, start, tau, h, x);
            if (!(error <= 1.0)) {
                const double factor = error < infinity ? 0.9 * power(error, -1.0 / 8.0) : 0.0;
                wanted = h * std::max(factor, 0.2);
                rejected = true;
                continue;
            }
            std::copy(next(), next() + n_, x);
            system.normalize(x);

            double factor = 0.9 * power(std::max(error, 1e-10), -0.7 / 8.0);
            if (carried_error > 0.0) {
                factor *= power(carried_error, 0.4 / 8.0);
            }
            factor = std::clamp(factor, 0.333, rejected ? 1.0 : 6.0);
            if (h < wanted) {
                wanted = std::max(wanted, factor * h); // h was cut by the update's end only
            } else {
                wanted = factor * h;
                carried_error = std::max(error, 1e-4);
            }
            rejected = false;
            if (h == left) {
                break;
            }
            tau += h;
            system.derive(start, tau, x, k(0));
        }
        carried_step = wanted;
    }

    std::unique_ptr<Integrator> fresh() const override { return make_adaptive(relative_, absolute_); }

    std::string describe() const override
    {
        return "the method of Dormand and Prince, of order 8, steps chosen for a relative error "
               "of " +
               format_number(relative_) + " and an absolute one of " + format_number(absolute_);
    }

private:
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    static constexpr int steps_max = 100000;  // per update
    static constexpr double step_min = 1e-14; // of the update's length

    double *k(int stage) { return work_.data() + static_cast<std::size_t>(stage) * n_; }
    double *probe() { return k(dop853::stages); }
    double *next() { return k(dop853::stages + 1); }

    double tolerance(double x) const { return absolute_ + relative_ * std::abs(x); }

    /// to = x + h sum_j weights_j k_j over the first stages.
    void combine(const double *x, double h, const double *weights, int stages, double *__restrict to)
    {
        std::fill(to, to + n_, 0.0);
        for (int j = 0; j < stages; j++) {
            if (weights[j] != 0.0) {
                const double w = weights[j];
                const double *__restrict kj = k(j);
                for (std::size_t i = 0; i < n_; i++) {
                    to[i] += w * kj[i];
                }
            }
        }
        for (std::size_t i = 0; i < n_; i++) {
            to[i] = x[i] + h * to[i];
        }
    }

    /// Needs k(0); fills the other stages and next(). Returns the error over its tolerance, not
    /// finite if any of it is not.
    double try_step(System &system, Ns start, double tau, double h, const double *x)
    {
        for (int stage = 1; stage < dop853::stages; stage++) {
            combine(x, h, dop853::a[stage], stage, probe());
            system.derive(start, tau + dop853::c[stage] * h, probe(), k(stage));
        }
        combine(x, h, dop853::b, dop853::stages, next());
        double worst5 = 0.0, worst3 = 0.0;
        for (std::size_t i = 0; i < n_; i++) {
            double error5 = 0.0, error3 = 0.0;
            for (int stage = 0; stage < dop853::stages; stage++) {
                error5 += dop853::e5[stage] * k(stage)[i];
                error3 += dop853::e3[stage] * k(stage)[i];
            }
            const double scale = h / tolerance(std::max(std::abs(x[i]), std::abs(next()[i])));
            error5 = std::abs(error5 * scale);
            error3 = std::abs(error3 * scale);
            if (!(error5 < infinity && error3 < infinity)) {
                return infinity;
            }
            worst5 = std::max(worst5, error5);
            worst3 = std::max(worst3, error3);
        }
        const double square = worst5 * worst5;
        return square > 0.0 ? square / fm_sqrt(square + 0.01 * worst3 * worst3) : 0.0;
    }

    /// A first step from the size of x, x' and a difference of x'. Needs k(0).
    /// Source: Hairer, Noersett, Wanner, section II.4.
    double first_step(System &system, Ns start, double length, const double *x)
    {
        double state = 0.0, slope = 0.0, bend = 0.0;
        for (std::size_t i = 0; i < n_; i++) {
            state = std::max(state, std::abs(x[i]) / tolerance(x[i]));
            slope = std::max(slope, std::abs(k(0)[i]) / tolerance(x[i]));
        }
        const double guess = std::min(length, state < 1e-5 || slope < 1e-5 ? 1e-6 * length : 0.01 * state / slope);
        for (std::size_t i = 0; i < n_; i++) {
            probe()[i] = x[i] + guess * k(0)[i];
        }
        system.derive(start, guess, probe(), k(1));
        for (std::size_t i = 0; i < n_; i++) {
            bend = std::max(bend, std::abs(k(1)[i] - k(0)[i]) / (guess * tolerance(x[i])));
        }
        const double most = std::max(slope, bend);
        const double step = most > 0.0 ? power(0.01 / most, 1.0 / 8.0) : length;
        return std::min({step, 100.0 * guess, length});
    }

    [[noreturn]] void give_up(bool too_many, Ns start, double tau)
    {
        const auto finite = [&](const double *from) {
            return std::all_of(from, from + n_, [](double value) { return std::isfinite(value); });
        };
        const std::string what = !finite(k(0)) ? "the derivative is not finite"
                                 : too_many ? "one update would take more than " + std::to_string(steps_max) + " steps"
                                            : "steps would become too short for the clock's resolution";
        throw RunError("adaptive integrator, relative tolerance " + format_number(relative_) + ", absolute " +
                       format_number(absolute_) + ": " + what + ", " + format_number(tau) + " s after " +
                       format_time(start));
    }

    double relative_, absolute_;
    std::size_t n_ = 0;
    std::vector<double> work_; // the stages, a state to evaluate, the state at the step's end
};

} // namespace

std::unique_ptr<Integrator> make_rk4()
{
    return std::make_unique<Rk4>();
}

std::unique_ptr<Integrator> make_adaptive(double relative, double absolute)
{
    return std::make_unique<Adaptive>(relative, absolute);
}

} // namespace fledge::sim
