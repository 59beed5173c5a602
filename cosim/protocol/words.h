// SPDX-License-Identifier: Apache-2.0
// Enumerators and their names in options, records and Python.
#pragma once

#include "cosim/protocol/protocol.h"

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

namespace fledge::cosim {

inline constexpr std::pair<std::string_view, Latency> latency_words[] = {{"same_instant", Latency::same_instant},
                                                                         {"next_instant", Latency::next_instant},
                                                                         {"next_exchange", Latency::next_exchange}};

template <class T, std::size_t N>
std::optional<T> meant_by(const std::pair<std::string_view, T> (&words)[N], std::string_view word)
{
    for (const auto &[known, choice] : words) {
        if (known == word) {
            return choice;
        }
    }
    return std::nullopt;
}

template <class T, std::size_t N> std::string_view word_for(const std::pair<std::string_view, T> (&words)[N], T choice)
{
    for (const auto &[word, known] : words) {
        if (known == choice) {
            return word;
        }
    }
    return "";
}

} // namespace fledge::cosim
