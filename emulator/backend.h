// SPDX-License-Identifier: Apache-2.0
// Flight on a machine in this process, as a back end of the register space: for campaigns and for Python.
#pragma once

#include "emulator/loop.h"
#include "registers/backend.h"

namespace fledge::emulator {

class MachineBackend final : public registers::Backend {
public:
    /// The machine's register space has its boards.
    explicit MachineBackend(Machine &machine);

    std::span<const RegisterWindow> windows() const override { return windows_; }
    /// Runs the machine; no time of the host counts. Wait::gone: the processor is in its error mode.
    registers::Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) override;

    FlightLoop loop;

private:
    std::span<const RegisterWindow> windows_;
};

} // namespace fledge::emulator
