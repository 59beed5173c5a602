// SPDX-License-Identifier: Apache-2.0
// The debug support unit, of which programs read the time tag: word 0x8, the lower half of the counter of %asr22 and
// %asr23. All other words are 0.
#pragma once

#include "emulator/cpu/state.h"
#include "emulator/devices/device.h"

namespace fledge::emulator {

class DebugUnit final : public Device {
public:
    DebugUnit(std::string name, const CpuState &state) : Device(std::move(name)), state_(state) {}
    Identity identity() const override { return {0x01, 0x004, 1}; }
    std::uint32_t read(std::uint32_t offset) override
    {
        return offset == 8 ? static_cast<std::uint32_t>(state_.cycles - state_.counts_from) : 0;
    }
    void write(std::uint32_t, std::uint32_t) override {}
    void reset() override {}
    std::span<std::byte> state() override { return {}; }
    std::vector<DeviceRegister> registers() const override { return {{"time_tag", 0x8}}; }
    static constexpr std::uint32_t size = 0x10000000;

private:
    const CpuState &state_;
};

} // namespace fledge::emulator
