// SPDX-License-Identifier: Apache-2.0
// What the parts of the controller share. Private to them.
#pragma once

#include "cosim/controller/controller.h"
#include "sim/text.h"

namespace fledge::cosim {

using sim::format_list;
using sim::format_time;

inline constexpr Ns longest_time = 1'000'000'000'000'000'000; // 31 years; sums of a few do not overflow

inline void add_fault(std::string &faults, const std::string &text)
{
    faults += (faults.empty() ? "" : "\n") + text;
}

/// "0.5 s", or what comes before the first instant.
inline std::string when(Ns t)
{
    return t < 0 ? "the start" : format_time(t);
}

inline bool is_payload(const Bytes &payload, std::size_t size)
{
    return payload.size() == size + 4 && payload[0] == std::byte{0} && payload[1] <= std::byte{1} &&
           payload[2] == std::byte{0} && payload[3] == std::byte{0};
}

/// The place of a kind in Message.
template <class M, std::size_t I = 0> constexpr std::size_t kind_of()
{
    if constexpr (std::is_same_v<M, std::variant_alternative_t<I, Message>>) {
        return I;
    } else {
        return kind_of<M, I + 1>();
    }
}

template <class Request, class Reply> void Controller::send(NodeId id, Request request)
{
    ask(id, std::move(request), kind_of<Reply>());
}

} // namespace fledge::cosim
