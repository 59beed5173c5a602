// SPDX-License-Identifier: Apache-2.0
// Torque = -damping omega_BN + noise, drawn anew at each update and held until the next.
#include "world/eddy_damping_model.h"

namespace my_sat {

// Before each set of runs: check what the face's header cannot say, make room. Nothing from the heap
// later on.
void EddyDampingModel::prepare(const fledge::sim::Setup &setup)
{
    seeded_ = fledge::sim::Random(setup.seed, setup.name);
}

// Before each run: the initial state from the parameters.
void EddyDampingModel::reset(fledge::sim::Ns)
{
    random_ = seeded_;
    face_.out = {};
}

// Advance to tick.t, with the inputs held since tick.t - tick.dt.
void EddyDampingModel::update(Tick tick)
{
    ForceTorque &load = face_.out.load;
    Vec3 torque_B = vec_scale(-face_.par.damping, face_.in.truth.omega_BN_B);
    if (face_.par.noise > 0.0) {
        for (double &component : torque_B.v) {
            component += face_.par.noise * random_.normal();
        }
    }
    load.torque_B = torque_B;
    load.head = head_next(load.head, tick.t, quality_through(face_.in.truth.head));
}

} // namespace my_sat
