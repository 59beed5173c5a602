// SPDX-License-Identifier: Apache-2.0
#include "world/units_model.h"

#include "flight/math/attitude.h"

#include <algorithm>
#include <bit>

namespace flatsat {

void UnitsModel::reset(fledge::sim::Ns)
{
    interface_.out = {};
    interface_.mem = {};
    std::fill_n(interface_.out.cards.temperature, CARDS, 280.0);
}

void UnitsModel::update(Tick tick)
{
    const auto &in = interface_.in;
    const auto &par = interface_.par;
    auto &out = interface_.out;
    auto &mem = interface_.mem;
    const auto next = [&](Head head) { return head_next(head, tick.t, QUALITY_GOOD); };

    const Vec3 s_B = mat_vec(mrp_to_dcm(in.truth.sigma_BN), vec3(par.s_N[0], par.s_N[1], par.s_N[2]));
    out.sun.head = next(out.sun.head);
    for (unsigned i = 0; i < SUN_SENSORS; i++) {
        const Vec3 n = vec3(i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0);
        out.sun.current[i] = par.current * std::max(0.0, vec_dot(n, s_B) * 0.5773502691896258);
        out.sun.saturated[i] = out.sun.current[i] > 0.009;
    }

    out.motors.head = next(out.motors.head);
    double load = 1.0;
    for (int i = 0; i < MOTORS; i++) {
        out.motors.u[i] = par.motor * in.volts.volts[i];
        load += 10.0 * (in.torques.u[i] < 0.0 ? -in.torques.u[i] : in.torques.u[i]);
    }

    mem.commands += in.power.number != out.reply.number;
    out.reply = {next(out.reply.head), in.power.number, in.power.cards};
    load += 0.5 * std::popcount(in.power.cards);
    out.cards.head = next(out.cards.head);
    for (int i = 0; i < CARDS; i++) {
        double &temperature = out.cards.temperature[i];
        const double goal = (in.power.cards >> i & 1) ? 300.0 + i : 270.0;
        temperature += (goal - temperature) * std::min(1.0, tick_seconds(tick.dt) / 200.0);
    }
    out.bus = {next(out.bus.head), 28.0 - 0.1 * load, load - 2.0};

    mem.modes += in.flown.mode != (out.request.mode ? out.request.mode : in.flown.mode);
    out.request.head = next(out.request.head);
    out.request.mode = tick.t < par.burns_from ? 1 : 2;
    out.recorder.head = next(out.recorder.head);
    out.recorder.fill = std::min(1.0, tick_seconds(tick.t) / par.full);

    if (in.burn.number != mem.burns) {
        mem.burns = in.burn.number;
        mem.burnt[in.burn.thruster % 12] += in.burn.duration;
    }
}

} // namespace flatsat
