// SPDX-License-Identifier: Apache-2.0
// A SpaceWire link with DMA (GRSPW2), of which it has the transmitter of one channel; the other end takes each packet
// at once. It has no receiver, and neither interrupts, nor time codes, nor CRCs.
//
// Words: 0x00 control: bit 0 disables the link, bit 1 starts it; 0x04 status: bits 23..21 are 5 while the link runs;
// 0x20 control of the DMA: bit 0 enables the transmitter until it meets a descriptor that is not enabled, bit 5 tells
// that a packet was sent, bit 7 of an error of the bus, and a one clears these two; 0x28 where the next descriptor is.
//
// A table of 1 KiB has 64 descriptors of four words: bits 7..0 the bytes of the header, bit 12 enabled, bit 13 the next
// descriptor is the first one; the address of the header; bits 23..0 the bytes of data; their address.
#pragma once

#include <functional>
#include <vector>

#include "emulator/bus/system_bus.h"
#include "emulator/devices/device.h"

namespace fledge::emulator {

class SpaceWire final : public Device {
public:
    SpaceWire(std::string name, SystemBus &bus) : Device(std::move(name)), bus_(bus) {}
    Identity identity() const override { return {0x01, 0x029, 0}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    void reset() override { state_ = {}; }
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override
    {
        return {{"control", 0x0}, {"status", 0x4}, {"dma", 0x20}, {"descriptor", 0x28}};
    }

    std::function<void(std::span<const std::uint8_t>)> transmit; ///< gets each packet

private:
    struct State {
        std::uint32_t control = 0, dma = 0, next = 0;
    };
    bool runs() const { return (state_.control & 3) == 2; }
    bool send_next();
    bool append(std::uint32_t address, std::uint32_t n);

    SystemBus &bus_;
    State state_;
    std::vector<std::uint8_t> packet_;
};

} // namespace fledge::emulator
