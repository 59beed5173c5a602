// SPDX-License-Identifier: Apache-2.0
// What looks after memory, each a device on the APB:
// - MemoryController: of FTMCTRL what a program needs: MCFG3 switches the EDAC.
// - AhbStatus: holds the address of the first failed or corrected access, and raises an interrupt.
// - Scrubber: reads all of RAM, a word after the other, and corrects it.
// - WriteProtection: ranges of pages that the processor cannot write.
#pragma once

#include <array>

#include "emulator/bus/system_bus.h"
#include "emulator/devices/device.h"

namespace fledge::emulator {

/// Words: 0x0, 0x4 MCFG1, MCFG2, which hold what was stored; 0x8 MCFG3: bit 9 enables the EDAC of RAM, bit 27 shows
/// that it is there.
class MemoryController final : public Device {
public:
    MemoryController(std::string name, SystemBus &bus) : Device(std::move(name)), bus_(bus) { reset(); }
    Identity identity() const override { return {0x01, 0x054, 1}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override { return {{"mcfg1", 0x0}, {"mcfg2", 0x4}, {"mcfg3", 0x8}}; }
    void restored() override { bus_.enable_edac(state_.edac != 0); }

private:
    struct State {
        std::array<std::uint32_t, 3> config{};
        std::uint32_t edac = 0;
    };
    SystemBus &bus_;
    State state_;
};

/// Words: 0x0 status: bits 2..0 the size of the access as a power of two, bit 7 a write, bit 8 new error, bit 9
/// corrected; 0x4 the address. While `new error` is set nothing is replaced; storing 0 there waits for the next one.
/// Behind these, of the emulator: 0x8 how many were corrected since the reset, 0xC how many failed.
class AhbStatus final : public Device {
public:
    AhbStatus(std::string name, DeviceHost &host, std::uint32_t interrupt)
        : Device(std::move(name)), host_(host), interrupt_(interrupt)
    {
    }
    Identity identity() const override { return {0x01, 0x052, 0}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    void reset() override { state_ = {}; }
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override
    {
        return {{"status", 0x0}, {"address", 0x4}, {"corrected", 0x8}, {"failed", 0xC}};
    }

    void note(const BusError &error);

private:
    struct State {
        std::uint32_t status = 0, address = 0, corrected = 0, failed = 0;
    };
    DeviceHost &host_;
    std::uint32_t interrupt_;
    State state_;
};

/// Words: 0x0 control: bit 0 runs; 0x4 cycles from word to word; 0x8 the address that comes next; 0xC rounds through
/// RAM; 0x10 words that it corrected; 0x14 words that it could not correct. The last three clear when written.
class Scrubber final : public Device {
public:
    /// `period` is the cycles from word to word after a reset; 0: it stands until the program starts it.
    Scrubber(std::string name, DeviceHost &host, SystemBus &bus, std::uint32_t period);
    Identity identity() const override { return {0x01, 0x057, 0}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    std::uint64_t next_event() const override;
    void act() override { bring_up(); }
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(state_); }

private:
    struct State {
        std::uint64_t next_at = 0; ///< the cycle of the next word
        std::uint32_t running = 0, period = 0, position = 0, rounds = 0, corrected = 0, failed = 0;
    };
    std::uint64_t words_until(std::uint32_t address) const;
    void bring_up(); ///< the words that it has read until now; only those with flipped bits matter

    DeviceHost &host_;
    SystemBus &bus_;
    std::uint32_t period_;
    State state_;
};

/// Four pairs of words, 0x0 to 0x1C: the first and the last page of a range; bit 0 of the first enables it. A write
/// there is refused: the instruction traps, and AhbStatus has its address.
class WriteProtection final : public Device {
public:
    WriteProtection(std::string name, SystemBus &bus) : Device(std::move(name)), bus_(bus) {}
    Identity identity() const override { return {0xF1, 0x002, 0}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(words_); }
    void restored() override;

private:
    SystemBus &bus_;
    std::array<std::uint32_t, 8> words_{};
};

} // namespace fledge::emulator
