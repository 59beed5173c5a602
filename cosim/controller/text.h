// SPDX-License-Identifier: Apache-2.0
// Parts of the controller's messages.
#pragma once

#include "cosim/protocol/protocol.h"
#include "sim/text.h"

namespace fledge::cosim {

using sim::format_list;
using sim::format_time;

inline void add_fault(std::string &faults, const std::string &text)
{
    faults += (faults.empty() ? "" : "\n") + text;
}

/// "0.5 s"; before the first instant, "the start".
inline std::string when(Ns t)
{
    return t < 0 ? "the start" : format_time(t);
}

} // namespace fledge::cosim
