// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/spacewire.h"

#include <array>

namespace fledge::emulator {

namespace {
enum : std::uint32_t { control_at = 0x00, status_at = 0x04, dma_at = 0x20, descriptor_at = 0x28 };
enum : std::uint32_t { run_state = 5 << 21 };
enum : std::uint32_t { transmitter_on = 1 << 0, packet_sent = 1 << 5, bus_error = 1 << 7 };
enum : std::uint32_t { header_size = 0xFF, enabled = 1 << 12, wraps = 1 << 13, data_size = 0xFFFFFF };
constexpr std::uint32_t table_size = 1024, descriptor_size = 16;
} // namespace

std::uint32_t SpaceWire::read(std::uint32_t offset)
{
    switch (offset) {
    case control_at: return state_.control;
    case status_at: return runs() ? std::uint32_t{run_state} : 0;
    case dma_at: return state_.dma;
    case descriptor_at: return state_.next;
    default: return 0;
    }
}

void SpaceWire::write(std::uint32_t offset, std::uint32_t value)
{
    switch (offset) {
    case control_at: state_.control = value & 3; break;
    case dma_at: state_.dma = (state_.dma & ~value & (packet_sent | bus_error)) | (value & transmitter_on); break;
    case descriptor_at: state_.next = value & ~(descriptor_size - 1); break;
    default: return;
    }
    while (runs() && (state_.dma & transmitter_on)) {
        if (!send_next()) {
            state_.dma = (state_.dma & ~transmitter_on) | bus_error;
        }
    }
}

/// Send the packet of the next descriptor, or disable the transmitter if there is none. False: an error of the bus.
bool SpaceWire::send_next()
{
    std::array<std::uint64_t, 4> words{};
    for (std::uint32_t k = 0; k < 4; k++) {
        if (bus_.read(state_.next + 4 * k, 4, words[k]) == Access::fault) {
            return false;
        }
    }
    const auto flags = static_cast<std::uint32_t>(words[0]);
    if (!(flags & enabled)) {
        state_.dma &= ~transmitter_on;
        return true;
    }
    packet_.clear();
    if (!append(static_cast<std::uint32_t>(words[1]), flags & header_size) ||
        !append(static_cast<std::uint32_t>(words[3]), static_cast<std::uint32_t>(words[2]) & data_size) ||
        bus_.write(state_.next, 4, flags & ~enabled) == Access::fault) {
        return false;
    }
    const std::uint32_t place = flags & wraps ? 0 : state_.next + descriptor_size;
    state_.next = (state_.next & ~(table_size - 1)) | (place & (table_size - 1));
    state_.dma |= packet_sent;
    if (transmit) {
        transmit(packet_);
    }
    return true;
}

/// Bytes of memory become a part of the packet. False: an error of the bus.
bool SpaceWire::append(std::uint32_t address, std::uint32_t n)
{
    while (n > 0) {
        const unsigned size = address % 8 == 0 && n >= 8 ? 8 : 1;
        std::uint64_t value = 0;
        if (bus_.read(address, size, value) == Access::fault) {
            return false;
        }
        for (unsigned k = size; k-- > 0;) {
            packet_.push_back(static_cast<std::uint8_t>(value >> 8 * k));
        }
        address += size;
        n -= size;
    }
    return true;
}

} // namespace fledge::emulator
