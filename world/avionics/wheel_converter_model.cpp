// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/wheel_converter_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fledge::world {

void WheelConverterModel::update(Tick tick)
{
    const auto &[drive, speeds, injected, power] = interface_.in;
    const auto &par = interface_.par;
    auto &mem = interface_.mem;
    auto &[torques, tachometers] = interface_.out;

    const bool on = powered(), driven = on && head_written(drive.head);
    const std::int32_t end = std::int32_t{1} << (par.bits - 1);
    bool limited = false, speaks = false;
    Faults<2 *WHEELS_MAX> &faults = state_.faults;
    begin_faults(tick.t);
    for (std::uint32_t i = 0; i < par.n; i++) {
        const std::int32_t counts = std::clamp(drive.counts[i], -end, end - 1);
        const double volts = par.volts * counts / end;
        double current = driven ? (volts - par.back_emf * speeds.Omega[i]) / par.resistance : 0.0;
        const double most = par.current_max > 0.0 ? par.current_max : std::abs(current);
        limited |= driven && (counts != drive.counts[i] || std::abs(current) > most);
        current = std::clamp(current, -most, most);
        const double strongest = par.current_max > 0.0 ? par.torque_constant * par.current_max : unlimited;
        double torque = par.torque_constant * current;
        faults.apply(i, {&torque, 1}, -strongest, strongest);
        torques.u[i] = on ? std::clamp(torque, -strongest, strongest) : 0.0;
        mem.turned[i] += speeds.Omega[i] * tick_seconds(tick.dt);
    }
    mem.saturated += limited;
    torques.head = head_next(torques.head, tick.t, quality_optional(drive.head));

    if (tachometers.head.sequence == 0 || tick.t / par.window > (tick.t - tick.dt) / par.window) {
        for (std::uint32_t i = 0; i < par.n; i++) {
            const double marks = std::floor(mem.turned[i] * par.marks / (2 * std::numbers::pi));
            const auto passed = static_cast<std::int64_t>(std::clamp(marks, -4e18, 4e18));
            double counts = static_cast<double>(static_cast<std::int32_t>(passed - mem.passed[i]));
            speaks |= faults.apply(WHEELS_MAX + i, {&counts, 1});
            tachometers.counts[i] =
                static_cast<std::int32_t>(std::clamp(std::round(counts), -2147483647.0, 2147483647.0));
            mem.passed[i] = passed;
        }
        tachometers.head = head_of_reading(tachometers.head, tick.t, quality_through(speeds.head), speaks && on);
    }
}

} // namespace fledge::world
