// SPDX-License-Identifier: Apache-2.0
// Ordinary differential equations x' = f(t, x), and the methods that advance them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace fledge::sim {

using Ns = std::int64_t;

/// States come in blocks of this many, so that loops over them are whole SIMD operations.
inline constexpr std::size_t state_block = 4;

/// The smallest multiple of state_block that holds n.
constexpr std::size_t padded(std::size_t n)
{
    return (n + state_block - 1) / state_block * state_block;
}

/// A system of differential equations. Time is (start of the update in ns, seconds since), so that it keeps its
/// resolution over years.
class System {
public:
    virtual ~System() = default;

    /// dx = f(start + tau, x). States that only pad a block have the derivative 0.
    virtual void derive(Ns start, double tau, const double *x, double *dx) = 0;

    /// Called with the state after every step: the place to change to equivalent coordinates that
    /// are farther from their singularity.
    virtual void normalize(double *x) { (void)x; }
};

/// A method. One object serves one system: it owns the work space, so advancing does not allocate.
class Integrator {
public:
    virtual ~Integrator() = default;

    /// Make room for n states. Called before the first step. Throws std::invalid_argument if n is
    /// no multiple of state_block.
    virtual void resize(std::size_t n) = 0;

    /// How many numbers the method carries from update to update. They stand behind the n states,
    /// in the caller's memory, so that a snapshot of that is complete; all are 0 at the beginning.
    virtual std::size_t carried() const { return 0; }

    /// Advance the states from `start` by `dt` > 0 ns, in place; x has n + carried() elements.
    /// dx is the derivative of x at `start`: the caller often has it from the last update, so it is
    /// not evaluated again. Throws RunError if the method cannot keep its tolerance.
    virtual void advance(System &system, Ns start, Ns dt, double *x, const double *dx) = 0;

    /// A fresh one with the same settings.
    virtual std::unique_ptr<Integrator> fresh() const = 0;

    virtual std::string describe() const = 0;

    /// That of make_adaptive(), (relative, absolute); 0 of a method that has none.
    virtual std::array<double, 2> tolerances() const { return {}; }

    /// Whether it is that of make_rk4(), whose step a system may then take itself.
    virtual bool is_rk4() const { return false; }
};

/// The classical fourth-order method of Runge and Kutta, one step per update.
std::unique_ptr<Integrator> make_rk4();

/// The method of Dormand and Prince of order 8 with the embedded error estimates of orders 5 and 3
/// (DOP853). Each update is covered by as many steps as the tolerances ask for, the last of which
/// ends exactly with it. A step is taken if the estimated error of every state is at most
/// absolute + relative |x|; the step size carries over to the next update.
/// Throws SetupError if a tolerance is negative or not finite, if `absolute` is 0, or if `relative`
/// is below 1e-15, which rounding alone exceeds.
std::unique_ptr<Integrator> make_adaptive(double relative, double absolute);

} // namespace fledge::sim
