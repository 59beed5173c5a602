// SPDX-License-Identifier: Apache-2.0
// Who sees all that nodes say to one another, without a part in it: records, and those who watch.
#pragma once

#include "cosim/controller/controller.h"

#include <string>
#include <vector>

namespace fledge::cosim {

/// Called by the Router, on its thread, between two ticks: what takes its time slows the run. What it
/// throws ends the run.
class Witness {
public:
    virtual ~Witness() = default;

    /// The nodes are matched and step from here on; again at each epoch.
    virtual void began(const Exchange &exchange) = 0;
    /// What a node wrote: good, in order, with the times of writing.
    virtual void wrote(const std::string &node, const std::vector<Record> &records) = 0;
    /// No node will write up to and including this instant any more; unless, after one was lost, another
    /// comes.
    virtual void settled(Ns) {}
    /// The run is over; "" if regularly.
    virtual void ended(const std::string &reason) = 0;
};

} // namespace fledge::cosim
