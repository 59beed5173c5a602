// SPDX-License-Identifier: Apache-2.0
// A processor with memory and one device, for tests of engines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <span>
#include <vector>

#include "emulator/cpu/engine.h"

namespace fledge::emulator::testing {

inline constexpr std::uint32_t ram_base = 0x40000000, ram_size = 64 * page_size, device_base = 0x80000000;

/// Memory at ram_base, and a device of a page at device_base; nothing elsewhere.
class SmallBus : public Bus {
public:
    explicit SmallBus(std::uint32_t size = ram_size) : bytes_(size), flags_(size / page_size), code_(size / 4)
    {
        ram_ = {.base = ram_base, .size = size, .bytes = bytes_.data(), .flags = flags_.data(), .code = code_.data()};
    }

    const Memory &ram() const override { return ram_; }

    Access read(std::uint32_t address, unsigned size, std::uint64_t &value) override
    {
        if (address - device_base < page_size) {
            value = on_device_read ? on_device_read(address - device_base) : 0;
            return Access::done;
        }
        if (address - ram_base >= ram_.size) {
            return Access::fault;
        }
        value = 0;
        for (unsigned k = 0; k < size; k++) {
            value = value << 8 | std::to_integer<std::uint64_t>(bytes_[address - ram_base + k]);
        }
        return flag(address, page_watch_read) ? Access::watched : Access::done;
    }

    Access write(std::uint32_t address, unsigned size, std::uint64_t value) override
    {
        if (address - device_base < page_size) {
            if (on_device_write) {
                on_device_write(address - device_base, static_cast<std::uint32_t>(value));
            }
            return Access::done;
        }
        if (address - ram_base >= ram_.size || flag(address, page_protected)) {
            return Access::fault;
        }
        for (unsigned k = 0; k < size; k++) {
            bytes_[address - ram_base + k] = static_cast<std::byte>(value >> (8 * (size - 1 - k)));
        }
        std::uint8_t *const words = &code_[(address - ram_base) / 4];
        if (engine != nullptr && (words[0] != 0 || (size == 8 && words[1] != 0))) {
            engine->invalidate(address, size);
            words[0] = words[size / 8] = 0;
        }
        return flag(address, page_watch_write) ? Access::watched : Access::done;
    }

    Access fetch(std::uint32_t address, std::uint32_t &word) override
    {
        if (address - ram_base >= ram_.size) {
            return Access::fault;
        }
        word = load(address);
        return Access::done;
    }

    void mark_code(std::uint32_t address) override
    {
        flags_[(address - ram_base) / page_size] |= page_code;
        code_[(address - ram_base) / 4] = 1;
    }

    /// Without effects, as a test sees memory.
    std::uint32_t load(std::uint32_t address) const
    {
        std::uint32_t word = 0;
        std::memcpy(&word, &bytes_[address - ram_base], 4);
        return __builtin_bswap32(word);
    }
    void store(std::uint32_t address, std::uint32_t word)
    {
        word = __builtin_bswap32(word);
        std::memcpy(&bytes_[address - ram_base], &word, 4);
    }
    std::span<std::byte> bytes() { return bytes_; }
    std::uint8_t &flags_of(std::uint32_t address) { return flags_[(address - ram_base) / page_size]; }

    Engine *engine = nullptr;
    std::function<std::uint32_t(std::uint32_t offset)> on_device_read;
    std::function<void(std::uint32_t offset, std::uint32_t value)> on_device_write;

private:
    bool flag(std::uint32_t address, PageFlags f) { return (flags_of(address) & f) != 0; }

    std::vector<std::byte> bytes_;
    std::vector<std::uint8_t> flags_, code_;
    Memory ram_;
};

/// A processor in supervisor mode with traps and FPU on, its trap table at ram_base, its program at `start`.
struct SmallComputer {
    static constexpr std::uint32_t start = ram_base + 0x2000, data = ram_base + 0x8000;

    SmallBus bus;
    Core core;
    std::unique_ptr<Engine> engine;
    CpuState &s = core.state;

    explicit SmallComputer(std::unique_ptr<Engine> with, const Timing &timing = plain_timing())
        : engine(std::move(with))
    {
        bus.engine = engine.get();
        core.bus = &bus;
        core.timing = timing;
        s.psr |= psr::enable_traps | psr::enable_fpu | 4; // window 4
        s.wim = 1;
        s.tbr = ram_base;
        go(start);
    }

    void go(std::uint32_t address)
    {
        s.pc = address;
        s.npc = address + 4;
    }
    void write(std::uint32_t address, std::initializer_list<std::uint32_t> words)
    {
        for (std::uint32_t word : words) {
            bus.store(address, word);
            address += 4;
        }
    }
    std::uint32_t &r(std::uint32_t n) { return Banks(s)[n]; }

    /// Execute so many steps: instructions, traps or interrupts. With plain timing each is a cycle.
    Exit steps(std::uint64_t n) { return engine->run(core, s.cycles + n); }
};

} // namespace fledge::emulator::testing
