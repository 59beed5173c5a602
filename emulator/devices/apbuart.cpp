// SPDX-License-Identifier: Apache-2.0
#include "emulator/devices/apbuart.h"

#include <algorithm>

namespace fledge::emulator {

namespace {
enum : std::uint32_t { data = 0x00, status = 0x04, control = 0x08, scaler = 0x0C };
enum : std::uint32_t {
    data_ready = 1 << 0,
    shifted_out = 1 << 1,
    fifo_empty = 1 << 2,
    overrun = 1 << 4,
    fifo_half_empty = 1 << 7,
    input_half_full = 1 << 8,
    fifo_full = 1 << 9,
    input_full = 1 << 10
};
enum : std::uint32_t {
    receiver = 1 << 0,
    transmitter = 1 << 1,
    receiver_interrupt = 1 << 2,
    transmitter_interrupt = 1 << 3,
    loop_back = 1 << 7,
    fifo_available = 1u << 31
};
} // namespace

Apbuart::Apbuart(std::string name, DeviceHost &host, const Settings &settings)
    : Device(std::move(name)), host_(host), settings_(settings)
{
    reset();
}

void Apbuart::reset()
{
    // As a boot loader leaves it: enabled.
    state_ = {};
    state_.control = receiver | transmitter;
}

std::uint64_t Apbuart::byte_time() const
{
    return std::uint64_t{state_.scaler + 1} * 8 * 10;
}

std::uint32_t Apbuart::read(std::uint32_t offset)
{
    switch (offset) {
    case data: {
        const std::uint8_t byte = state_.in[0];
        if (state_.n_in > 0) {
            state_.n_in--;
            std::copy_n(state_.in.begin() + 1, state_.n_in, state_.in.begin());
        }
        return byte;
    }
    case status: {
        const std::uint32_t in = std::min(state_.n_in, fifo), out = state_.n_out;
        // While bytes leave, the shift register holds one, the FIFO the others.
        const std::uint32_t shifting = out > 0 && sends() ? 1 : 0, queued = out - shifting;
        const auto flag = [](bool set, std::uint32_t bit) { return set ? bit : 0; };
        return flag(in > 0, data_ready) | flag(shifting == 0, shifted_out) | flag(queued == 0, fifo_empty) |
               flag(queued < fifo / 2, fifo_half_empty) | flag(in >= fifo / 2, input_half_full) |
               flag(out == fifo, fifo_full) | flag(in == fifo, input_full) | state_.errors | queued << 20 | in << 26;
    }
    case control: return state_.control | fifo_available;
    case scaler: return state_.scaler;
    default: return 0;
    }
}

void Apbuart::write(std::uint32_t offset, std::uint32_t value)
{
    switch (offset) {
    case data: send(static_cast<std::uint8_t>(value)); break;
    case status: state_.errors &= value; break;
    case control: {
        const bool sent_before = sends();
        state_.control = value & ~fifo_available;
        if (!sent_before && sends()) {
            begin_to_send();
        }
        break;
    }
    case scaler: state_.scaler = value & 0xFFF; break;
    default: break;
    }
}

void Apbuart::send(std::uint8_t byte)
{
    if (state_.n_out == fifo) {
        return;
    }
    state_.out[state_.n_out++] = byte;
    if (sends() && (!settings_.baud || state_.n_out == 1)) {
        begin_to_send();
    }
}

/// The bytes that wait leave, now that the transmitter is on and idle.
void Apbuart::begin_to_send()
{
    while (!settings_.baud && state_.n_out > 0) {
        sent();
    }
    if (state_.n_out > 0) {
        state_.sent_at = host_.cycles() + byte_time();
        host_.changed();
    }
}

/// The first byte has left.
void Apbuart::sent()
{
    const std::uint8_t byte = state_.out[0];
    state_.n_out--;
    std::copy_n(state_.out.begin() + 1, state_.n_out, state_.out.begin());
    if (state_.control & loop_back) {
        receive({&byte, 1});
    } else if (transmit) {
        transmit(byte);
    }
    if (state_.control & transmitter_interrupt) {
        host_.raise(settings_.interrupt);
    }
}

void Apbuart::act()
{
    state_.sent_at += byte_time();
    sent();
}

std::size_t Apbuart::receive(std::span<const std::uint8_t> bytes)
{
    if (!(state_.control & receiver)) {
        return 0;
    }
    const std::size_t n = std::min<std::size_t>(bytes.size(), input_room - state_.n_in);
    std::copy_n(bytes.begin(), n, state_.in.begin() + state_.n_in);
    state_.n_in += static_cast<std::uint32_t>(n);
    state_.errors |= n < bytes.size() ? std::uint32_t{overrun} : 0u;
    if (n > 0 && (state_.control & receiver_interrupt)) {
        host_.raise(settings_.interrupt);
    }
    return n;
}

} // namespace fledge::emulator
