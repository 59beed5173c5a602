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
#include "registers/slave_clock.h"

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

    /// Before a tick: whether the computer is down at t. It is for the time `down` from when the count of its resets
    /// has changed; no tick starts then, and the first one after that finds the computer reset (clock.h). Further
    /// resets within that time change nothing.
    bool is_down(std::int64_t t, std::uint32_t resets, std::int64_t down);

    /// Tell flight that the run has ended.
    void stop();

    /// What it knows besides the registers, for a snapshot.
    std::vector<std::byte> save() const;
    /// Go on from there. Throws Error if the bytes are of other boards.
    void restore(std::span<const std::byte> saved);

private:
    const RegisterWindow &window(std::string_view board) const;
    const RegisterLane &lane(std::string_view board, std::string_view lane, bool from_flight) const;

    Backend &backend_;
    const RegisterWindow *master_ = nullptr;
    std::vector<RegisterSlaveClock> slaves_;
    struct {
        std::int64_t until = -1;  ///< -1: it runs
        std::uint64_t resets = 0; ///< of the computer, as seen last
    } down_;
};

} // namespace fledge::registers
