// SPDX-License-Identifier: Apache-2.0
#include "emulator/backend.h"

#include "emulator/devices/register_space.h"
#include "registers/clock.h"

namespace fledge::emulator {

MachineBackend::MachineBackend(Machine &machine)
    : loop(machine), windows_(machine.device_of<RegisterSpace>()->windows())
{
}

registers::Wait MachineBackend::await_done(const RegisterWindow &clock, std::chrono::nanoseconds)
{
    const bool lives = loop.exchange();
    return !lives                           ? registers::Wait::gone
           : register_clock_is_done(&clock) ? registers::Wait::done
                                            : registers::Wait::late;
}

} // namespace fledge::emulator
