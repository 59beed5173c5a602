// SPDX-License-Identifier: Apache-2.0
// The errors of three sensors at right angles. Of a vector x, B components, the axes S of the case read
//
//   y = limited(rounded((1 + diag(scale)) [SB] x + bias + walked + n + faults)),
//   n: white, of variance noise / dt;   walked: gains white increments of variance walk dt at each update.
//
// So the sum of y dt has the variance noise t + walk t^3 / 3 (but for the sum's grid) whatever the period dt is.
// Source: IEEE Std 952 for the densities.
#pragma once

#include "world/sensors/sensor.h"

namespace fledge::world {

template <class Interface> class Triad : public Sensor<Interface, 3> {
public:
    using Sensor<Interface, 3>::Sensor;

protected:
    bool limited() const override { return this->interface_.par.limit > 0.0; }

    /// Make of x what the sensors read. Returns whether they speak; without power they do not.
    bool read(Tick tick, Vec3 &x)
    {
        const auto &par = this->interface_.par;
        auto &mem = this->interface_.mem;
        Faults<3> &faults = this->state_.faults;
        const double dt = tick_seconds(tick.dt), most = par.limit > 0.0 ? par.limit : unlimited;
        x = mat_vec(mrp_to_dcm(mrp_turn(par.misalignment)), x);
        for (int i = 0; i < 3; i++) {
            // Both are always drawn, so that one without a density leaves the other as it was.
            const double step = this->normal(), noise = this->normal();
            mem.walked.v[i] += fm_sqrt(par.walk.v[i] * dt) * step;
            x.v[i] += par.scale.v[i] * x.v[i] + par.bias.v[i] + mem.walked.v[i];
            x.v[i] += dt > 0.0 ? fm_sqrt(par.noise.v[i] / dt) * noise : 0.0;
        }
        this->begin_faults(tick.t);
        const bool speaks = faults.apply(0, x.v, -most, most);
        bool cut = false;
        for (double &y : x.v) {
            cut |= std::abs(y) > most;
            y = std::clamp(par.step > 0.0 ? par.step * std::round(y / par.step) : y, -most, most);
        }
        mem.saturated += cut;
        return speaks && this->powered();
    }
};

} // namespace fledge::world
