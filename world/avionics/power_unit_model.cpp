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

std::uint32_t all_of(std::uint32_t loads)
{
    return loads < LOADS_MAX ? (1u << loads) - 1u : ~0u;
}

} // namespace

void PowerUnitModel::reset(sim::Ns t)
{
    Sensor::reset(t);
    interface_.mem.beat = t;
    interface_.mem.energy = interface_.par.charge * interface_.par.battery;
    interface_.mem.switched = interface_.par.on & all_of(interface_.par.n);
}

void PowerUnitModel::update(Tick tick)
{
    const auto &par = interface_.par;
    const PowerCommand &command = interface_.in.command;
    auto &mem = interface_.mem;
    auto &[out, line, supply] = interface_.out;
    const std::int64_t before = tick.t - tick.dt;
    const auto passes = [&](std::int64_t at) { return at > before && at <= tick.t; };

    begin_faults(tick.t);
    bool working[SWITCH_CARDS];
    for (std::size_t c = 0; c < SWITCH_CARDS; c++) {
        working[c] = works(c);
        mem.switched &= working[c] ? ~0u : ~(0xFFu << CARD_LOADS * c);
    }
    const bool controlled = works(SWITCH_CARDS);

    bool resets = std::any_of(std::begin(par.reset_at), std::end(par.reset_at),
                              [&](double at) { return at > 0.0 && passes(std::llround(at * 1e9)); });
    if (command.heartbeat != mem.heartbeat || !controlled) {
        mem.heartbeat = command.heartbeat;
        mem.beat = tick.t;
    }
    resets |= par.watchdog > 0 && tick.t - mem.beat >= par.watchdog;
    if (controlled && command.number != 0 && command.number != mem.number) {
        mem.number = command.number;
        for (std::uint32_t c = 0; c < SWITCH_CARDS; c++) {
            const std::uint32_t its = working[c] ? 0xFFu << CARD_LOADS * c : 0u;
            mem.tripped &= ~(command.clear & its);
            mem.switched = (mem.switched & ~its) | (command.on & its & ~mem.tripped & all_of(par.n));
        }
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
    const auto is_on = [&](std::uint32_t i) { return i < par.n && (mem.switched >> i & 1u); };
    mem.latched = mem.latched && is_on(par.latch_up_load);

    if (par.battery > 0.0) {
        const double charging = head_written(interface_.in.array.head) ? interface_.in.array.power : 0.0;
        const double energy = mem.energy + (charging - mem.drawn) * tick_seconds(tick.dt);
        mem.energy = std::clamp(energy, 0.0, par.battery);
        mem.empty = mem.energy == 0.0 || (mem.empty && mem.energy < 0.05 * par.battery);
        mem.saturated += mem.empty;
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
    for (std::uint32_t i = 0; i < par.n; i++) {
        const double current =
            is_on(i) ? volts / par.load[i] + (i == par.latch_up_load && !mem.empty ? extra : 0.0) : 0.0;
        SwitchCard &card = out.cards[i / CARD_LOADS];
        const bool high = par.trip[i] > 0.0 && current > par.trip[i];
        mem.above[i] = high ? mem.above[i] + tick_seconds(tick.dt) : 0.0;
        if (working[i / CARD_LOADS]) {
            card.current[i % CARD_LOADS] = counts(current, par.count_current);
        }
        if (high && mem.above[i] >= tick_seconds(par.trip_after)) { // its next current is zero
            mem.switched &= ~(1u << i);
            mem.tripped |= 1u << i;
            card.trips++;
        }
    }
    for (std::size_t c = 0; c < SWITCH_CARDS; c++) {
        if (working[c]) {
            out.cards[c].counter++;
            out.cards[c].on = mem.switched >> CARD_LOADS * c & 0xFFu;
            out.cards[c].tripped = mem.tripped >> CARD_LOADS * c & 0xFFu;
        }
    }
    if (controlled) {
        out.counter++;
        out.number = mem.number;
        out.heartbeat = mem.heartbeat;
        out.bus = counts(volts, par.count_volts);
        out.battery = par.battery > 0.0 ? counts(mem.energy, par.battery / 65535.0) : std::uint16_t{65535};
    }
    out.head = head_next(out.head, tick.t, QUALITY_GOOD);
    supply.on = volts > 0.0 ? mem.switched : 0u;
    supply.head = head_next(supply.head, tick.t, QUALITY_GOOD);
}

} // namespace fledge::world
