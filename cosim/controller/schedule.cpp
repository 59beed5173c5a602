// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/schedule.h"

#include <algorithm>

namespace fledge::cosim {

Ns Schedule::next_after(Ns t) const
{
    Ns next = for_ever;
    for (const Rate &rate : rates) {
        next = std::min(next, t < rate.offset ? rate.offset
                                              : rate.offset + ((t - rate.offset) / rate.period + 1) * rate.period);
    }
    return next;
}

Ns Schedule::longest_period() const
{
    Ns longest = 0;
    for (const Rate &rate : rates) {
        longest = std::max(longest, rate.period);
    }
    return longest;
}

std::string Schedule::fault() const
{
    for (const Rate &rate : rates) {
        if (rate.period <= 0 || rate.period > longest_time || rate.offset < 0 || rate.offset > longest_time) {
            return "a step of " + std::to_string(rate.period) + " ns from " + std::to_string(rate.offset) +
                   " ns on; a period is > 0, an offset >= 0";
        }
    }
    return rates.empty() && !any_time ? "it never steps" : "";
}

std::string format_rates(const std::vector<Rate> &rates)
{
    std::vector<std::string> each;
    each.reserve(rates.size());
    for (const Rate &rate : rates) {
        each.push_back(format_time(rate.period) + (rate.offset ? " from " + format_time(rate.offset) + " on" : ""));
    }
    return format_list(each);
}

} // namespace fledge::cosim
