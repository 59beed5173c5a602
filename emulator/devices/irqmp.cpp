// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/irqmp.h"

#include <bit>

namespace fledge::emulator {

namespace {
enum : std::uint32_t { level = 0x00, pending = 0x04, force = 0x08, clear = 0x0C, mask_0 = 0x40, force_0 = 0x80 };
constexpr std::uint32_t lines = 0xFFFE;
} // namespace

std::uint32_t Irqmp::requests() const
{
    return (((state_.pending | state_.stuck_on) & ~state_.stuck_off) | state_.force) & state_.mask;
}

void Irqmp::update()
{
    // Lines of level 1 go before all of level 0.
    const std::uint32_t all = requests(), first = all & state_.level;
    show_(static_cast<std::uint32_t>(std::bit_width(first ? first : all) - (all ? 1 : 0)));
}

std::uint32_t Irqmp::read(std::uint32_t offset)
{
    switch (offset) {
    case level: return state_.level;
    case pending: return (state_.pending | state_.stuck_on) & ~state_.stuck_off;
    case force:
    case force_0: return state_.force;
    case mask_0: return state_.mask;
    default: return 0;
    }
}

void Irqmp::write(std::uint32_t offset, std::uint32_t value)
{
    switch (offset) {
    case level: state_.level = value & lines; break;
    case pending: state_.pending = value & lines; break;
    case force: state_.force = value & lines; break;
    case clear: state_.pending &= ~value; break;
    case mask_0: state_.mask = value & lines; break;
    case force_0: state_.force = (state_.force | (value & lines)) & ~(value >> 16); break;
    default: break;
    }
    update();
}

void Irqmp::reset()
{
    state_ = {.stuck_on = state_.stuck_on, .stuck_off = state_.stuck_off};
    update();
}

void Irqmp::raise(std::uint32_t line)
{
    state_.pending |= 1u << line & lines;
    update();
}

void Irqmp::acknowledge(std::uint32_t level_taken)
{
    const std::uint32_t bit = 1u << level_taken;
    if (state_.force & bit) {
        state_.force &= ~bit;
    } else {
        state_.pending &= ~bit;
    }
    update();
}

void Irqmp::stick(std::uint32_t pending_lines, std::uint32_t silent_lines)
{
    state_.stuck_on = pending_lines & lines;
    state_.stuck_off = silent_lines & lines;
    update();
}

} // namespace fledge::emulator
