// SPDX-License-Identifier: Apache-2.0
// A host for one device in a test: time that the test sets, and the requests of the device.
#pragma once

#include <vector>

#include "emulator/devices/device.h"

namespace fledge::emulator::testing {

struct FakeHost : DeviceHost {
    std::uint64_t now = 0;
    std::vector<std::uint32_t> raised;
    unsigned resets = 0, changes = 0;

    std::uint64_t cycles() const override { return now; }
    void raise(std::uint32_t line) override { raised.push_back(line); }
    void reset() override { resets++; }
    void changed() override { changes++; }

    /// What was raised since the last call.
    std::vector<std::uint32_t> take() { return std::exchange(raised, {}); }

    /// Let time pass up to a cycle; the device acts at its events.
    void run(Device &device, std::uint64_t until)
    {
        while (device.next_event() <= until) {
            now = device.next_event();
            device.act();
        }
        now = until;
    }
};

} // namespace fledge::emulator::testing
