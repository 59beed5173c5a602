// SPDX-License-Identifier: Apache-2.0
#include "cosim/controller/config.h"

#include "cosim/controller/text.h"

#include <algorithm>
#include <set>
#include <stdexcept>

namespace fledge::cosim {

void ControllerConfig::check() const
{
    if (end < 0 || end > longest_time || batch < 1 || ahead < 4 || nodes.empty()) {
        throw std::invalid_argument("a co-simulation has nodes, an end from 0 to 31 years, batches of at least 1 "
                                    "instant, and readers that may lag by at least 4 messages");
    }
    std::set<std::string> names;
    for (const NodeConfig &node : nodes) {
        if (!names.insert(node.name).second) {
            throw std::invalid_argument("two nodes are called " + node.name);
        }
        if (node.joins == Join::at_time && (node.joins_after < 0 || node.joins_after >= end)) {
            throw std::invalid_argument(node.name + " joins after " + when(node.joins_after) +
                                        "; expected a time from 0 to before the end at " + when(end));
        }
        if (node.save_every < 0) {
            throw std::invalid_argument(node.name + " saves every " + std::to_string(node.save_every) +
                                        " ns; expected a time > 0, or 0 for where there is need");
        }
    }
    if (std::none_of(nodes.begin(), nodes.end(), [](const NodeConfig &n) { return n.joins == Join::at_start; })) {
        throw std::invalid_argument("no node is there at the start; at least one has to be");
    }
    for (const AsynchronousConfig &program : asynchronous) {
        if (!names.insert(program.name).second) {
            throw std::invalid_argument("an asynchronous program is called " + program.name + ", as another is");
        }
    }
}

} // namespace fledge::cosim
