// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

namespace fledge::cosim {

/// The names of topics as a node has them, and as the run has them: the same, behind a prefix, or others one by one.
/// So two missions whose processes have the same names fly in one run.
struct TopicMap {
    std::string prefix;                        ///< "a": the node's "/world/x" is "/a/world/x" in the run
    std::map<std::string, std::string> topics; ///< the node's topic -> that of the run; they need no prefix

    std::string to_run(const std::string &topic) const;
    /// None: the node has no name for it.
    std::optional<std::string> to_node(const std::string &topic) const;
    /// Why it cannot be used; "" if it can.
    std::string fault() const;
};

} // namespace fledge::cosim
