// SPDX-License-Identifier: Apache-2.0
// The register space on the bus: the boards of a register file at the distances of their bases, as words whose bytes
// lie in memory as the program sees them. The memory belongs to the machine, or to a file that the outside shares.
#pragma once

#include <functional>
#include <vector>

#include "emulator/devices/device.h"
#include "registers/plug_and_play.h"
#include "registers/window.h"

namespace fledge::emulator {

class RegisterSpace final : public Device {
public:
    /// What a line of a board does.
    struct Line {
        std::string board; ///< its name
        std::uint32_t line = 0;
        std::uint32_t interrupt = 0; ///< 0: resets the computer
    };
    struct Settings {
        std::uint32_t size = 0;      ///< [bytes] room on the bus
        std::uint32_t tick = 0;      ///< the interrupt of a tick; 0: none
        std::uint32_t interrupt = 0; ///< of all lines of boards without a level that are not in the list; 0: none
        std::vector<Line> lines{};
    };
    RegisterSpace(std::string name, DeviceHost &host, Settings settings);

    Identity identity() const override { return {REGISTER_BUS_VENDOR, REGISTER_BUS_DEVICE, 0}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    bool is_memory() const override { return true; }
    void reset() override {} ///< the boards stay as they are
    std::span<std::byte> state() override { return std::as_writable_bytes(std::span(memory_)); }

    /// Put boards on the bus, in memory of the machine: part of its snapshots. Throws Error if there is no room.
    void make(std::span<const RegisterBoard *const> boards);
    /// The same in memory that stays where it is as long as the machine lives.
    void attach(std::span<const RegisterWindow> windows);
    std::span<const RegisterWindow> windows() const { return windows_; }
    /// The window of the board that has the clock; nullptr: there is none.
    const RegisterWindow *clock() const { return clock_; }

    /// Raise the interrupts of the lines that the outside raised since flight had finished.
    void announce();
    /// Flight has finished, or the tick is over: what is raised from now on, the outside raises.
    void settle();
    /// Show the number of the tick that the outside has started, and raise its interrupt. Before that the program sees
    /// the number of the tick before, because its time has not come.
    void tick();

    /// A fault: bits of the word at an offset are always 1, or always 0, for the program and in what it writes. One
    /// word at a time; both 0: none.
    void stick(std::uint32_t offset, std::uint32_t ones, std::uint32_t zeros);

    /// The program has stored the number of the tick that it has finished.
    std::function<void()> done;

private:
    struct Place {
        std::uint32_t from = 0, size = 0; ///< [bytes]
        const RegisterWindow *window = nullptr;
    };
    struct Counter {
        const RegisterWindow *window = nullptr;
        std::uint32_t address = 0;   ///< of the number of times that the line was raised
        std::uint32_t interrupt = 0; ///< 0: resets the computer
    };
    void check_lines() const;
    volatile std::uint32_t *word(std::uint32_t offset) const;
    struct Head {
        std::uint32_t tick = 0;                ///< that is shown
        std::uint32_t at = 0, on = 0, off = 0; ///< bits that are stuck
    };
    Head &head();
    std::uint32_t stuck(std::uint32_t offset, std::uint32_t value);
    std::span<std::uint32_t> seen(); ///< of each counter, what it was

    DeviceHost &host_;
    Settings settings_;
    /// The head, what is seen of the counters, then the boards if they are the machine's.
    std::vector<std::uint64_t> memory_;
    std::vector<RegisterWindow> windows_;
    std::vector<Place> places_;
    std::vector<Counter> counters_;
    const RegisterWindow *clock_ = nullptr;
    std::uint32_t clock_at_ = 0; ///< its block, on the bus
};

} // namespace fledge::emulator
