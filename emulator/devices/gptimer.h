// SPDX-License-Identifier: Apache-2.0
// Timers behind one prescaler. Counters are not counted down cycle by cycle: a read, a write or an event brings them
// up to the present cycle.
#pragma once

#include <array>
#include <optional>

#include "emulator/devices/device.h"

namespace fledge::emulator {

class Gptimer final : public Device {
public:
    static constexpr std::uint32_t most_timers = 7;

    struct Settings {
        std::uint32_t timers = 2;
        std::uint32_t interrupt = 8;            ///< of the first; the others follow
        std::uint32_t scaler = 0;               ///< reload value after a reset
        bool watchdog = false;                  ///< the last timer resets the board
        std::uint32_t watchdog_after_reset = 0; ///< its ticks until then; 0: it stands until the program starts it
    };
    Gptimer(std::string name, DeviceHost &host, const Settings &settings);

    Identity identity() const override { return {0x01, 0x011, 1}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    std::uint64_t next_event() const override;
    void act() override { bring_up(); }
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override;

    /// How often the watchdog has reset the board.
    std::uint64_t watchdog_resets() const { return state_.watchdog_resets; }
    /// Whether the watchdog will reset the board unless the program starts it anew.
    bool watchdog_runs() const;

private:
    struct Timer {
        std::uint32_t counter = 0, reload = 0, control = 0;
    };
    struct State {
        std::uint64_t at = 0; ///< the cycle of the values below
        std::uint64_t watchdog_resets = 0;
        std::uint32_t scaler = 0, scaler_reload = 0, config = 0, padding = 0;
        std::array<Timer, most_timers> timers{};
    };

    void bring_up();
    std::uint64_t count(std::uint32_t timer, std::uint64_t ticks);
    bool is_watchdog(std::uint32_t timer) const { return settings_.watchdog && timer + 1 == settings_.timers; }
    bool matters(std::uint32_t timer) const;
    std::uint64_t ticks_to_underflow(std::uint32_t timer) const;

    DeviceHost &host_;
    Settings settings_;
    State state_;
};

} // namespace fledge::emulator
