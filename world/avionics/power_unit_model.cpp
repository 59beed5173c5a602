// SPDX-License-Identifier: Apache-2.0
#include "world/avionics/power_unit_model.h"

#include <algorithm>
#include <cmath>

namespace fledge::world {

namespace {

std::uint16_t counts(double x, double count)
{
    return static_cast<std::uint16_t>(std::clamp(std::round(x / count), 0.0, 65535.0));
}

} // namespace

void PowerUnitModel::prepare(const sim::Setup &) {}

void PowerUnitModel::reset(sim::Ns t)
{
    interface_.out = {};
    interface_.mem = {};
    interface_.mem.beat = t;
    interface_.mem.energy = interface_.par.charge * interface_.par.battery;
    interface_.out.telemetry.on = interface_.par.on & ((1u << interface_.par.n) - 1u);
}

void PowerUnitModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const PowerCommand &command = interface_.in.command;
    auto &mem = interface_.mem;
    auto &out = interface_.out.telemetry;
    auto &line = interface_.out.computer;
    const std::int64_t before = tick.t - tick.dt;
    const auto passes = [&](std::int64_t at) { return at > before && at <= tick.t; };

    bool resets = std::any_of(std::begin(par.reset_at), std::end(par.reset_at),
                              [&](double at) { return at > 0.0 && passes(std::llround(at * 1e9)); });
    if (command.heartbeat != mem.heartbeat) {
        mem.heartbeat = command.heartbeat;
        mem.beat = tick.t;
    }
    resets |= par.watchdog > 0 && tick.t - mem.beat >= par.watchdog;
    if (command.number != 0 && command.number != out.number) {
        out.number = command.number;
        out.tripped &= ~command.clear;
        out.on = command.on & ~out.tripped & ((1u << par.n) - 1u);
        resets |= command.reset != 0;
    }
    if (resets) {
        line.count++;
        mem.beat = tick.t;
    }
    line.head = head_next(line.head, tick.t, QUALITY_GOOD);

    if (par.latch_up_current > 0.0 && passes(par.latch_up_at)) {
        mem.latched = 1;
    }
    const auto is_on = [&](std::uint32_t i) { return i < par.n && (out.on >> i & 1u); };
    mem.latched = mem.latched && is_on(par.latch_up_load);

    if (par.battery > 0.0) {
        const double charging = head_written(interface_.in.array.head) ? interface_.in.array.power : 0.0;
        const double energy = mem.energy + (charging - mem.drawn) * tick_seconds(tick.dt);
        mem.energy = std::clamp(energy, 0.0, par.battery);
        mem.empty = mem.energy == 0.0 || (mem.empty && mem.energy < 0.05 * par.battery);
    }

    // volts = source - inner (volts sum 1/load + latch-up)
    double conductance = 0.0;
    for (std::uint32_t i = 0; i < par.n; i++) {
        conductance += is_on(i) ? 1.0 / par.load[i] : 0.0;
    }
    const double extra = mem.latched ? par.latch_up_current : 0.0;
    const double loaded = std::max(0.0, (par.volts - par.inner * extra) / (1.0 + par.inner * conductance));
    const double volts = mem.empty ? 0.0 : loaded;
    mem.drawn = mem.empty ? 0.0 : par.volts * (volts * conductance + extra);
    out.bus = counts(volts, par.count_volts);
    for (std::uint32_t i = 0; i < par.n; i++) {
        const double current =
            is_on(i) ? volts / par.load[i] + (i == par.latch_up_load && !mem.empty ? extra : 0.0) : 0.0;
        out.current[i] = counts(current, par.count_current);
        const bool high = par.trip[i] > 0.0 && current > par.trip[i];
        mem.above[i] = high ? mem.above[i] + tick_seconds(tick.dt) : 0.0;
        if (high && mem.above[i] >= tick_seconds(par.trip_after)) { // its next current is zero
            out.on &= ~(1u << i);
            out.tripped |= 1u << i;
            out.trips++;
        }
    }
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
