// SPDX-License-Identifier: Apache-2.0
// The models' side of a register space: the ends of its lanes, with their units and byte order, and the tick. The
// set-up may throw. An exchange neither allocates nor throws.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "registers/backend.h"
#include "registers/field.h"
#include "registers/message.h"

namespace fledge::registers {

/// A fault at set-up: the message names the board, the lane, the wrong name and the valid ones.
struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Counters of an end.
struct Counts {
    std::uint64_t passed = 0;    ///< packets written or read
    std::uint64_t refused = 0;   ///< not written: the queue was full, or the size was wrong
    std::uint64_t corrupt = 0;   ///< read, but invalid
    std::uint64_t saturated = 0; ///< limited to the range of a field
};

/// Common to both ends of a lane.
class LaneEnd {
public:
    const RegisterLane &lane() const { return *lane_; }
    const Counts &counts() const { return counts_; }
    /// Packets lost in the lane, on either side.
    std::uint32_t lost() const { return register_lost(window_, lane_); }
    /// The index of a field by name; throws Error.
    std::size_t field(std::string_view name) const;

protected:
    LaneEnd(const RegisterWindow &window, const RegisterLane &lane);
    RegisterStatus count(RegisterStatus status);
    void swap_units(std::byte *bytes, std::size_t n) const;

    const RegisterWindow *window_;
    const RegisterLane *lane_;
    Counts counts_;
    std::vector<std::byte> scratch_; ///< a packet with its header
};

/// The writing end of a lane that flight reads, for a sensor or a ground station.
class LaneWriter : public LaneEnd {
public:
    LaneWriter(const RegisterWindow &window, const RegisterLane &lane) : LaneEnd(window, lane) {}

    /// Write a packet in the outside's format: remove its header, swap its units, add flight's header.
    RegisterStatus put(std::span<const std::byte> packet, std::uint32_t tag = 0);
    RegisterStatus put_word(std::uint32_t value, std::uint32_t index = 0);
    RegisterStatus put_message(const RegisterMessage &type, const void *message);
    /// Set one field, in its unit, of a word that is not queued. Other fields of the word do not change.
    RegisterStatus set(std::size_t field, double value, std::uint32_t index = 0);
};

/// The reading end of a lane that flight writes, for an actuator or a ground station.
class LaneReader : public LaneEnd {
public:
    LaneReader(const RegisterWindow &window, const RegisterLane &lane) : LaneEnd(window, lane) {}

    /// A packet in the outside's format; `packet` is valid until the next call.
    RegisterStatus take(std::span<const std::byte> &packet, RegisterInfo &info);
    RegisterStatus take_word(std::uint32_t &value, std::uint32_t index = 0);
    RegisterStatus take_message(const RegisterMessage &type, void *message, RegisterInfo &info);
    /// One field of a word that is not queued, in its unit.
    double get(std::size_t field, std::uint32_t index = 0) const;
};

/// The outside's end of a slave clock (clock.h).
class SlaveClock {
public:
    explicit SlaveClock(const RegisterWindow &window) : window_(&window), slave_(window.board->slave) { start(); }

    /// As at simulated time 0, without pulses and commands.
    void start();
    /// Show the time, and the pulses until then, at simulated time t >= 0 [ns], which never goes back.
    void show(std::int64_t t);
    /// Obey the command of flight, if there is one, at simulated time t [ns].
    void obey(std::int64_t t);
    /// Its time [ns] at the simulated time t [ns] if no command comes.
    std::int64_t at(std::int64_t t) const;

private:
    void store(std::uint32_t place, std::int64_t value) const;
    void store_status(std::int64_t t, bool refused);

    const RegisterWindow *window_;
    const RegisterSlave *slave_;
    std::int64_t since_, base_, offset_; ///< [ns] of the last command: simulated time, its time, and what it shall gain
    std::int64_t aligned_;               ///< [ns] its time at the next pulse, if aligning_
    std::int64_t shown_;                 ///< [ns]
    bool aligning_;
};

/// The boards of one flight computer.
class Outside {
public:
    /// Throws Error if not exactly one board has a clock. The back end must outlive it and its lanes' ends.
    explicit Outside(Backend &backend);

    /// The end of a lane, by the names of board and lane; throws Error. Make only one end of each lane.
    LaneWriter writer(std::string_view board, std::string_view lane) const;
    LaneReader reader(std::string_view board, std::string_view lane) const;

    /// One exchange: show the time on the slave clocks, start the tick of the clock, wait for flight to answer it, and
    /// let the slave clocks obey flight. A tick with t < 0 starts these anew.
    Wait tick(Tick tick, std::chrono::nanoseconds timeout);

    /// Tell flight that the run has ended.
    void stop();

private:
    const RegisterWindow &window(std::string_view board) const;
    const RegisterLane &lane(std::string_view board, std::string_view lane, bool from_flight) const;

    Backend &backend_;
    const RegisterWindow *master_ = nullptr;
    std::vector<SlaveClock> slaves_;
};

} // namespace fledge::registers
