// SPDX-License-Identifier: Apache-2.0
// The port on which the system test of GRLIB reports (AHBREP): each store is a line.
#pragma once

#include <functional>

#include "emulator/devices/device.h"

namespace fledge::emulator {

class TestReport final : public Device {
public:
    explicit TestReport(std::string name) : Device(std::move(name)) {}
    Identity identity() const override { return {0x01, 0x042, 0}; }
    std::uint32_t read(std::uint32_t) override { return 0; }
    void write(std::uint32_t offset, std::uint32_t value) override
    {
        switch (offset) {
        case 0x00: line("device " + std::to_string(value >> 24) + ":" + std::to_string(value >> 12 & 0xFFF)); break;
        case 0x04:
            state_.errors++;
            line("test failed, error " + std::to_string(value & 0xFFFF));
            break;
        case 0x08: line("  subtest " + std::to_string(value & 0xFF)); break;
        case 0x10:
            state_.errors = 0;
            line("system test starts");
            break;
        case 0x14: line("system test ends, errors: " + std::to_string(state_.errors)); break;
        case 0x18: line("checkpoint " + std::to_string(value & 0xFFFF)); break;
        case 0x1C: line("memory test"); break;
        default: break;
        }
    }
    void reset() override { state_ = {}; }
    std::span<std::byte> state() override { return bytes_of(state_); }

    std::function<void(const std::string &)> say; ///< gets each line

private:
    void line(const std::string &text)
    {
        if (say) {
            say(text + "\n");
        }
    }

    struct State {
        std::uint32_t errors = 0;
    } state_;
};

} // namespace fledge::emulator
