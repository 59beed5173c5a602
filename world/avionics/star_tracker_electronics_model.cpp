// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/star_tracker_electronics_model.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

void StarTrackerElectronicsModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const StarAttitude &attitude = interface_.in.attitude;
    StarTrackerRegisters &out = interface_.out.registers;
    auto &mem = interface_.mem;
    begin_faults(tick.t);
    const bool fresh = head_written(attitude.head) && attitude.head.sequence != mem.sequence;
    mem.sequence = attitude.head.sequence;
    if (!powered()) {
        out.head = head_next(out.head, tick.t, QUALITY_GOOD);
        return;
    }
    if (fresh) {
        const double full = static_cast<double>((std::int64_t{1} << (par.bits - 1)) - 1);
        const Quat q = mrp_to_quat(mrp_compose(par.sigma_SB, attitude.sigma_BN));
        for (std::size_t i = 0; i < 4; i++) {
            double count = full * q.q[i];
            state_.faults.apply(i, {&count, 1}, -full, full);
            out.q[i] = static_cast<std::int32_t>(std::clamp(std::round(count), -full, full));
        }
        const Mat3 dcm_SB = mrp_to_dcm(par.sigma_SB);
        const Vec3 across_B = vec3(dcm_SB.m[0][0], dcm_SB.m[0][1], dcm_SB.m[0][2]);
        const double deviation = fm_sqrt(std::max(vec_dot(across_B, mat_vec(attitude.P_B, across_B)), 0.0));
        out.residual = static_cast<std::uint32_t>(std::clamp(std::round(deviation / par.residual), 0.0, 65535.0));
        out.time = time_tag(attitude.head.t, par.tick);
        out.counter++;
        mem.measured = attitude.head.t;
    }
    const sim::Ns most = par.lost_after > 0 ? par.lost_after : sim::Ns{1'000'000'000};
    out.tracks = out.counter > 0 && tick_since(tick.t, mem.measured) <= most;
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
