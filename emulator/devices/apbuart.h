// SPDX-License-Identifier: Apache-2.0
// A serial port. Bytes leave it at once, or at the baud rate that the program sets; the host's end is a function.
//
// Example:
//
//     #include <cstdio>
//     using namespace emulator;
//     void attach(DeviceHost &host)
//     {
//         Apbuart uart("console", host, {.interrupt = 2});
//         uart.transmit = [](std::uint8_t byte) { std::putchar(byte); };
//         const std::uint8_t line[] = {'g', 'o', '\n'};
//         uart.receive(line);
//     }
#pragma once

#include <array>
#include <functional>

#include "emulator/devices/device.h"

namespace fledge::emulator {

class Apbuart final : public Device {
public:
    struct Settings {
        std::uint32_t interrupt = 2;
        bool baud = false; ///< a byte takes the time of its ten bits; else none
    };
    Apbuart(std::string name, DeviceHost &host, const Settings &settings);

    Identity identity() const override { return {0x01, 0x00C, 1}; }
    std::uint32_t read(std::uint32_t offset) override;
    void write(std::uint32_t offset, std::uint32_t value) override;
    std::uint64_t next_event() const override { return state_.n_out > 0 && sends() ? state_.sent_at : never; }
    void act() override;
    void reset() override;
    std::span<std::byte> state() override { return bytes_of(state_); }
    std::vector<DeviceRegister> registers() const override
    {
        return {{"status", 0x4}, {"control", 0x8}, {"scaler", 0xC}};
    }

    /// Gets each byte that the program sends.
    std::function<void(std::uint8_t)> transmit;

    /// How many bytes the program may be given now; those that it has not read wait.
    std::size_t room() const { return (state_.control & 1) != 0 ? input_room - state_.n_in : 0; }
    /// Bytes for the program to receive; returns how many there was room for.
    std::size_t receive(std::span<const std::uint8_t> bytes);

private:
    static constexpr std::uint32_t fifo = 32;
    static constexpr std::uint32_t input_room = 1024; ///< bytes that the host may give in advance

    struct State {
        std::uint64_t sent_at = 0; ///< the cycle at which the first byte has left
        std::uint32_t control = 0, scaler = 0, errors = 0;
        std::uint32_t n_out = 0, n_in = 0;
        std::array<std::uint8_t, fifo> out{};
        std::array<std::uint8_t, input_room> in{};
    };

    std::uint64_t byte_time() const;
    bool sends() const { return (state_.control & 2) != 0; }
    void send(std::uint8_t byte);
    void begin_to_send();
    void sent();

    DeviceHost &host_;
    Settings settings_;
    State state_;
};

} // namespace fledge::emulator
