// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cosim/protocol/protocol.h"
#include "sim/text.h"

#include <limits>

namespace fledge::cosim {

using sim::format_list;
using sim::format_time;

inline constexpr Ns for_ever = std::numeric_limits<Ns>::max();

/// "0.5 s"; before the first instant, "the start".
inline std::string when(Ns t)
{
    return t < 0 ? "the start" : format_time(t);
}

/// When a node steps, and when it may write.
struct Schedule {
    std::vector<Rate> rates = {}; ///< it steps at offset + k period of each
    bool any_time = false;        ///< it may write between these instants, too

    /// The first instant after t; for_ever without rates.
    Ns next_after(Ns t) const;
    /// The first instant at which a node that has reached t may write.
    Ns first_write_after(Ns t) const { return any_time ? t + 1 : next_after(t); }
    Ns longest_period() const;

    /// Why no node can step like this; "" if it can.
    std::string fault() const;

    bool operator==(const Schedule &) const = default;
};

/// "0.1 s from 0.05 s on and 1 s"
std::string format_rates(const std::vector<Rate> &rates);

} // namespace fledge::cosim
