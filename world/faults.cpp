// SPDX-License-Identifier: Apache-2.0
#include "world/faults.h"

#include "sim/error.h"
#include "sim/text.h"

namespace fledge::world {

void check_faults(const std::string &name, std::span<const Fault> faults, std::size_t channels, bool limited)
{
    for (std::size_t i = 0; i < faults.size(); i++) {
        const Fault &fault = faults[i];
        const auto require = [&](bool holds, const std::string &rule, double found) {
            if (!holds) {
                throw sim::SetupError(name + ".faults[" + std::to_string(i) + "]." + rule + "; found " +
                                      sim::format_number(found));
            }
        };
        const std::uint64_t end = std::uint64_t{1} << channels;
        require(fault.channels < end,
                "channels: there are " + std::to_string(channels) + ", a bit for each, so it must be below " +
                    std::to_string(end),
                fault.channels);
        const double size = fault.size;
        switch (fault.kind) {
        case FAULT_HIGH:
        case FAULT_LOW:
        case FAULT_BABBLE:
            require(limited || size > 0.0, "size: not every channel has limits, so it must be > 0, the limit", size);
            break;
        case FAULT_DROPOUT:
            require(size >= 0.0 && size <= 1.0, "size: of a drop-out, a share of the updates, must be in [0, 1]", size);
            break;
        case FAULT_DELAY:
            require(size > 0.0 && size <= 1e9, "size: of a delay, in seconds, must be in (0, 1e9]", size);
            break;
        default: break;
        }
    }
}

} // namespace fledge::world
