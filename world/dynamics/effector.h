// SPDX-License-Identifier: Apache-2.0
// A part of a spacecraft that exchanges momentum with it and may have states of its own.
//
// A part's states are chosen so that their derivatives need the body's angular rate, not its
// acceleration (for a wheel: its inertial angular momentum, not its speed). Then the body's own
// inertia is constant, however many parts move, and
//
//   I_B domega = -omega x (I_B omega + momentum) + torque
//
// needs one virtual call per part and stage of the integrator. In the same call, a part takes from its own
// momentum what it gives to the body, so only rounding changes the sum.
#pragma once

#include "flight/math/vec.h"
#include "sim/model.h"

namespace fledge::world {

/// What the parts do to the body; each adds its own. B components.
struct Loads {
    Vec3 momentum; ///< [N m s] angular momentum that is not in I_B omega
    Vec3 torque;   ///< [N m]   torque on the body
};

/// The rotation of the body. B components.
struct BodyRate {
    Vec3 omega;  ///< [rad/s]
    Vec3 domega; ///< [rad/s^2] as last published
};

/// All that latch() computes and derive() uses belongs to memory(): where latch() finds no change after a snapshot was
/// restored, the spacecraft uses the derivatives that it computed before the snapshot.
class Effector : public sim::Model {
public:
    /// The number of its states, a multiple of state_block. It is constant, and valid before prepare().
    virtual std::size_t states() const = 0;

    /// Forget the run, and write the initial states.
    virtual void start(const Vec3 &omega, double *x) = 0;

    /// Read the inputs, which are constant for the next dt [s]. If dt is 0, they do not act.
    /// Returns whether the results of derive() change.
    virtual bool latch(const double *x, const BodyRate &rate, double dt) = 0;

    /// Write the states' derivatives and add the loads.
    virtual void derive(const double *x, const Vec3 &omega, double *dx, Loads &loads) const = 0;

    /// Write the outputs for time t.
    virtual void publish(sim::Ns t, const double *x, const Vec3 &omega) = 0;

    /// Make it a part of this spacecraft. False if it is a part of another one.
    bool claim(const sim::Model &spacecraft)
    {
        if (!host_) {
            host_ = &spacecraft;
        }
        return host_ == &spacecraft;
    }

    // The spacecraft resets and updates its parts by the functions above.
    void reset(sim::Ns) final {}
    void update(Tick) final {}

private:
    const sim::Model *host_ = nullptr;
};

} // namespace fledge::world
