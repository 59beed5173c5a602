// SPDX-License-Identifier: Apache-2.0
// A serial port, or either end of a pseudo terminal, as raw bytes. Linux only.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace fledge::registers {

class SerialPort {
public:
    /// Open a device, of which no other program has hold. Throws Error with the remedy.
    SerialPort(const std::string &path, std::uint32_t baud);
    /// Make a pseudo terminal: another program opens other_end() as its serial port. Throws Error.
    SerialPort();
    ~SerialPort();
    SerialPort(const SerialPort &) = delete;
    SerialPort &operator=(const SerialPort &) = delete;

    const std::string &path() const { return path_; }
    std::uint32_t baud() const { return baud_; } ///< 0: a pseudo terminal, which has none
    bool is_open() const { return fd_ >= 0; }

    /// The bytes that have come; waits for the first one so long, or until send() has room. Once the device has
    /// vanished, is_open() is false.
    std::size_t receive(std::span<std::byte> room, std::chrono::nanoseconds timeout, bool until_room = false);
    /// Takes the bytes that it has room for, at least none.
    std::size_t send(std::span<const std::byte> bytes);
    /// After the device has vanished: whether it is there again.
    bool reopen();

private:
    void open();
    void close();

    std::string path_;
    std::uint32_t baud_ = 0;
    int fd_ = -1;
    int other_ = -1; ///< of a pseudo terminal: its other end, without which this one fails until that is opened
};

} // namespace fledge::registers
