// SPDX-License-Identifier: Apache-2.0
// A board for tests: lanes laid one behind the other, in memory of its own.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "registers/clock.h"

namespace fledge::registers::testing {

inline constexpr RegisterDescriptor DESCRIPTOR = {0, 24, 24, 7, 31, 1};
inline constexpr std::uint32_t PLAIN = 0;
inline constexpr std::uint32_t QUEUED = REGISTER_QUEUED;
inline constexpr std::uint32_t OVERWRITE = REGISTER_OVERWRITE;
inline constexpr std::uint32_t VARIABLE = REGISTER_VARIABLE;

inline constexpr RegisterOutside NO_OUTSIDE = {0, 0, nullptr, 1, 0};

struct Shape {
    RegisterForm form = REGISTER_PACKET;
    std::uint32_t flags = 0;
    std::uint32_t capacity = 4;
    std::uint32_t depth = 4;
    bool described = false; // describing words in a ring of their own
    std::uint32_t count = 1;
    std::int32_t interrupt = -1;
    RegisterOutside outside = NO_OUTSIDE;
};

/// Lane addresses follow from the shapes; the clock is at 0 and eight interrupts are behind it.
class Bench {
public:
    /// slave: a slave clock, which gets its address here.
    Bench(std::vector<Shape> shapes, bool big_endian, const RegisterSlave *slave = nullptr)
    {
        std::uint32_t at = 32 + 8 * 8;
        for (const Shape &s : shapes) {
            RegisterLane lane{};
            const bool word = s.form == REGISTER_WORD;
            const bool queued = s.flags & REGISTER_QUEUED;
            lane.name = "lane";
            lane.form = s.form;
            lane.flags = s.flags;
            lane.address = at;
            lane.descriptors = REGISTER_NOWHERE;
            lane.capacity = word ? 4 : s.capacity;
            lane.stride = word ? 4 : (REGISTER_SLOT_HEAD + s.capacity + 7) / 8 * 8;
            lane.depth = queued ? s.depth : 4;
            lane.count = s.count;
            lane.interrupt = s.interrupt;
            lane.descriptor = DESCRIPTOR;
            lane.outside = s.outside;
            at += word && !queued ? 4 * s.count : REGISTER_CONTROL_SIZE + lane.depth * lane.stride;
            if (s.described) {
                lane.descriptors = at;
                at += 4 * lane.depth;
            }
            at = (at + 7) / 8 * 8;
            lanes_.push_back(lane);
        }
        if (slave) {
            slave_ = *slave;
            slave_.address = at;
            at += REGISTER_SLAVE_SIZE;
        }
        board_ = {"bench",
                  1,
                  0x80000000u,
                  at,
                  big_endian,
                  0,
                  -1,
                  32,
                  8,
                  0,
                  static_cast<std::uint32_t>(lanes_.size()),
                  lanes_.data(),
                  slave ? &slave_ : nullptr};
        words_.resize(at / 4);
        window_ = register_window(&board_, words_.data());
    }
    Bench(const Bench &) = delete;
    Bench &operator=(const Bench &) = delete;

    RegisterWindow *window() { return &window_; }
    const RegisterBoard &board() const { return board_; }
    const RegisterLane *lane(std::size_t i = 0) const { return &lanes_[i]; }
    const unsigned char *bytes() const { return reinterpret_cast<const unsigned char *>(words_.data()); }

private:
    std::vector<RegisterLane> lanes_;
    RegisterSlave slave_{};
    RegisterBoard board_{};
    std::vector<std::uint32_t> words_;
    RegisterWindow window_{};
};

} // namespace fledge::registers::testing
