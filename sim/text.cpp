// SPDX-License-Identifier: Apache-2.0
#include "sim/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace fledge::sim {

std::string format_number(double x)
{
    if (!std::isfinite(x)) {
        return std::isnan(x) ? "nan" : x > 0.0 ? "inf" : "-inf";
    }
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, x).ptr;
    return {text, end};
}

std::string format_time(Ns t)
{
    std::string text = std::to_string(std::abs(t / 1'000'000'000));
    const Ns rest = std::abs(t % 1'000'000'000);
    if (rest) {
        std::string digits = std::to_string(1'000'000'000 + rest).substr(1);
        digits.erase(digits.find_last_not_of('0') + 1);
        text += "." + digits;
    }
    return (t < 0 ? "-" : "") + text + " s";
}

std::string format_list(const std::vector<std::string> &names)
{
    if (names.empty()) {
        return "(none)";
    }
    std::string text = names.front();
    for (std::size_t i = 1; i < names.size(); i++) {
        text += (i + 1 == names.size() ? " and " : ", ") + names[i];
    }
    return text;
}

std::string bounds_text(const FledgeField &field)
{
    const bool lo = field.bounds & FLEDGE_HAS_LO, hi = field.bounds & FLEDGE_HAS_HI;
    const bool lo_open = field.bounds & FLEDGE_LO_OPEN, hi_open = field.bounds & FLEDGE_HI_OPEN;
    const std::string low = format_number(field.lo), high = format_number(field.hi);
    return lo && hi ? (lo_open ? "in (" : "in [") + low + ", " + high + (hi_open ? ")" : "]")
           : lo     ? (lo_open ? "> " : ">= ") + low
           : hi     ? (hi_open ? "< " : "<= ") + high
                    : "";
}

std::string index_text(const FledgeField &field, std::size_t element, std::uint32_t dims)
{
    std::vector<std::size_t> index(field.ndim);
    for (std::uint32_t i = field.ndim; i-- > 0;) {
        index[i] = element % field.shape[i];
        element /= field.shape[i];
    }
    std::string text;
    for (std::uint32_t i = 0; i < std::min(dims, field.ndim); i++) {
        text += (i ? ", " : "[") + std::to_string(index[i]);
    }
    return text.empty() ? text : text + "]";
}

} // namespace fledge::sim
