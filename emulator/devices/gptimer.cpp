// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/gptimer.h"

#include <algorithm>

namespace fledge::emulator {

namespace {
enum : std::uint32_t { scaler_value = 0x00, scaler_reload = 0x04, config = 0x08 };
enum : std::uint32_t { enable = 1, restart = 2, load = 4, interrupt_enable = 8, interrupt_pending = 16, chain = 32 };
enum : std::uint32_t { separate_interrupts = 1 << 8, disable_freeze = 1 << 9 };
} // namespace

Gptimer::Gptimer(std::string name, DeviceHost &host, const Settings &settings)
    : Device(std::move(name)), host_(host), settings_(settings)
{
    reset();
}

std::vector<DeviceRegister> Gptimer::registers() const
{
    std::vector<DeviceRegister> all{{"scaler", 0x0}, {"scaler_reload", 0x4}, {"config", 0x8}};
    for (std::uint32_t n = 1; n <= settings_.timers; n++) {
        const std::string number = "_" + std::to_string(n);
        all.push_back({"counter" + number, 16 * n});
        all.push_back({"reload" + number, 16 * n + 4});
        all.push_back({"control" + number, 16 * n + 8});
    }
    return all;
}

void Gptimer::reset()
{
    const std::uint64_t resets = state_.watchdog_resets;
    state_ = {};
    state_.watchdog_resets = resets;
    state_.at = host_.cycles();
    state_.scaler = state_.scaler_reload = settings_.scaler;
    if (settings_.watchdog && settings_.watchdog_after_reset != 0) {
        const std::uint32_t ticks = settings_.watchdog_after_reset - 1;
        state_.timers[settings_.timers - 1] = {ticks, ticks, enable};
    }
}

bool Gptimer::watchdog_runs() const
{
    return settings_.watchdog && (state_.timers[settings_.timers - 1].control & enable) != 0;
}

/// Let so many ticks pass; returns how often the counter passed zero.
std::uint64_t Gptimer::count(std::uint32_t index, std::uint64_t ticks)
{
    Timer &t = state_.timers[index];
    if (!(t.control & enable) || ticks == 0) {
        return 0;
    }
    if (ticks <= t.counter) {
        t.counter -= static_cast<std::uint32_t>(ticks);
        return 0;
    }
    const std::uint64_t beyond = ticks - t.counter - 1, period = std::uint64_t{t.reload} + 1;
    std::uint64_t underflows = 1;
    if (t.control & restart) {
        underflows += beyond / period;
        t.counter = t.reload - static_cast<std::uint32_t>(beyond % period);
    } else {
        t.counter = ~0u;
        t.control &= ~enable;
    }
    if (t.control & interrupt_enable) {
        t.control |= interrupt_pending;
        host_.raise(settings_.interrupt + index);
    }
    if (is_watchdog(index)) {
        state_.watchdog_resets++;
        host_.reset();
    }
    return underflows;
}

void Gptimer::bring_up()
{
    const std::uint64_t elapsed = host_.cycles() - state_.at, period = std::uint64_t{state_.scaler_reload} + 1;
    state_.at += elapsed;
    std::uint64_t ticks = 0;
    if (elapsed <= state_.scaler) {
        state_.scaler -= static_cast<std::uint32_t>(elapsed);
    } else {
        const std::uint64_t beyond = elapsed - state_.scaler - 1;
        ticks = 1 + beyond / period;
        state_.scaler = state_.scaler_reload - static_cast<std::uint32_t>(beyond % period);
    }
    std::uint64_t before = 0;
    for (std::uint32_t i = 0; i < settings_.timers; i++) {
        before = count(i, state_.timers[i].control & chain && i > 0 ? before : ticks);
    }
}

/// Whether it has an effect when the timer passes zero.
bool Gptimer::matters(std::uint32_t i) const
{
    const bool drives_next =
        i + 1 < settings_.timers && (state_.timers[i + 1].control & (enable | chain)) == (enable | chain);
    return (state_.timers[i].control & enable) &&
           ((state_.timers[i].control & interrupt_enable) || drives_next || is_watchdog(i));
}

std::uint64_t Gptimer::next_event() const
{
    std::uint64_t ticks = never;
    for (std::uint32_t i = 0; i < settings_.timers; i++) {
        const bool chained = i > 0 && (state_.timers[i].control & chain);
        if (matters(i) && !chained) {
            ticks = std::min(ticks, std::uint64_t{state_.timers[i].counter} + 1);
        }
    }
    if (ticks == never) {
        return never;
    }
    std::uint64_t cycles;
    const bool too_far = __builtin_mul_overflow(ticks - 1, std::uint64_t{state_.scaler_reload} + 1, &cycles) ||
                         __builtin_add_overflow(cycles, state_.at + state_.scaler + 1, &cycles);
    return too_far ? never : cycles;
}

std::uint32_t Gptimer::read(std::uint32_t offset)
{
    bring_up();
    switch (offset) {
    case scaler_value: return state_.scaler;
    case scaler_reload: return state_.scaler_reload;
    case config: return settings_.timers | settings_.interrupt << 3 | separate_interrupts | state_.config;
    default: break;
    }
    const std::uint32_t i = offset / 16 - 1;
    if (offset < 16 || i >= settings_.timers) {
        return 0;
    }
    switch (offset % 16) {
    case 0: return state_.timers[i].counter;
    case 4: return state_.timers[i].reload;
    case 8: return state_.timers[i].control;
    default: return 0;
    }
}

void Gptimer::write(std::uint32_t offset, std::uint32_t value)
{
    bring_up();
    const std::uint32_t i = offset / 16 - 1;
    if (offset == scaler_value) {
        state_.scaler = value;
    } else if (offset == scaler_reload) {
        state_.scaler = state_.scaler_reload = value;
    } else if (offset == config) {
        state_.config = value & disable_freeze;
    } else if (offset >= 16 && i < settings_.timers) {
        Timer &t = state_.timers[i];
        switch (offset % 16) {
        case 0: t.counter = value; break;
        case 4: t.reload = value; break;
        case 8:
            // Storing 1 clears the pending bit; `load` shows as 0.
            t.control =
                (value & (enable | restart | interrupt_enable | chain)) | (t.control & ~value & interrupt_pending);
            t.counter = value & load ? t.reload : t.counter;
            break;
        default: break;
        }
    }
    host_.changed();
}

} // namespace fledge::emulator
