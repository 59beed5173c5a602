// SPDX-License-Identifier: Apache-2.0
// Flight on a board at a serial line (line.h), whose windows are a mirror of the board's.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "record/file_sink.h"
#include "registers/backend.h"
#include "registers/line.h"
#include "registers/serial_port.h"

namespace fledge::registers {

/// A line and what happens to a run when it fails, as DEVICE?baud=921600&reset=go-on&cut=5&pace=1&build=1a2b...
struct LineSettings {
    std::string device;          ///< "pty": a pseudo terminal, made here
    std::uint32_t baud = 921600; ///< [bits/s]
    bool goes_on = false;        ///< reset=go-on: a board that was reset begins flight within the run
    double cut = 0;              ///< [s] how long a line may be cut or silent; 0: as long as a tick may take
    double pace = 0;             ///< simulated seconds per second, to tell how late answers were; 0: not paced
    std::string build;           ///< of the program that is expected; "": any

    /// Throws Error that names the option.
    static LineSettings read(const std::string &text);
};

class LineBackend : public Backend {
public:
    struct Mission {
        std::string name;
        std::uint64_t hash; ///< of its tables
    };

    /// Opens the device. record: the file for the record of flight, "" for none. Throws Error with the remedy.
    LineBackend(std::span<const RegisterBoard *const> boards, Mission mission, LineSettings settings,
                std::string record);
    ~LineBackend() override;
    LineBackend(const LineBackend &) = delete;
    LineBackend &operator=(const LineBackend &) = delete;

    /// The device, which another program opens if it is a pseudo terminal.
    const std::string &path() const { return port_->path(); }

    /// Wait until a board with this mission has answered; `lives`: whether there may be one. Throws Error.
    void greet(std::chrono::nanoseconds timeout, const std::function<bool()> &lives);

    std::span<const RegisterWindow> windows() const override { return windows_; }
    /// Throws Error if the board was reset, or the line cut, and the run is to end then.
    Wait await_done(const RegisterWindow &clock, std::chrono::nanoseconds timeout) override;

    /// After the run was stopped: take what the board has left to say. Returns its exit status; throws Error if it does
    /// not come.
    int end(std::chrono::nanoseconds timeout, const std::function<bool()> &lives);

    /// Print figures, as lines of a key and a value.
    void print() const;

private:
    void greet_anew(bool go_on);
    void check_welcome() const;
    bool pump(std::chrono::nanoseconds wait);
    void push();
    void take(const LineMessage &message);
    void take_record(const LineMessage &message);
    void take_text(std::span<const std::uint8_t> text);
    void close_record(bool whole);
    void check_line(const std::string &what);
    void begin(const RegisterWindow &clock, const Tick &tick);
    void answer(const Tick &tick);
    std::int64_t due(std::int64_t t) const;
    std::string no_greeting() const;
    void report(const std::string &what) const;
    [[noreturn]] void fail(const std::string &what) const;

    Mission mission_;
    LineSettings settings_;
    std::unique_ptr<SerialPort> port_;
    std::unique_ptr<LineEnd> line_;
    std::vector<std::vector<std::uint64_t>> memory_; ///< words of 8 bytes, for their alignment
    std::vector<RegisterWindow> windows_;
    std::vector<std::uint32_t> shadow_;
    LineMirror mirror_{};
    std::span<const std::byte> unsent_; ///< of a frame

    LineWelcome board_{};      ///< of the session
    bool greeted_ = false;     ///< the session is open
    bool checked_ = false;     ///< and its board flies what it should
    bool was_reset_ = false;   ///< the board waits for a greeting again
    std::uint32_t former_ = 0; ///< the boot of the board, when another one answered the same greeting
    bool pushing_ = false;     ///< some of what has changed here was not sent yet
    bool complained_ = false;  ///< about the present silence
    std::string wrong_;        ///< the impossible content of a message
    std::int64_t begun_ = 0;   ///< [ns] when the present wait began
    std::int64_t gone_ = -1;   ///< [ns] since when the device is not there
    std::uint32_t ticked_ = 0; ///< the tick that was sent last
    std::int64_t t_ = -1;      ///< [ns] and its simulated time
    int status_ = -1;          ///< with which the board ended; -1: it has not

    std::string record_, text_;
    std::string shout_; ///< the board's last one
    FileSink sink_{.fd = -1, .error = 0, .marked = {}, .part = {}};
    bool recording_ = false;
    std::uint32_t recorded_ = 0; ///< [bytes]

    std::uint64_t ticks_ = 0;
    std::uint32_t resets_ = 0, cuts_ = 0, missed_ = 0;
    std::int64_t spent_ = 0, longest_ = 0; ///< [ns] from ticks to answers
    std::int64_t zero_ = -1;               ///< [ns] when t = 0 was due
    std::vector<std::uint32_t> late_;      ///< a histogram of lateness
};

} // namespace fledge::registers
