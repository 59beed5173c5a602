// SPDX-License-Identifier: Apache-2.0
// The models' side of a register space: the ends of its lanes, in their units and byte order, and
// the tick. Set-up may throw; an exchange takes nothing from the heap and throws nothing.
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

/// A fault at set-up: names the board and lane, what was found, and the valid choices.
struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Counts of an end since it was made.
struct Counts {
    std::uint64_t passed = 0;    ///< written or read
    std::uint64_t refused = 0;   ///< not written: the queue was full, or the size not the lane's
    std::uint64_t corrupt = 0;   ///< read, but no writer writes such a packet
    std::uint64_t saturated = 0; ///< held at the end of a field's range
};

/// Common to both ends of a lane.
class LaneEnd {
public:
    const RegisterLane &lane() const { return *lane_; }
    const Counts &counts() const { return counts_; }
    /// Lost in the lane, on either side.
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

/// Writes what flight will read: a sensor's or a ground station's end.
class LaneWriter : public LaneEnd {
public:
    LaneWriter(const RegisterWindow &window, const RegisterLane &lane) : LaneEnd(window, lane) {}

    /// A packet as it is outside: its header is removed, its units swapped, flight's header added.
    RegisterStatus put(std::span<const std::byte> packet, std::uint32_t tag = 0);
    RegisterStatus put_word(std::uint32_t value, std::uint32_t index = 0);
    RegisterStatus put_message(const RegisterMessage &type, const void *message);
    /// One field of a word that is not queued, in its unit; the word's other fields stay.
    RegisterStatus set(std::size_t field, double value, std::uint32_t index = 0);
};

/// Reads what flight has written: an actuator's or a ground station's end.
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
    /// Throws Error if no board has a clock. The back end must outlive it and its lanes' ends.
    explicit Outside(Backend &backend);

    /// The end of a lane by the names of board and lane; throws Error. Of each lane only one end.
    LaneWriter writer(std::string_view board, std::string_view lane) const;
    LaneReader reader(std::string_view board, std::string_view lane) const;

    /// One exchange: time goes to the clocks of all boards, and flight runs. The first board with a
    /// clock is the master, whose answer counts; those of other boards only show the time.
    Wait tick(Tick tick, std::chrono::nanoseconds timeout);

    /// Tell flight that the run has ended.
    void stop();

private:
    const RegisterWindow &window(std::string_view board) const;
    const RegisterLane &lane(std::string_view board, std::string_view lane, bool from_flight) const;

    Backend &backend_;
    const RegisterWindow *master_ = nullptr;
};

} // namespace fledge::registers
