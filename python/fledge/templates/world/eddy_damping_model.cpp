// SPDX-License-Identifier: Apache-2.0
// Torque = -damping omega_BN + noise. Each update draws new noise, which stays until the next.
#include "world/eddy_damping_model.h"

namespace my_sat {

// Before each set of runs: check what the header cannot express, and allocate memory. A run allocates none.
void EddyDampingModel::prepare(const fledge::sim::Setup &setup)
{
    seeded_ = fledge::sim::Random(setup.seed, setup.name);
}

// Before each run: the initial state from the parameters.
void EddyDampingModel::reset(fledge::sim::Ns)
{
    random_ = seeded_;
    interface_.out = {};
}

// Advance to tick.t; the inputs are constant since tick.t - tick.dt.
void EddyDampingModel::update(Tick tick)
{
    ForceTorque &load = interface_.out.load;
    Vec3 torque_B = vec_scale(-interface_.par.damping, interface_.in.truth.omega_BN_B);
    if (interface_.par.noise > 0.0) {
        for (double &component : torque_B.v) {
            component += interface_.par.noise * random_.normal();
        }
    }
    load.torque_B = torque_B;
    load.head = head_next(load.head, tick.t, quality_through(interface_.in.truth.head));
}

} // namespace my_sat
