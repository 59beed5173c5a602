// SPDX-License-Identifier: Apache-2.0
// The interrupt controller: 15 lines, each pending, masked, of one of two levels; the highest goes to the processor.
#pragma once

#include <array>
#include <functional>

#include "emulator/devices/device.h"

namespace fledge::emulator {

class Irqmp final : public Device {
public:
    /// `show` gets the level for the processor, whenever it may have changed.
    Irqmp(std::string name, std::function<void(std::uint32_t)> show) : Device(std::move(name)), show_(std::move(show))
    {
    }

    Identity identity() const override { return {0x01, 0x00D, 3}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override
    {
        return {{"level", 0x0}, {"pending", 0x4}, {"force", 0x8}, {"mask", 0x40}};
    }
    void restored() override { update(); }

    void raise(std::uint32_t line);
    void acknowledge(std::uint32_t level); ///< the processor takes its trap

    /// A fault: the line is pending for ever, or never. Both 0: none.
    void stick(std::uint32_t pending_lines, std::uint32_t silent_lines);

private:
    struct State {
        std::uint32_t level = 0, pending = 0, force = 0, mask = 0;
        std::uint32_t stuck_on = 0, stuck_off = 0; ///< faults
    };

    std::uint32_t requests() const;
    void update();

    std::function<void(std::uint32_t)> show_;
    State state_;
};

} // namespace fledge::emulator
