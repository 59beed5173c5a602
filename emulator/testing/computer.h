// SPDX-License-Identifier: Apache-2.0
// A processor in front of a random program.
#pragma once

#include <cstring>
#include <memory>

#include "emulator/testing/small_computer.h"
#include "emulator/testing/stream.h"

namespace fledge::emulator::testing {

struct Computer {
    Computer(const Stream &stream, std::unique_ptr<Engine> made, FpuPersonality fpu)
        : engine(std::move(made)), bus(stream.size)
    {
        std::memcpy(bus.bytes().data(), stream.image.data(), stream.size);
        bus.engine = engine.get();
        bus.on_device_read = [this](std::uint32_t offset) {
            return offset ^ static_cast<std::uint32_t>(core.state.cycles);
        };
        core.bus = &bus;
        core.fpu = fpu;
        core.timing = leon3_timing();
        core.state.pc = stream.entry;
        core.state.npc = stream.entry + 4;
    }
    Computer(const Computer &) = delete;
    Computer &operator=(const Computer &) = delete;

    Exit run(std::uint64_t until) { return engine->run(core, until); }
    std::vector<std::uint8_t> memory()
    {
        const auto *first = reinterpret_cast<const std::uint8_t *>(bus.bytes().data());
        return {first, first + bus.bytes().size()};
    }

    std::unique_ptr<Engine> engine;
    SmallBus bus;
    Core core;
};

} // namespace fledge::emulator::testing
