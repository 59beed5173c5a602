// SPDX-License-Identifier: Apache-2.0
// The least that an engine needs: a processor and memory, nothing else on the bus.
#pragma once

#include <bit>
#include <cstring>
#include <memory>
#include <vector>

#include "emulator/cpu/engine.h"
#include "emulator/tests/stream.h"

namespace fledge::emulator::testing {

class Computer final : Bus {
public:
    Computer(const Stream &stream, std::unique_ptr<Engine> made, FpuPersonality fpu)
        : engine(std::move(made)), memory(stream.image), flags_(stream.size / page_size)
    {
        ram_ = {ram_base, stream.size, reinterpret_cast<std::byte *>(memory.data()), flags_.data()};
        core.bus = this;
        core.fpu = fpu;
        core.timing = leon3_timing();
        core.state.pc = stream.entry;
        core.state.npc = stream.entry + 4;
    }
    Computer(const Computer &) = delete;
    Computer &operator=(const Computer &) = delete;

    Exit run(std::uint64_t until) { return engine->run(core, until); }

    std::unique_ptr<Engine> engine;
    Core core;
    std::vector<std::uint8_t> memory;

private:
    const Memory &ram() const override { return ram_; }

    Access read(std::uint32_t address, unsigned size, std::uint64_t &value) override
    {
        const std::uint32_t at = address - ram_.base;
        if (at >= ram_.size)
            return Access::fault;
        value = 0;
        for (unsigned i = 0; i < size; ++i)
            value = value << 8 | memory[at + i];
        return Access::done;
    }
    Access write(std::uint32_t address, unsigned size, std::uint64_t value) override
    {
        const std::uint32_t at = address - ram_.base;
        if (at >= ram_.size)
            return Access::fault;
        for (unsigned i = 0; i < size; ++i)
            memory[at + i] = static_cast<std::uint8_t>(value >> (8 * (size - 1 - i)));
        if ((flags_[at / page_size] & page_code) != 0)
            engine->invalidate(address, size);
        return Access::done;
    }
    Access fetch(std::uint32_t address, std::uint32_t &word) override
    {
        std::uint64_t value = 0;
        const Access access = read(address, 4, value);
        word = static_cast<std::uint32_t>(value);
        return access;
    }
    void mark_code(std::uint32_t address) override { flags_[(address - ram_.base) / page_size] |= page_code; }

    std::vector<std::uint8_t> flags_;
    Memory ram_;
};

} // namespace fledge::emulator::testing
